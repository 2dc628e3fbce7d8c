"""A foreign controller on the memory switch of a virtual line, octet by octet: it uses none of the project's codecs.

A :class:`Habit` says how it differs from others; the values are those of captured controllers.
"""

from __future__ import annotations

import itertools
import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from uuid import UUID

from bystander import CALL_PORT, Bystander

from pnfarm.engine.tick import receive

if TYPE_CHECKING:
    from ipaddress import IPv4Interface

    from pnfarm.protocols.ip.host import DatagramReceived
    from pnfarm.station.station import Station

RPC_PORT = 34964
DEVICE = UUID("dea00001-6c97-11d1-8271-00a02442df7d")
CONTROLLER = UUID("dea00002-6c97-11d1-8271-00a02442df7d")
CONNECT, RELEASE, READ, WRITE, CONTROL = range(5)
REQUEST, PING, RESPONSE, FAULT, WORKING, NO_CALL, REJECT = range(7)

#: Records of captured start-ups: (slot, subslot, index, octets).
INTERFACE_ADJUST = (0, 0x8000, 0x8071, bytes.fromhex("025000080100 0000 00000001"))
MRP_CHECK = (0, 0x8000, 0x8051, bytes.fromhex("021300180100 0000 c3d687fe789e03a1acdbe5bfcbbc27b6 00000000"))
MRP_ADJUST = (
    0,
    0x8000,
    0x8052,
    bytes.fromhex("021100240100 0000 c3d687fe789e03a1acdbe5bfcbbc27b6 0000 0000 0b 6d7270646f6d61696e2d31"),
)
#: A domain's name one octet shorter: what follows in a multiple write is padded.
ODD_RECORD = (
    0,
    0x8000,
    0x8052,
    bytes.fromhex("021100230100 0000 c3d687fe789e03a1acdbe5bfcbbc27b6 0000 0000 0a 6d7270646f6d61696e2d"),
)
PORT_ADJUST = (0, 0x8001, 0x802F, bytes.fromhex("020200140100 0000 0000 8001 0226 0008 0100 0000 0001 0000"))
PLL_CONTROL = (0, 0x8000, 0xB050, bytes.fromhex("b05000080100 0000 00010000"))
TRACE_UNIT = (0, 0x8001, 0xB060, bytes.fromhex("b060000c0100 0000 0001ffdc 00000000"))
FSU_OCTETS = bytes.fromhex("060900200100 0000 060100180100 0000 00000001 bff0dcf98e38cf3c13052323b4b5d901")
AR_FSU = (0, 0, 0xE050, FSU_OCTETS)


#: Tell one controller's connection and calls from another's.
_numbers = itertools.count(1)


@dataclass(frozen=True)
class Habit:
    """How one controller connects; times in the fields' units.

    ``missing`` are (slot, subslot) that the device does not have, ``silent`` ones that it has; neither stands in an
    IOCR.  ``alarm_early``: the AlarmCR comes before the IOCRs.
    """

    name: str
    little_endian: bool = True
    properties: int = 0x00000011
    activity_timeout: int = 600
    #: Instance, device and vendor number of the initiator's object.
    tail: str = "0064010e002a"
    rt_class: int = 2
    references: tuple[int, int] = (1, 2)
    frame_ids: tuple[int, int] = (0x8000, 0xFFFF)
    send_clock: int = 32
    ratio: int = 16
    phases: tuple[int, int] = (1, 1)
    factor: int = 3
    iocr_tag: int = 0xC000
    alarm_tags: tuple[int, int] = (0xC000, 0xA000)
    alarm_early: bool = False
    alarm_timeout: int = 1
    alarm_reference: int = 0
    alarm_length: int = 200
    one_block: bool = False
    only_telegram: bool = False
    discards: bool = False
    missing: tuple[tuple[int, int], ...] = ()
    silent: tuple[tuple[int, int], ...] = ()
    announces_set: bool = False
    records: tuple[tuple[int, int, int, bytes], ...] = (INTERFACE_ADJUST,)
    writes: str = "multiple"
    padding: int = 0
    ping: bool = False


def block(kind: int, body: bytes) -> bytes:
    return struct.pack(">HHBB", kind, len(body) + 2, 1, 0) + body


@dataclass
class Frame:
    """Where the places of one CR lie; ``length`` of the C_SDU."""

    data: list[tuple[int, int, int, int]] = field(default_factory=list)
    iocs: list[tuple[int, int, int, int]] = field(default_factory=list)
    length: int = 40


