"""Frames of one originator and one device as a capture has them: TCP segments, datagrams, time between them."""

from __future__ import annotations

import struct
from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.buses.registry import decoder as make_decoder
from pnfarm.captures.reading import CapturedFrame
from pnfarm.protocols.enip.identity_search import IdentitySearch
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire import message
from pnfarm.protocols.enip.wire.class1 import Class1Pdu, emit_class1
from pnfarm.protocols.enip.wire.cpf import (
    CommonPacket,
    ConnectedAddress,
    ConnectedData,
    NullAddress,
    UnconnectedData,
    emit_items,
)
from pnfarm.protocols.enip.wire.encapsulation import Command, EncapsulationPdu, emit_encapsulation
from pnfarm.protocols.enip.wire.epath import ElectronicKey, LogicalSegment, emit_epath, logical_path
from pnfarm.protocols.enip.wire.identity import IdentityItem
from pnfarm.wire.ethernet import EthernetFrame, emit_ethernet
from pnfarm.wire.ipv4 import Ipv4Packet, emit_ipv4
from pnfarm.wire.mac import multicast_mac
from pnfarm.wire.udp import UdpDatagram, emit_udp

if TYPE_CHECKING:
    from pnfarm.captures.decoder import Decoder, Line

__all__ = [
    "ACK", "FIN", "IDS", "MACS", "MANAGER", "RST", "SYN", "Tape", "behind", "command", "connect", "described",
    "everything", "forward_open", "known",
]  # fmt: skip

AKD = ElectronicKey(452, 16, 1, 1, 13)
MANAGER = logical_path(6, 1)
IDS = 0x00110001, 0x00220002
GET = Service.GET_ATTRIBUTE_SINGLE

MACS = bytes.fromhex("020000000001"), bytes.fromhex("020000000011")
ADDRESSES = IPv4Address("10.77.0.1"), IPv4Address("10.77.0.11")
PORTS = 50_000, 44818
SYN, FIN, RST, ACK = 2, 1, 4, 16
SESSION = 0x11


def described(decoder: Decoder, lines: list[Line]) -> list[str]:
    """Family, and what is said."""
    del decoder
    return [f"{x.family}: {x.description.what} {x.description.text}".rstrip() for x in lines]


def behind(lines: list[str], beginning: str) -> list[str]:
    """What lines of this beginning say behind it."""
    return [line.removeprefix(beginning).strip() for line in lines if line.startswith(beginning)]


class Tape:
    """Side 0 is the originator, side 1 the device; frames are kept, and can be decoded in any order."""

    def __init__(self, *, opened: bool = True) -> None:
        self.frames: list[bytes] = []
        self.times: list[int] = []
        self.now = 10**18
        self.next = [1000, 0xFFFFFFF0]
        self.context = 0
        if opened:
            self.segment(0, flags=SYN)
            self.segment(1, flags=SYN | ACK)
            self.segment(0)

    def segment(self, side: int, data: bytes = b"", flags: int = ACK) -> bytes:
        """One segment behind the last one of this side."""
        own, other = PORTS[side], PORTS[1 - side]
        numbers = self.next[side], self.next[1 - side]
        header = struct.pack("!HHIIBBHHH", own, other, *numbers, 0x50, flags, 65535, 0, 0)
        self.next[side] = (self.next[side] + len(data) + bool(flags & (SYN | FIN))) % (1 << 32)
        return self.ip(side, 6, header + data, ADDRESSES[1 - side])

    def udp(self, side: int, data: bytes, ports: tuple[int, int] = (2222, 2222), to: IPv4Address | None = None) -> None:
        to = to or ADDRESSES[1 - side]
        self.ip(side, 17, emit_udp(UdpDatagram(*ports, data), ADDRESSES[side], to), to)

    def ip(self, side: int, protocol: int, payload: bytes, to: IPv4Address, ms: float = 1.0) -> bytes:
        mac = multicast_mac(to) if to.is_multicast else b"\xff" * 6 if to.packed[3] == 255 else MACS[1 - side]
        packet = emit_ipv4(Ipv4Packet(ADDRESSES[side], to, protocol, payload))
        frame = emit_ethernet(EthernetFrame(mac, MACS[side], 0x0800, packet))
        self.now += int(ms * 1e6)
        self.frames.append(frame)
        self.times.append(self.now)
        return frame

    def encapsulated(self, side: int, command: int, data: bytes = b"", session: int = SESSION, status: int = 0) -> None:
        self.segment(side, emit_encapsulation(EncapsulationPdu(command, data, session, status)))

    def packed(self, side: int, octets: bytes) -> bytes:
        """A CIP message in SendRRData."""
        del side
        items = CommonPacket((NullAddress(), UnconnectedData(octets)))
        return emit_encapsulation(EncapsulationPdu(Command.SEND_RR_DATA, items.emit(), SESSION))

    def ask(self, request: message.MessageRequest) -> None:
        self.segment(0, self.packed(0, request.emit()))

    def answer(self, service: int, data: bytes = b"", status: int = 0, extended: tuple[int, ...] = ()) -> None:
        self.segment(1, self.packed(1, message.MessageReply(service, status, extended, data).emit()))

    def connected(self, side: int, connection: int, count: int, octets: bytes) -> None:
        """A CIP message in SendUnitData."""
        items = ConnectedAddress(connection), ConnectedData(count.to_bytes(2, "little") + octets)
        data = CommonPacket(items).emit()
        self.encapsulated(side, Command.SEND_UNIT_DATA, data)

    def io(
        self, side: int, connection: int, sequence: int, data: bytes, *, count: int | None = None,
        header: int | None = None, to: IPv4Address | None = None, ms: float = 10.0,
    ) -> None:  # fmt: skip
        pdu = Class1Pdu(connection, sequence & 0xFFFFFFFF, sequence & 0xFFFF if count is None else count, data, header)
        self.now += int((ms - 1) * 1e6)
        self.udp(side, emit_class1(pdu), to=to)

    def lines(self, frames: list[bytes] | None = None, **options: bool) -> list[str]:
        """All frames, or these, in words."""
        return described(*self.decoded(frames, **options))

    def decoded(self, frames: list[bytes] | None = None, **options: bool) -> tuple[Decoder, list[Line]]:
        decoder = make_decoder(**options)
        found: list[Line] = []
        times = self.times if frames is None else range(10**18, 10**18 + 10**6 * len(frames), 10**6)
        for number, (frame, time_ns) in enumerate(zip(self.frames if frames is None else frames, times, strict=True)):
            found += decoder.feed(CapturedFrame(number + 1, time_ns, frame, None, None))
        return decoder, found


