"""The two ends of EtherNet/IP as they are fuzzed: a drive's target, and an originator.

Inputs were good messages; they are changed as octets of the stream, as items or as a CIP request, and wrapped again
with the right lengths, so that what is wrong reaches the layer that it is meant for.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from random import Random

from enip_bench import MANAGER, PEER, SECOND, Bench, explicit_request, io_request

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.eds.text import Eds, EdsEntry, EdsSection, EdsString, emit_eds
from pnfarm.protocols.enip.encapsulation import SendStream
from pnfarm.protocols.enip.originator import Originator
from pnfarm.protocols.enip.originator_events import SendTcp
from pnfarm.protocols.enip.wire import cpf, message
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire.class1 import Class1Pdu, emit_class1
from pnfarm.protocols.enip.wire.encapsulation import (
    Command,
    EncapsulationPdu,
    emit_encapsulation,
    parse_encapsulation,
)
from pnfarm.protocols.enip.wire.epath import ElectronicKey, logical_path
from tests.fuzz.mutate import mutated, random_octets

__all__ = ["ENIP", "enip_layers"]

EXAMPLES = Path(__file__).parents[2] / "configs" / "eds"

#: Entries that one end may hold, whatever it is fed.
MOST_HELD = 64


def _requests() -> list[bytes]:
    """CIP requests of every kind that is carried out."""
    singles = [
        message.message_request(0x0E, logical_path(class_id, 1, attribute))
        for class_id in (1, 2, 4, 6, 0x0F, 0x48, 0xF5, 0xF6)
        for attribute in (1, 3)
    ]
    opens = [
        io_request(1, key=ElectronicKey(452)),
        io_request(2, points=(100, 193, 102), o_to_t=2),
        io_request(3, points=(100, 194, 102), o_to_t=2),
        io_request(4, kind=2, points=(100, 193, 102), o_to_t=2, large=True),
        explicit_request(5),
    ]
    several = message.emit_multiple_service([request.emit() for request in singles[:4]])
    others = [
        message.message_request(0x01, logical_path(1, 1)),
        message.message_request(0x03, logical_path(1, 1), b"\2\0\1\0\7\0"),
        message.message_request(0x04, logical_path(0x48, 1), b"\1\0\4\0\5"),
        message.message_request(0x05, logical_path(1, 1), b"\0"),
        message.message_request(0x0A, logical_path(2, 1), several),
        message.message_request(0x10, logical_path(0x0F, 1, 1), bytes(4)),
        message.message_request(0x52, MANAGER, fo.UnconnectedSend(singles[0].emit()).emit()),
        *(message.message_request(0x5B if one.large else 0x54, MANAGER, fo.emit_forward_open(one)) for one in opens),
        *(message.message_request(0x4E, MANAGER, fo.ForwardClose(one.triad, one.path).emit()) for one in opens),
    ]
    return [request.emit() for request in (*singles, *others)]


def _unconnected(session: int, request: bytes) -> EncapsulationPdu:
    packet = cpf.CommonPacket((cpf.NullAddress(), cpf.UnconnectedData(request)))
    return EncapsulationPdu(Command.SEND_RR_DATA, packet.emit(), session)


def enip_layers() -> dict[str, list[bytes]]:
    """What each parser begins with: both ends' messages, and what is inside them."""
    bench = Bench()
    session = bench.register()
    requests = _requests()
    messages = [emit_encapsulation(_unconnected(session, request)) for request in requests]
    messages += [emit_encapsulation(EncapsulationPdu(command)) for command in (0x00, 0x04, 0x63, 0x64, 0x66)]
    messages.append(emit_encapsulation(EncapsulationPdu(Command.REGISTER_SESSION, b"\1\0\0\0")))
    for octets in messages:
        bench.drive.received(1, octets, bench.now)
    messages += [output.data for output in bench.collect() if isinstance(output, SendStream)]
    packets = [
        pdu.data for pdu in map(parse_encapsulation, messages) if pdu.command == Command.SEND_RR_DATA and pdu.data
    ]
    inside = [item.data for packet in packets for item in cpf.CommonPacket.parse(packet).items[1:2]]
    bodies = [message.parse_request(request).data for request in requests]
    sheet = Eds((EdsSection("Device", (EdsEntry("VendCode", ("452",)), EdsEntry("Name", (EdsString("A$K"),)))),))
    return {
        "enip": messages,
        "enip-packet": packets,
        "enip-items": [packet[6:] for packet in packets],
        "enip-request": requests,
        "enip-reply": [octets for octets in inside if octets[0] & 0x80],
        "enip-body": [body for body in bodies if body],
        "enip-path": [message.parse_request(request).path for request in requests],
        "enip-class1": [emit_class1(Class1Pdu(1, 2, 3, bytes(64), header)) for header in (None, 0, 1)],
        "eds": [emit_eds(sheet, ["a sheet"]), *(path.read_bytes() for path in sorted(EXAMPLES.glob("*.eds")))],
    }


