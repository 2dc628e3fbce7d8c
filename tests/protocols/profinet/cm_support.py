"""What the tests of context management share: the CM calls of the captures, and a drive as it could be."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from ipaddress import IPv4Address
from pathlib import Path
from typing import NamedTuple
from uuid import UUID

import pytest

from pnfarm.protocols.profinet.cm.device.cmdev import CmDevice
from pnfarm.protocols.profinet.description import (
    DeviceDescription,
    Im0Description,
    Limits,
    ModuleDescription,
    Plugged,
    SubmoduleDescription,
)
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.records.handler import KeptRecords
from pnfarm.protocols.profinet.records.store import DeviceRecords
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.wire.any_block import emit_blocks, parse_blocks
from pnfarm.protocols.profinet.wire.block import Block, BlockType
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq, ArBlockReq
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand, control_response
from pnfarm.protocols.profinet.wire.cm.expected import (
    DataDescription,
    ExpectedApi,
    ExpectedSubmodule,
    ExpectedSubmoduleBlockReq,
)
from pnfarm.protocols.profinet.wire.cm.iocr import FrameSlot, IocrApi, IocrBlockReq
from pnfarm.protocols.profinet.wire.rpc.pdu import OK
from pnfarm.wire.octets import Reader

CAPTURES = Path(__file__).resolve().parents[3].parent / "shared" / "captures"
CAPTURE_NAMES = ("drive_connect_api3a00", "dacookie_connectrequest", "pnio-rs_s7-1515_golden")


class Call(NamedTuple):
    """A request or response PDU of a capture: its opnum and its blocks' octets."""

    frame: int
    request: bool
    opnum: int
    status: int
    payload: bytes


@cache
def calls(name: str) -> tuple[Call, ...]:
    """CM calls of one capture, in order.  Skips the test when the captures are absent."""
    path = CAPTURES / f"{name}.pcap"
    if not path.exists():
        pytest.skip(f"{path} is absent")
    from scapy.layers.inet import UDP
    from scapy.layers.l2 import Ether  # noqa: F401  scapy learns the link type by this import
    from scapy.utils import rdpcap

    found = []
    for number, packet in enumerate(rdpcap(str(path)), 1):
        if UDP not in packet:
            continue
        pdu = bytes(packet[UDP].payload)
        if len(pdu) < 100 or pdu[0] != 4 or pdu[1] not in {0, 2}:
            continue
        order = "little" if pdu[4] & 0x10 else "big"
        r = Reader(pdu[80:])
        status = int.from_bytes(r.bytes(4), order)
        length = int.from_bytes(r.bytes(4), order)
        r.skip(12)
        opnum = int.from_bytes(pdu[68:70], order)
        found.append(Call(number, pdu[1] == 0, opnum, status, r.bytes(length)))
    return tuple(found)


def connect_request(name: str) -> bytes:
    return next(c.payload for c in calls(name) if c.request and c.opnum == 0)


DRIVE_API = 0x3A00


def telegram(ident: int, sub_ident: int, input_bytes: int, output_bytes: int) -> ModuleDescription:
    """A drive's slot 1: a parameter access point and a telegram, as in the capture of a real drive."""
    return ModuleDescription(
        1,
        ident,
        (
            SubmoduleDescription(1, 1, DRIVE_API, ident, 0xFFFF),
            SubmoduleDescription(1, 2, DRIVE_API, ident, sub_ident, input_bytes, output_bytes),
        ),
    )


DAP = ModuleDescription(
    0,
    0x02,
    (
        SubmoduleDescription(0, 1, 0, 0x02, 0x01),
        SubmoduleDescription(0, 0x8000, 0, 0x02, 0x02),
        SubmoduleDescription(0, 0x8001, 0, 0x02, 0x03),
        SubmoduleDescription(0, 0x8002, 0, 0x02, 0x03),
    ),
)
IM0 = Im0Description("AKD-P00306-NBPN-0000", "S-1", 3, ("V", 1, 17, 0), 0, 0x3A00, 0x0000)

#: Fits the Connect request of drive_connect_api3a00.pcap; its slot 1 also takes a second telegram.
DRIVE = DeviceDescription(
    vendor_id=0x0105,
    device_id=0x0001,
    station_type="AKD",
    dap=DAP,
    im0=IM0,
    modules=(telegram(0x101, 0x69, 4, 4), telegram(0x100, 0x68, 12, 12)),
    limits=Limits(strict=False),
)


# A scripted controller: it knows blocks and nothing of the device's machine.

DEVICE_MAC = bytes.fromhex("020000000011")
CONTROLLER_MAC = bytes.fromhex("020000000001")
PEER = Peer(IPv4Address("10.0.0.1"), 49152)
UUID_1 = UUID("11111111-2222-3333-4444-555555555555")
UUID_2 = UUID("99999999-2222-3333-4444-555555555555")
OBJECT_UUID = UUID("dea00000-6c97-11d1-8271-000100010105")
LEGACY, ADVANCED = 0x00000011, 0x40000011
ROOM = 4096
MS = 1_000_000


def _sub(subslot, ident, inputs=0, outputs=0):
    kind = (1 if inputs else 0) | (2 if outputs else 0)
    data = []
    if inputs or not outputs:
        data.append(DataDescription(1, inputs))
    if outputs:
        data.append(DataDescription(2, outputs))
    return ExpectedSubmodule(subslot, ident, kind, tuple(data))