def identity(name: bytes = b"AKD") -> IdentityItem:
    return IdentityItem(IPv4Address("10.77.0.11"), 452, 16, 1, (1, 13), 0x30, 0x1234, name, 3)


def known(tape: Tape) -> Tape:
    """The device says who it is."""
    tape.udp(0, IdentitySearch(500).question(), (50_000, 44818), IPv4Address("10.77.0.255"))
    answer = EncapsulationPdu(Command.LIST_IDENTITY, emit_items((identity(),)))
    tape.udp(1, emit_encapsulation(answer), (44818, 50_000))
    return tape


def forward_open(**changes: object) -> fo.ForwardOpen:
    key = (AKD, LogicalSegment(0, 4), LogicalSegment(1, 100), LogicalSegment(3, 101), LogicalSegment(3, 102))
    values = {
        "triad": fo.Triad(7, 0x1234, 0x5678),
        "o_to_t_id": 0,
        "t_to_o_id": IDS[1],
        "o_to_t_rpi_us": 10_000,
        "o_to_t": fo.NetworkParameters(70),
        "t_to_o_rpi_us": 10_000,
        "t_to_o": fo.NetworkParameters(66),
        "transport": fo.TransportClass(1),
        "path": emit_epath(key),
        "timeout_multiplier": 1,
    }
    return fo.ForwardOpen(**values | changes)  # type: ignore[arg-type]


def connect(tape: Tape, asked: fo.ForwardOpen | None = None, api_us: int = 10_000) -> None:
    asked = asked or forward_open()
    service = Service.LARGE_FORWARD_OPEN if asked.large else Service.FORWARD_OPEN
    tape.ask(message.message_request(service, MANAGER, fo.emit_forward_open(asked)))
    reply = fo.ForwardOpenReply(IDS[0], asked.t_to_o_id, asked.triad, api_us, api_us)
    tape.answer(service, reply.emit())


def command(control: int = 0, kind: int = 0x26, response: int = 0x20, **words: int) -> bytes:
    octets = bytearray(64)
    octets[0], octets[2], octets[3] = control, kind, response
    for name, place in (("data", 4), ("position", 8), ("velocity", 12), ("up", 16), ("down", 20), ("value", 24)):
        octets[place : place + 4] = struct.pack("<i", words.get(name, 0))
    octets[32] = words.get("attribute", 0)
    return bytes(octets)


def everything() -> list[bytes]:
    """Frames of each kind."""
    tape = known(Tape())
    tape.encapsulated(0, Command.REGISTER_SESSION, b"\1\0\0\0", session=0)
    connect(tape)
    connect(tape, forward_open(large=True, triad=fo.Triad(9, 1, 1)))
    tape.ask(message.message_request(GET, logical_path(0x0F, 1, 1)))
    tape.answer(GET, bytes(4))
    asked = [message.message_request(GET, logical_path(1, 1, number)) for number in (1, 7)]
    inner = [one.emit() for one in asked]
    tape.ask(
        message.message_request(
            Service.MULTIPLE_SERVICE_PACKET, logical_path(2, 1), message.emit_multiple_service(inner)
        )
    )
    tape.connected(0, 5, 1, inner[0])
    tape.io(0, IDS[0], 1, command(), header=1)
    tape.io(1, IDS[1], 1, bytes(64))
    tape.io(0, IDS[0], 2, command(0x81), header=1)
    tape.segment(0, flags=FIN)
    return tape.frames