class TargetMachine:
    """A drive's streams and datagrams; now and then time passes and cyclic connections expire."""

    name = "enip-target"

    def __init__(self, rng: Random, layers: dict[str, list[bytes]]) -> None:
        self.layers = layers
        self._made = 0
        self._start()

    def _start(self) -> None:
        self.bench = Bench()
        self.session = self.bench.register()

    def prepared_input(self, rng: Random) -> bytes:
        self._made += 1
        if self._made % 20 == 0:
            self.revive(rng)
        if self._made % 3 == 0:
            # what was cut leaves a stream that waits for the rest
            self.bench.drive.closed(1, self.bench.now)
            self.session = self.bench.register()
        request = rng.choice(self.layers["enip-request"])
        depth = rng.randrange(5)
        if depth == 0:
            return random_octets(rng)
        if depth == 1:
            return mutated(rng, rng.choice(self.layers["enip"]), self.layers["enip"])
        if depth == 2:
            packet = mutated(rng, rng.choice(self.layers["enip-packet"]), self.layers["enip-packet"])
            return emit_encapsulation(EncapsulationPdu(Command.SEND_RR_DATA, packet[:60_000], self.session))
        if depth == 3:
            request = mutated(rng, request, self.layers["enip-request"])
        return emit_encapsulation(_unconnected(self.session, request[:60_000]))

    def revive(self, rng: Random) -> None:
        manager = self.bench.drive.manager
        for number in list(manager.connections):
            self.bench.drive.data_received(number, self.bench.now)
            if rng.random() < 0.2:
                self.bench.drive.expired(number, self.bench.now)
        self.bench.later(rng.choice((0.01, 1, 11, 130)))
        self.bench.events.clear()
        self.bench.sent.clear()
        assert len(manager.connections) <= MOST_HELD
        assert self.bench.drive.encapsulation.streams <= MOST_HELD
        if not self.bench.drive.encapsulation.sessions:
            self.session = self.bench.register()

    def feed(self, rng: Random, data: bytes) -> str:
        bench = self.bench
        if rng.random() < 0.1:
            bench.drive.datagram(data, PEER, bench.now, broadcast=rng.random() < 0.5)
        else:
            bench.drive.received(1, data, bench.now)
        return "answered" if bench.collect() else "silent"


class OriginatorMachine:
    """An originator whose target answers rubbish."""

    name = "enip-originator"

    def __init__(self, rng: Random, layers: dict[str, list[bytes]]) -> None:
        self.layers = layers
        self.now = 0
        self.originator = Originator()

    def prepared_input(self, rng: Random) -> bytes:
        octets = rng.choice(self.layers["enip"])
        if rng.random() < 0.3:
            return mutated(rng, octets, self.layers["enip"])
        try:
            pdu = parse_encapsulation(octets)
        except DecodeError:
            return octets
        reply = rng.choice(self.layers["enip-reply"])
        if rng.random() < 0.7:
            reply = mutated(rng, reply, self.layers["enip-reply"])
        number = self.originator._last_number.to_bytes(8, "little")
        packet = _unconnected(1, reply[:60_000]).data
        good = pdu.command == Command.REGISTER_SESSION or rng.random() < 0.2
        pdu = replace(pdu, session=1) if good else replace(pdu, command=0x6F, data=packet, context=number)
        return emit_encapsulation(pdu)

    def revive(self, rng: Random) -> None:
        """Time passes with each input."""

    def feed(self, rng: Random, data: bytes) -> str:
        one = self.originator
        if one.state == "Closed":
            one.opened(self.now)
            one.received(emit_encapsulation(EncapsulationPdu(Command.REGISTER_SESSION, b"\1\0\0\0", 1)), self.now)
        request = rng.choice((io_request(1), explicit_request(2)))
        if rng.random() < 0.5:
            one.forward_open(request, self.now)
        else:
            one.forward_close(request.triad, b"", self.now)
        one.received(data, self.now)
        self.now += rng.choice((1, SECOND // 10, SECOND))
        if (due := one.next_deadline()) is not None and due <= self.now:
            one.handle_timeout(self.now)
        sent = [output for output in one.take_outputs() if isinstance(output, SendTcp)]
        return "answered" if one.take_events() and sent else "silent"


ENIP = (TargetMachine, OriginatorMachine)
