"""A plain originator in memory and virtual time: one session, one cyclic connection at a time, no axis program."""

from __future__ import annotations

import asyncio
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.controller.line import VirtualLine
from pnfarm.engine.channels.class1_plan import Class1ConsumerPlan, Class1ProviderPlan
from pnfarm.engine.channels.schedule import ChannelTable
from pnfarm.engine.columns import allocate
from pnfarm.farm.file.reading import parse_farm
from pnfarm.links.base import PortSpec
from pnfarm.protocols.enip.originator import Originator
from pnfarm.protocols.enip.originator_events import (
    ConnectionEnded,
    ConnectionMade,
    ConnectionNotMade,
    OriginatorNote,
    RequestAnswered,
    RequestFailed,
    SendTcp,
    SessionEnded,
    SessionRegistered,
)
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.epath import (
    Logical,
    LogicalSegment,
    emit_epath,
    logical_path,
)
from pnfarm.protocols.enip.wire.forward_open import (
    ConnectionType,
    ForwardOpen,
    NetworkParameters,
    TransportClass,
    Triad,
)
from pnfarm.protocols.enip.wire.message import message_request
from pnfarm.table.channel import STATUS_GOOD, STATUS_RUN
from pnfarm.table.signals import ASSEMBLY, ASSEMBLY_WORDS, PART_HIGH, PART_LOW, word_code
from pnfarm.wire.endpoint import Services, StreamClosed, StreamData, StreamEnd, StreamOpened, StreamReceived
from pnfarm.wire.mac import multicast_mac

if TYPE_CHECKING:
    from pnfarm.drives.parameters.memory import NonVolatile
    from pnfarm.protocols.enip.wire.message import MessageReply
    from pnfarm.station.station import Station
    from pnfarm.wire.endpoint import SocketEvent

__all__ = ["DRIVES", "Peer", "Rig"]

DRIVES = """
farm: cip
link: {kind: memory}
drives:
  - {name: 'axis-{n}', count: 2, model: akd-ethernetip, ip: 10.77.0.11/23}
"""
OWN = IPv4Interface("10.77.1.100/23")
WORDS = [
    (word_code(ASSEMBLY + n, part), 4 * n + 2 * (part == PART_HIGH))
    for n in range(16)
    for part in (PART_LOW, PART_HIGH)
]
#: Connection path: assembly class, configuration 100, consumed, produced.
ASSEMBLY_CLASS = 4


def io_path(consumed: int = 101, produced: int = 102, configuration: int | None = 100) -> bytes:
    points = [LogicalSegment(Logical.CONNECTION_POINT, consumed), LogicalSegment(Logical.CONNECTION_POINT, produced)]
    first = [LogicalSegment(Logical.CLASS, ASSEMBLY_CLASS)]
    if configuration is not None:
        first.append(LogicalSegment(Logical.INSTANCE, configuration))
    return emit_epath([*first, *points])