class ForeignController(Bystander):
    """One AR to one drive: ``connect``, ``write_records``, ``end_parameters``, ``answer_ready``, ``feed``."""

    def __init__(self, line, ip: IPv4Interface, habit: Habit, station: Station) -> None:
        self.line, self.habit, self.station = line, habit, station
        number = next(_numbers)
        self.uuid = UUID(int=0xF0E1D2C3 << 96 | number)
        self.activity = UUID(int=0xAC1D << 112 | number)
        self.sequence = 0
        self.arrived: list[tuple[int, int, bytes]] = []
        self.output_id = 0
        self._counter = 0
        super().__init__(line.world, "foreign", bytes.fromhex("020000feed01"), ip)
        self.ip.open_ports |= {RPC_PORT}

    def other_datagram(self, event: DatagramReceived) -> None:
        self.arrived.append((event.destination_port, event.source_port, event.data))

    def settle(self) -> None:
        # answers to its own port are taken raw, before the project's client sees them
        if hasattr(self, "arrived"):
            taken = list(self.ip.events())
            for event in taken:
                if hasattr(event, "destination_port"):
                    self.arrived.append((event.destination_port, event.source_port, event.data))
        super().settle()

    # remote procedure calls

    def _order(self) -> str:
        return "<" if self.habit.little_endian else ">"

    def _uuid(self, value: UUID) -> bytes:
        return value.bytes_le if self.habit.little_endian else value.bytes

    def _header(self, kind: int, *, target: UUID, interface: UUID, activity: bytes, sequence: int, opnum: int,
                length: int, flags: int = 0x20) -> bytes:  # fmt: skip
        order = self._order()
        head = struct.pack("BBBB", 4, kind, flags, 0) + (b"\x10\0\0" if self.habit.little_endian else b"\0\0\0") + b"\0"
        head += self._uuid(target) + self._uuid(interface) + activity
        head += struct.pack(f"{order}IIIHHHHH", 0, 1, sequence, opnum, 0xFFFF, 0xFFFF, length, 0)
        return head + b"\0\0"

    def _send(self, data: bytes, port: int = CALL_PORT, to: int = RPC_PORT) -> None:
        address = self.station.device.ip.address
        self.ip.learn(address.ip, self.station.port.mac, self.now)
        self.ip.send(port, address.ip, to, data, self.now)
        self.settle()

    def _await(self, port: int) -> tuple[int, bytes]:
        """The next datagram at one of its ports: source port and octets."""
        assert self.run(2.0, until=lambda: any(a[0] == port for a in self.arrived)), "the device keeps silent"
        found = next(a for a in self.arrived if a[0] == port)
        self.arrived.remove(found)
        return found[1], found[2]

    @property
    def target(self) -> UUID:
        return self.station.device.rpc.config.endpoints[0].object_uuid

    def ping(self) -> int:
        """The kind of PDU that answers a Ping for a call that never was."""
        self._send(
            self._header(
                PING, target=self.target, interface=DEVICE, activity=self._uuid(self.activity),
                sequence=self.sequence, opnum=0, length=0, flags=0,
            )
        )  # fmt: skip
        return self._await(CALL_PORT)[1][1]

    def ask(self, opnum: int, payload: bytes, room: int = 4096) -> tuple[int, bytes]:
        """PNIOStatus and payload of the answer."""
        order = self._order()
        room = max(room, len(payload))
        body = struct.pack(f"{order}IIIII", room, len(payload), room, 0, len(payload)) + payload
        head = self._header(
            REQUEST, target=self.target, interface=DEVICE, activity=self._uuid(self.activity),
            sequence=self.sequence, opnum=opnum, length=len(body),
        )  # fmt: skip
        self.sequence += 1
        self._send(head + body)
        _, answer = self._await(CALL_PORT)
        assert answer[1] == RESPONSE, f"PDU of type {answer[1]}"
        own = "<" if answer[4] & 0x10 else ">"
        status, length, _, _, actual = struct.unpack(f"{own}IIIII", answer[80:100])
        assert length == actual == len(answer) - 100
        # PNIOStatus is a number of the call, so it follows its data representation
        return status, answer[100:]

    # Connect

    def _places(self) -> list[tuple[int, int, int, int, int, int, int]]:
        """(api, slot, module ident, subslot, submodule ident, input octets, output octets) of the drive."""
        found = [
            (s.api, s.slot, s.module_ident, s.subslot, s.submodule_ident, s.input_bytes, s.output_bytes)
            for module in self.station.device.cm.plugged.modules()
            for s in module.submodules
            if s.slot or not self.habit.only_telegram
        ]
        return sorted(found)

    def _hidden(self, slot: int, subslot: int) -> bool:
        return (slot, subslot) in {*self.habit.missing, *self.habit.silent}

    def _frames(self) -> tuple[Frame, Frame]:
        frames = Frame(), Frame()
        ends = [0, 0]
        places = [p for p in self._places() if not self._hidden(p[1], p[3])]
        for way in (0, 1):
            for api, slot, _, subslot, _, inputs, outputs in places:
                octets = outputs if way else inputs
                if not octets and (way or outputs):
                    continue
                none = self.habit.discards and not inputs and not outputs
                frames[way].data.append((api, slot, subslot, 0 if none else ends[way]))
                ends[way] += 0 if none else octets + 1
        for way in (0, 1):
            for api, slot, _, subslot, _, inputs, outputs in places:
                if not (inputs or not outputs if way else outputs):
                    continue
                none = self.habit.discards and not inputs and not outputs
                frames[way].iocs.append((api, slot, subslot, 0 if none else ends[way]))
                ends[way] += 0 if none else 1
            frames[way].length = max(40, ends[way])
        return frames

    def _iocr(self, way: int, frame: Frame) -> bytes:
        h = self.habit
        body = struct.pack(
            ">HHHIHHHHHHIHHH6x", way + 1, h.references[way], 0x8892, h.rt_class, frame.length, h.frame_ids[way],
            h.send_clock, h.ratio, h.phases[way], 0, 0xFFFFFFFF, h.factor, h.factor, h.iocr_tag,
        )  # fmt: skip
        apis = sorted({p[0] for p in (*frame.data, *frame.iocs)})
        body += struct.pack(">H", len(apis))
        for api in apis:
            body += struct.pack(">I", api)
            for places in (frame.data, frame.iocs):
                own = [p for p in places if p[0] == api]
                body += struct.pack(">H", len(own)) + b"".join(struct.pack(">HHH", *p[1:]) for p in own)
        return block(0x0102, body)

    def _submodule(self, subslot: int, ident: int, inputs: int, outputs: int) -> bytes:
        kind = (1 if inputs else 0) | (2 if outputs else 0)
        octets = struct.pack(">HIH", subslot, ident, kind | (0x20 if self.habit.discards and not kind else 0))
        if inputs or not outputs:
            octets += struct.pack(">HHBB", 1, inputs, 1, 1)
        if outputs:
            octets += struct.pack(">HHBB", 2, outputs, 1, 1)
        return octets

    def _expected(self) -> list[bytes]:
        places = self._places()
        slots = sorted({(p[0], p[1], p[2]) for p in places})
        modules = []
        for api, slot, ident in slots:
            own = [p[3:] for p in places if p[:3] == (api, slot, ident)]
            own += [(subslot, 0xFFFF010A, 0, 0) for s, subslot in self.habit.missing if s == slot]
            body = struct.pack(">IHIHH", api, slot, ident, 0, len(own))
            modules.append(body + b"".join(self._submodule(*p) for p in own))
        if self.habit.one_block:
            return [block(0x0104, struct.pack(">H", len(modules)) + b"".join(modules))]
        return [block(0x0104, struct.pack(">H", 1) + module) for module in modules]

    def connect_octets(self) -> bytes:
        h = self.habit
        inputs, outputs = self._frames()
        name = h.name.encode()
        ar = struct.pack(">H16sH6s", 1, self.uuid.bytes, 1, self.mac)
        ar += UUID(f"dea00000-6c97-11d1-8271-{h.tail}").bytes
        ar += struct.pack(">IHHH", h.properties, h.activity_timeout, 0x8892, len(name)) + name
        alarm = struct.pack(
            ">HHIHHHHHH", 1, 0x8892, 0, h.alarm_timeout, 3, h.alarm_reference, h.alarm_length, *h.alarm_tags
        )
        iocrs = [self._iocr(0, inputs), self._iocr(1, outputs)]
        alarms = [block(0x0103, alarm)]
        rest = [*alarms, *iocrs, *self._expected()] if h.alarm_early else [*iocrs, *self._expected(), *alarms]
        announced = [block(0x010B, b"\0\0" + FSU_OCTETS)] if h.announces_set else []
        return b"".join([block(0x0101, ar), *rest, *announced])

    def connect(self) -> dict[int, list[bytes]]:
        """The answer's blocks by type; fails where it is not OK."""
        status, answer = self.ask(CONNECT, self.connect_octets())
        assert status == 0, f"0x{status:08X}"
        blocks: dict[int, list[bytes]] = {}
        while answer:
            kind, length = struct.unpack(">HH", answer[:4])
            blocks.setdefault(kind, []).append(answer[6 : 4 + length])
            answer = answer[4 + length :]
        for body in blocks[0x8102]:
            iocr_type, _, frame_id = struct.unpack(">HHH", body)
            if iocr_type == 2:
                self.output_id = frame_id
        return blocks

    # records

    def _write_header(self, number: int, api: int, slot: int, subslot: int, index: int, length: int) -> bytes:
        body = struct.pack(">H16sIHHHHI", number, self.uuid.bytes, api, slot, subslot, 0, index, length)
        return block(0x0008, body.ljust(58, b"\0"))

    def write_records(self) -> list[int]:
        """The status of each record."""
        h, records = self.habit, self.habit.records
        fill = bytes([h.padding])
        if h.writes == "container":
            octets = b""
            for slot, subslot, index, data in records:
                octets += fill * (-len(octets) % 4)
                octets += block(0x0401, struct.pack(">HIHHHH", 0, 0, slot, subslot, 0, index) + data)
            records = ((0, 0x8000, 0x80B0, octets),)
        if h.writes == "single":
            statuses = []
            for number, (slot, subslot, index, data) in enumerate(records):
                head = self._write_header(number, 0, slot, subslot, index, len(data))
                status, answer = self.ask(WRITE, head + data)
                statuses.append(status or struct.unpack(">I", answer[44:48])[0])
            return statuses
        octets = b""
        for number, (slot, subslot, index, data) in enumerate(records):
            octets += fill * (-len(octets) % 4)
            octets += self._write_header(number, 0, slot, subslot, index, len(data)) + data
        outer = self._write_header(0, 0xFFFFFFFF, 0xFFFF, 0xFFFF, 0xE040, len(octets))
        status, answer = self.ask(WRITE, outer + octets)
        assert status == 0, f"0x{status:08X}"
        assert len(answer) == 64 * (len(records) + 1)
        return [struct.unpack(">I", answer[at + 44 : at + 48])[0] for at in range(64, len(answer), 64)]

    def read(self, slot: int, subslot: int, index: int, api: int = 0) -> tuple[int, bytes]:
        body = struct.pack(">H16sIHHHHI", 1, self.uuid.bytes, api, slot, subslot, 0, index, 4096)
        status, answer = self.ask(READ, block(0x0009, body.ljust(58, b"\0")))
        return status, answer[64:]

    # control

    def _control(self, kind: int, command: int) -> bytes:
        return block(kind, struct.pack(">H16sHHHH", 0, self.uuid.bytes, 1, 0, command, 0))

    def end_parameters(self) -> None:
        status, answer = self.ask(CONTROL, self._control(0x0110, 1))
        assert (status, answer) == (0, self._control(0x8110, 8))

    def answer_ready(self) -> tuple[int, bytes]:
        """Confirm ApplicationReady at the port that it came from; that port, and what follows the control block."""
        port, call = self._await(RPC_PORT)
        assert call[1] == REQUEST
        theirs = "<" if call[4] & 0x10 else ">"
        make = (lambda b: UUID(bytes_le=b)) if call[4] & 0x10 else (lambda b: UUID(bytes=b))
        assert make(call[8:24]) == UUID(f"dea00000-6c97-11d1-8271-{self.habit.tail}")
        assert make(call[24:40]) == CONTROLLER
        sequence, opnum = struct.unpack(f"{theirs}IH", call[64:70])
        assert opnum == CONTROL
        payload = call[100:]
        assert payload[:32] == self._control(0x0112, 2)
        answer = self._control(0x8112, 8)
        # the answer is in this controller's representation, its activity as the device made it
        order = self._order()
        body = struct.pack(f"{order}IIIII", 0, len(answer), len(answer), 0, len(answer)) + answer
        activity = make(call[40:56])
        head = self._header(
            RESPONSE, target=make(call[8:24]), interface=CONTROLLER, activity=self._uuid(activity),
            sequence=sequence, opnum=opnum, length=len(body), flags=0x0A,
        )  # fmt: skip
        self._send(head + body, RPC_PORT, port)
        return port, payload[32:]

    def release(self) -> None:
        status, answer = self.ask(RELEASE, self._control(0x0114, 4))
        assert (status, answer) == (0, self._control(0x8114, 8))

    # cyclic data

    def feed(self, seconds: float = 0.2) -> None:
        """Good data to the drive's engine, in the layout that was asked for; time passes."""
        h = self.habit
        cycle = h.send_clock * h.ratio * 31_250
        _, outputs = self._frames()
        columns = self.line.farm.columns
        for _ in range(max(2, round(seconds * 1e9 / cycle))):
            self._counter = (self._counter + h.send_clock * h.ratio) & 0xFFFF
            octets = self.station.port.mac + self.mac + b"\x81\0" + struct.pack(">H", h.iocr_tag) + b"\x88\x92"
            octets += self.output_id.to_bytes(2, "big") + b"\x80" * outputs.length
            octets += self._counter.to_bytes(2, "big") + b"\x35\0"
            columns.rx_frames[0, : len(octets)] = list(octets)
            columns.rx_length[0], columns.rx_port[0], columns.rx_ns[0] = len(octets), self.station.port.index, self.now
            receive(columns, 1)
            self.run(cycle / 1e9)
