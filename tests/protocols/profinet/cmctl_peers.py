"""A plan to start from, and a device made of codecs alone that answers as it is told to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from uuid import UUID

from hypothesis import strategies as st

from pnfarm.protocols.profinet.cm.controller.cmctl import CmController, CmctlState
from pnfarm.protocols.profinet.cm.controller.events import ArFailed, CmctlEvent, ControllerCall
from pnfarm.protocols.profinet.cm.controller.plan import ArPlan, ParameterRecord, PlannedSubmodule
from pnfarm.protocols.profinet.wire.alarms.rta import error_status, parse_rta
from pnfarm.protocols.profinet.wire.any_block import emit_blocks, parse_blocks
from pnfarm.protocols.profinet.wire.block import Block, BlockType, split_blocks
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockRes, ArBlockReq, ArBlockRes
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand, control_response
from pnfarm.protocols.profinet.wire.cm.expected import (
    DiffApi,
    DiffModule,
    DiffSubmodule,
    IdentInfo,
    ModuleDiffBlock,
    ModuleState,
    SubmoduleProperties,
    submodule_state,
)
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockReq, IocrBlockRes
from pnfarm.protocols.profinet.wire.records.iod import (
    IodReadReqHeader,
    IodReadResHeader,
    IodWriteResHeader,
    emit_read_response,
    emit_write_response,
    parse_write_request,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import OK, Opnum, PnioStatus

DEVICE_MAC = bytes.fromhex("02000000d001")
CONTROLLER_MAC = bytes.fromhex("02000000c001")
AR_UUID = UUID("7d3a7927-6c58-48b2-a1db-5f55b0fc2196")
OTHER_UUID = UUID("7d3a7927-6c58-48b2-a1db-5f55b0fc2197")
DEVICE_ALARM_REFERENCE = 0x0014
OUTPUT_FRAME_ID = 0x8010

#: The modules of the captured PROFIdrive device: an access point and one telegram of twelve octets each way.
SUBMODULES = (
    PlannedSubmodule(0, 0, 2, 0x0001, 1),
    PlannedSubmodule(0, 0, 2, 0x8000, 2),
    PlannedSubmodule(0, 0, 2, 0x8001, 3),
    PlannedSubmodule(0, 0, 2, 0x8002, 3),
    PlannedSubmodule(0x3A00, 1, 0x100, 1, 0xFFFF),
    PlannedSubmodule(0x3A00, 1, 0x100, 2, 0x68, input_bytes=12, output_bytes=12),
)

#: Bends a good answer, or swallows it.
Change = Callable[[PnioStatus, bytes], "tuple[PnioStatus, bytes] | None"]


def make_plan(**changes: object) -> ArPlan:
    plan = ArPlan(
        vendor_id=0x0105,
        device_id=0x0001,
        instance=1,
        controller_name="plc-1",
        controller_mac=CONTROLLER_MAC,
        controller_object_uuid=UUID("dea00000-6c97-11d1-8271-00640101002a"),
        ar_uuid=AR_UUID,
        session_key=7,
        submodules=SUBMODULES,
    )
    return replace(plan, **changes)


@dataclass
class ScriptedDevice:
    """Answers each call as a good device would; ``change`` may bend the answer to one operation."""

    change: dict[int, Change] = field(default_factory=dict)
    record: bytes = b"record"
    refused_indexes: dict[int, PnioStatus] = field(default_factory=dict)
    module_diff: ModuleDiffBlock | None = None
    seen: list[ControllerCall] = field(default_factory=list)

    def answer(self, call: ControllerCall) -> tuple[PnioStatus, bytes] | None:
        """The answer, or None for silence."""
        self.seen.append(call)
        good = {
            Opnum.CONNECT: self._connect,
            Opnum.WRITE: self._write,
            Opnum.READ: self._read,
            Opnum.READ_IMPLICIT: self._read,
            Opnum.CONTROL: self._control,
            Opnum.RELEASE: self._control,
        }[Opnum(call.opnum)](call.payload)
        change = self.change.get(call.opnum)
        return change(*good) if change else good

    def _connect(self, payload: bytes) -> tuple[PnioStatus, bytes]:
        blocks = parse_blocks(payload)
        ar = next(b for b in blocks if isinstance(b, ArBlockReq))
        out: list[Block] = [ArBlockRes(ar.ar_type, ar.ar_uuid, ar.session_key, DEVICE_MAC)]
        for iocr in blocks:
            if isinstance(iocr, IocrBlockReq):
                frame_id = OUTPUT_FRAME_ID if iocr.frame_id == 0xFFFF else iocr.frame_id
                out.append(IocrBlockRes(iocr.iocr_type, iocr.iocr_reference, frame_id))
        out.append(AlarmCrBlockRes(1, DEVICE_ALARM_REFERENCE, 200))
        if self.module_diff is not None:
            out.append(self.module_diff)
        return OK, emit_blocks(out)

    def _write(self, payload: bytes) -> tuple[PnioStatus, bytes]:
        request = parse_write_request(payload)
        headers = [request.header] if request.header.index == 0xE040 else []
        headers += [write.header for write in request.writes]
        answers = [
            IodWriteResHeader(
                h.sequence_number,
                h.ar_uuid,
                h.api,
                h.slot,
                h.subslot,
                h.index,
                status=self.refused_indexes.get(h.index, OK),
            )
            for h in headers
        ]
        single = OK if request.header.index == 0xE040 else answers[0].status
        return single, emit_write_response(answers)

    def _read(self, payload: bytes) -> tuple[PnioStatus, bytes]:
        h = IodReadReqHeader.parse(payload)
        if h.index in self.refused_indexes:
            return self.refused_indexes[h.index], b""
        answer = IodReadResHeader(h.sequence_number, h.ar_uuid, h.api, h.slot, h.subslot, h.index)
        return OK, emit_read_response(answer, self.record)

    def _control(self, payload: bytes) -> tuple[PnioStatus, bytes]:
        return OK, control_response(ControlBlock.of(split_blocks(payload)[0])).emit()


@dataclass
class Line:
    """A controller and a scripted device in one process, in virtual time."""

    controller: CmController
    device: ScriptedDevice = field(default_factory=ScriptedDevice)
    now: int = 1_000
    events: list[CmctlEvent] = field(default_factory=list)
    unanswered: list[int] = field(default_factory=list)

    def run(self) -> list[CmctlEvent]:
        """Carry calls to and fro until nothing moves; the events since the last run."""
        while calls := self.controller.calls(self.now):
            for call in calls:
                answer = self.device.answer(call)
                if answer is None:
                    self.unanswered.append(call.key)
                else:
                    self.controller.call_returned(call.key, *answer, self.now)
        new = self.controller.events()
        self.events += new
        return new

    def ready(self, payload: bytes | None = None, opnum: int = Opnum.CONTROL) -> list[tuple[object, PnioStatus, bytes]]:
        """The device's ApplicationReady; the controller's answers to it."""
        sent = ready_payload(self.controller.plan) if payload is None else payload
        self.controller.receive_call("call", opnum, sent, self.now)
        return self.controller.responses()

    def start(self) -> list[CmctlEvent]:
        """The whole start-up; every event of it."""
        self.controller.connect(self.now)
        self.run()
        self.ready()
        self.run()
        return self.events


def ready_payload(
    plan: ArPlan,
    block_type: int = BlockType.APPLICATION_READY_REQ,
    diff: ModuleDiffBlock | None = None,
    **changes: object,
) -> bytes:
    block = ControlBlock(block_type, plan.ar_uuid, plan.session_key, ControlCommand.APPLICATION_READY)
    payload = replace(block, **changes).emit()
    return payload + (diff.emit() if diff else b"")


def without_block(payload: bytes, block_type: int) -> bytes:
    return emit_blocks([b for b in split_blocks(payload) if b.block_type != block_type])


def with_block(payload: bytes, changed: Block, block_type: int, nth: int = 0) -> bytes:
    """``payload`` with the nth block of a type replaced."""
    out: list[Block] = []
    for block in split_blocks(payload):
        if block.block_type == block_type:
            out.append(changed if nth == 0 else block)
            nth -= 1
        else:
            out.append(block)
    return emit_blocks(out)


SECOND = 1_000_000_000
RECORDS = (
    ParameterRecord(0x3A00, 1, 2, 10, b"a"),
    ParameterRecord(0x3A00, 1, 2, 11, b"bcd"),
    ParameterRecord(0, 0, 0x8000, 12, bytes(100)),
)
REFUSED = PnioStatus(0xDF, 0x80, 0xB0, 0)
WRONG_MODULE = ModuleDiffBlock((DiffApi(0x3A00, (DiffModule(1, 7, ModuleState.WRONG_MODULE),)),))
SUBSTITUTE = ModuleDiffBlock(
    (
        DiffApi(
            0x3A00,
            (
                DiffModule(
                    1,
                    0x100,
                    ModuleState.PROPER_MODULE,
                    (DiffSubmodule(2, 0x68, submodule_state(IdentInfo.SUBSTITUTE)),),
                ),
            ),
        ),
    )
)


def line(device: ScriptedDevice | None = None, **changes: object) -> Line:
    return Line(CmController(make_plan(**changes)), device or ScriptedDevice())


def established(device: ScriptedDevice | None = None, **changes: object) -> Line:
    up = line(device, **changes)
    up.start()
    assert up.controller.state is CmctlState.DATA
    up.events.clear()
    return up


def failure(up: Line) -> ArFailed:
    up.start()
    (end,) = [event for event in up.events if isinstance(event, ArFailed)]
    assert up.events[-1] is end
    assert up.controller.state is CmctlState.CLOSED
    return end


def rta_codes(up: Line) -> list[int]:
    return [error_status(parse_rta(pdu)).error_code2 for _, pdu, _ in up.controller.rta_to_send()]


@st.composite
def plans(draw: st.DrawFn) -> ArPlan:
    """Any device of a few slots, whatever its lengths and cycles."""
    submodules = []
    lengths = st.integers(0, draw(st.sampled_from((40, 900))))
    clocks = st.sampled_from((None, (32, 4), (64, 1))) if draw(st.booleans()) else st.none()
    for slot in draw(st.lists(st.integers(0, 0x7FFF), min_size=1, max_size=6, unique=True)):
        ident = draw(st.integers(1, 0xFFFFFFFF))
        api = draw(st.sampled_from((0, 0x3A00, 0x4600)))
        # interface and port submodules belong to API 0
        subslots = st.integers(1, 0x7FFF if api else 0x9FFF)
        for subslot in draw(st.lists(subslots, min_size=1, max_size=4, unique=True)):
            submodule_ident, inputs, outputs = draw(st.tuples(st.integers(0, 0xFFFFFFFF), lengths, lengths))
            properties = draw(st.sampled_from((0, SubmoduleProperties.DISCARD_IOXS)))
            place = PlannedSubmodule(
                api, slot, ident, subslot, submodule_ident, inputs, outputs, properties, draw(clocks)
            )
            submodules.append(place)
    return make_plan(
        submodules=tuple(submodules),
        startup=draw(st.sampled_from(("legacy", "advanced"))),
        session_key=draw(st.integers(0, 0xFFFF)),
        input_crs=64,
        output_crs=64,
    )