AR_BLOCK = ArBlockReq(1, UUID_1, 7, CONTROLLER_MAC, OBJECT_UUID, LEGACY, 100, 0x8892, b"plc-1")
INPUTS_BLOCK = IocrBlockReq(
    1,
    1,
    2,
    40,
    0x8001,
    32,
    2,
    (
        IocrApi(0, (FrameSlot(0, 1, 0), FrameSlot(0, 0x8000, 1), FrameSlot(0, 0x8001, 2), FrameSlot(0, 0x8002, 3))),
        IocrApi(DRIVE_API, (FrameSlot(1, 1, 4), FrameSlot(1, 2, 5)), (FrameSlot(1, 2, 18),)),
    ),
)
OUTPUTS_BLOCK = IocrBlockReq(
    2,
    2,
    2,
    40,
    0xFFFF,
    32,
    2,
    (
        IocrApi(0, (), (FrameSlot(0, 1, 0), FrameSlot(0, 0x8000, 1), FrameSlot(0, 0x8001, 2), FrameSlot(0, 0x8002, 3))),
        IocrApi(DRIVE_API, (FrameSlot(1, 2, 6),), (FrameSlot(1, 1, 4), FrameSlot(1, 2, 5))),
    ),
)
DAP_BLOCK = ExpectedApi(0, 0, 2, (_sub(1, 1), _sub(0x8000, 2), _sub(0x8001, 3), _sub(0x8002, 3)))
DRIVE_BLOCK = ExpectedApi(DRIVE_API, 1, 0x100, (_sub(1, 0xFFFF), _sub(2, 0x68, 12, 12)))
ALARM_BLOCK = AlarmCrBlockReq(local_alarm_reference=5)


@dataclass(frozen=True)
class Plan:
    """The blocks of a Connect to :data:`DRIVE`, each to be replaced by a test."""

    ar: ArBlockReq = AR_BLOCK
    inputs: IocrBlockReq = INPUTS_BLOCK
    outputs: IocrBlockReq = OUTPUTS_BLOCK
    dap: ExpectedApi = DAP_BLOCK
    drive: ExpectedApi = DRIVE_BLOCK
    alarm: AlarmCrBlockReq = ALARM_BLOCK
    extra: tuple[Block, ...] = ()
    blocks: tuple[Block, ...] | None = None

    def payload(self) -> bytes:
        if self.blocks is not None:
            return emit_blocks(self.blocks)
        expected = (ExpectedSubmoduleBlockReq((self.dap,)), ExpectedSubmoduleBlockReq((self.drive,)))
        return emit_blocks((self.ar, self.inputs, self.outputs, *expected, self.alarm, *self.extra))


class NoRecords:
    """An application without any record: every index is invalid."""

    def read(self, ar, api, slot, subslot, index, max_length, now):
        return RecordError(AccessError.INVALID_INDEX)

    def write(self, ar, api, slot, subslot, index, data, now):
        return RecordError(AccessError.INVALID_INDEX)


#: What a controller writes to the physical device at start-up.
START_UP = frozenset({0x802B, 0x802F, 0x8051, 0x8052, 0x8053, 0x8070, 0x8071, 0x8090, 0xB050, 0xB060})


def device_of(description, *, mac=DEVICE_MAC, application=None, io_data=None, pdev=None, texts=None):
    """A device with its records: without data and with a physical device that keeps what is written, unless given."""
    plugged = Plugged(description)
    records = DeviceRecords(
        description,
        plugged,
        lambda: device.ars,
        application=application or NoRecords(),
        io_data=io_data or (lambda _slot, _subslot, _output: None),
        pdev=pdev or KeptRecords(START_UP),
        texts={} if texts is None else texts,
    )
    device = CmDevice(description, plugged, records, mac=mac, station_name="axis-01", diagnosis=records.diagnosis)
    return device, plugged, records


class Bench:
    """One device with its records, and the controller's side of every call."""

    def __init__(self, description=DRIVE, **parts):
        self.cm, self.plugged, self.records = device_of(description, **parts)
        self.now = 0
        self.seen = []

    def call(self, opnum, payload, room=ROOM, peer=PEER):
        self.cm.receive_call("call", opnum, payload, room, peer, self.now)
        ((call, status, answer),) = self.cm.responses()
        assert call == "call"
        return status, answer

    def connect(self, plan=None, **changes):
        return self.call(0, (plan or replace(Plan(), **changes)).payload())

    def events(self):
        new = self.cm.events()
        self.seen += new
        return new

    def key(self):
        return self.cm.ars[-1].key

    def control(self, block_type, command, opnum=4, uuid=UUID_1, session=7, **fields):
        return self.call(opnum, ControlBlock(block_type, uuid, session, command, **fields).emit())

    def prm_end(self):
        return self.control(BlockType.PRM_END_REQ, ControlCommand.PRM_END)

    def release(self, **fields):
        return self.control(BlockType.RELEASE_REQ, ControlCommand.RELEASE, 1, **fields)

    def confirm(self, call, status=OK):
        """Answer ApplicationReady as a controller does."""
        request = parse_blocks(call.payload)[0]
        answer = control_response(request).emit() if status.ok else b""
        self.cm.call_returned(call.token, status, answer, self.now)

    def establish(self, **changes):
        """Connect up to DATA."""
        status, _ = self.connect(**changes)
        assert status.ok, self.events()
        key = self.key()
        assert self.prm_end()[0].ok
        assert self.cm.application_ready(key, self.now)
        self.cm.data_received(key, self.now)
        (call,) = self.cm.calls()
        self.confirm(call)
        return key