class Peer:
    """A node of the virtual world with one originator."""

    def __init__(self, rig: Rig, address: IPv4Interface = OWN, number: int = 0) -> None:
        self.rig = rig
        self.address = address
        self.columns = allocate(images=1, channels=4)
        self.channels = ChannelTable(self.columns)
        self.link = rig.world.link()
        mac = bytes.fromhex("0200000000") + bytes([0x70 + number])
        (self.port,) = asyncio.run(self.link.open([PortSpec(f"peer-{number}", mac)]))
        self.columns.image[0].port = self.port.index
        self.link.sockets.set_user(self.socket_event)
        self.link.sockets.serve(self.port.index, Services(address, datagrams=(44818,), silent=(2222,)))
        rig.world.join(self, [self.port])
        self.originator = Originator()
        self.number = number
        self.stream: int | None = None
        self.notes: list[OriginatorNote] = []
        self.closed: list[int] = []
        self.target = IPv4Address("10.77.0.11")
        self.rows: dict[int, tuple[int, int]] = {}
        #: Whether its data have no run/idle header.
        self.modeless = False
        self.expired: list[int] = []
        self.frames: list[bytes] = []
        self.link.set_receiver(self.receive)
        self._serial = 0
        self._tail = 0

    # node

    def receive(self, port: int, frame: bytes, now: int) -> None:
        self.frames.append(frame)

    def socket_event(self, event: SocketEvent, now: int) -> None:
        match event:
            case StreamOpened():
                self.originator.opened(now)
            case StreamReceived(data=data):
                self.originator.received(data, now)
            case StreamClosed(stream=stream):
                self.closed.append(stream)
                self.originator.closed(now)
        self.pump()

    def service(self, now: int) -> None:
        self.originator.handle_timeout(now)
        self.pump()

    def next_deadline(self) -> int | None:
        return self.originator.next_deadline()

    def pump(self) -> None:
        for output in self.originator.take_outputs():
            if self.stream is None:
                continue
            action = StreamData(self.stream, output.data) if isinstance(output, SendTcp) else StreamEnd(self.stream)
            self.link.sockets.act(self.port.index, action)
        self.notes += self.originator.take_events()

    # what a test does

    def run(self, seconds: float = 0.01) -> None:
        self.rig.world.run(seconds)

    def connect(self, target: str = "10.77.0.11") -> None:
        """TCP and a session."""
        self.target = IPv4Address(target)
        self.originator, self.closed, self.notes = Originator(), [], []
        self.stream = self.link.sockets.connect(self.port.index, (self.target, 44818))
        self.run()
        assert isinstance(self.notes[-1], SessionRegistered), self.notes

    def ask(self, service: int, path: bytes, data: bytes = b"", seconds: float = 0.01) -> MessageReply:
        number = self.originator.request(message_request(service, path, data), self.rig.world.now)
        self.pump()
        self.run(seconds)
        for note in self.notes:
            if isinstance(note, RequestAnswered | RequestFailed) and note.number == number:
                assert isinstance(note, RequestAnswered), note
                return note.reply
        raise AssertionError(f"no answer: {self.notes[-3:]}")

    def get(self, cls: int, instance: int, attribute: int) -> MessageReply:
        return self.ask(Service.GET_ATTRIBUTE_SINGLE, logical_path(cls, instance, attribute))

    def set(self, cls: int, instance: int, attribute: int, data: bytes) -> MessageReply:
        return self.ask(Service.SET_ATTRIBUTE_SINGLE, logical_path(cls, instance, attribute), data)

    def asked(self, **changes: Any) -> ForwardOpen:
        """A Forward_Open of the exclusive owner at 10 ms; ``o_size``, ``t_size`` in octets with headers."""
        self._serial += 1
        o_size, t_size = changes.pop("o_size", 70), changes.pop("t_size", 66)
        multicast = changes.pop("multicast", False)
        kind = ConnectionType.MULTICAST if multicast else ConnectionType.POINT_TO_POINT
        values: dict[str, Any] = {
            "triad": Triad(self._serial, 0x1234, 0x5678 + self.number),
            "o_to_t_id": 0,
            "t_to_o_id": 0x10000 * (self.number + 1) + self._serial,
            "o_to_t_rpi_us": 10_000,
            "o_to_t": NetworkParameters(o_size, ConnectionType.POINT_TO_POINT),
            "t_to_o_rpi_us": 10_000,
            "t_to_o": NetworkParameters(t_size, kind),
            "transport": TransportClass(1),
            "path": io_path(),
        }
        return ForwardOpen(**values | changes)

    def open(self, **changes: Any) -> ConnectionMade | ConnectionNotMade:
        """Forward_Open, and if it succeeds both directions of its data."""
        asked = self.asked(**changes)
        number = self.originator.forward_open(asked, self.rig.world.now)
        self.pump()
        self.run(0.002)
        made = next(n for n in self.notes if isinstance(n, ConnectionMade | ConnectionNotMade) and n.number == number)
        if isinstance(made, ConnectionMade) and asked.transport.transport == 1:
            self._exchange(made)
        return made

    def _exchange(self, made: ConnectionMade) -> None:
        asked, reply = made.request, made.reply
        station = next(s for s in self.rig.farm.stations if s.config.ip.ip == self.target)
        groups = [item.address for item in made.items if not item.o_to_t]
        group = groups[0] if groups and asked.t_to_o.kind == ConnectionType.MULTICAST else None
        data = asked.o_to_t.size - 2
        header = data >= 4 and not self.modeless
        if group is not None:
            self.rig.world.switch.join(self.port.index, multicast_mac(group))
        consumer = self.channels.open_consumer(
            Class1ConsumerPlan(
                image=0, port=self.port.index,
                destination=self.port.mac if group is None else multicast_mac(group),
                destination_address=self.address.ip if group is None else group, source_address=self.target,
                connection_id=reply.t_to_o_id, data_length=asked.t_to_o.size - 2, rpi_ns=reply.t_to_o_api_us * 1000,
                multiplier=4, words=[word for word in WORDS if word[1] + 1 < asked.t_to_o.size - 2],
                first_hold_ns=10_000_000_000,
            )
        )  # fmt: skip
        provider = self.channels.open_provider(
            Class1ProviderPlan(
                image=0, port=self.port.index, destination=station.port.mac, source=self.port.mac,
                destination_address=self.target, source_address=self.address.ip, connection_id=reply.o_to_t_id,
                data_length=data - 4 * header, rpi_ns=reply.o_to_t_api_us * 1000,
                words=[word for word in WORDS if word[1] + 1 < data - 4 * header],
                run_idle=header,
            )
        )  # fmt: skip
        self.rows[asked.triad.serial] = (provider, consumer)

    def close(self, serial: int, path: bytes | None = None) -> OriginatorNote:
        """Forward_Close, and no more data."""
        triad = Triad(serial, 0x1234, 0x5678 + self.number)
        self.originator.forward_close(triad, io_path() if path is None else path, self.rig.world.now)
        self.pump()
        self.run()
        self.silence(serial)
        assert isinstance(self.notes[-1], ConnectionEnded | RequestAnswered), self.notes[-1]
        return self.notes[-1]

    def silence(self, serial: int) -> None:
        """Send and receive nothing more."""
        provider, consumer = self.rows.pop(serial)
        self.channels.close_provider(provider)
        self.channels.close_consumer(consumer)

    def mode(self, serial: int, *, run: bool) -> None:
        """The run/idle header."""
        self.columns.ppm[self.rows[serial][0]].data_status = STATUS_GOOD if run else STATUS_GOOD & ~STATUS_RUN

    def command(self, octets: bytes) -> None:
        """The command assembly that is sent from now on."""
        # the originator's image is the wrong way round: what it sends is its ``sent``
        self.columns.image[0].sent[ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS] = np.frombuffer(octets.ljust(64, b"\0"), "<i4")

    @property
    def response(self) -> bytes:
        """The response assembly that came last."""
        return bytes(self.columns.image[0].received[ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS].astype("<i4").tobytes())

    def received(self, serial: int) -> int:
        return int(self.columns.cpm[self.rows[serial][1]].received)

    def ended(self) -> bool:
        return any(isinstance(note, SessionEnded) for note in self.notes)


class Rig:
    """A farm in memory and virtual time, and its peers."""

    def __init__(self, text: str = DRIVES, peers: int = 1, memory: NonVolatile | None = None) -> None:
        self.line = asyncio.run(VirtualLine.create(parse_farm(text), memory=memory))
        self.world, self.farm = self.line.world, self.line.farm
        addresses = [IPv4Interface((int(OWN.ip) + n, 23)) for n in range(peers)]
        self.peers = [Peer(self, address, n) for n, address in enumerate(addresses)]
        if self.peers:
            self.peer = self.peers[0]
        # the drives look whether their addresses are free
        self.world.run(1.1)

    def station(self, name: str = "axis-1") -> Station:
        return self.farm.axis(name)

    def texts(self, name: str = "axis-1") -> list[str]:
        """The log of a drive."""
        return [entry.event for entry in self.farm.log.entries(name)]
