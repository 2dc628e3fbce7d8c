"""Several controllers at one device: each with its own AR, alarm channel and answers."""

from dataclasses import replace
from uuid import UUID

from alarm_kit import channel
from cm_support import (
    ALARM_BLOCK,
    DAP_BLOCK,
    DRIVE,
    DRIVE_API,
    DRIVE_BLOCK,
    LEGACY,
    OBJECT_UUID,
    PEER,
    ROOM,
    Bench,
    Plan,
)

from pnfarm.protocols.profinet.alarms.channel import AlarmAcknowledged, AlarmReceived
from pnfarm.protocols.profinet.cm.device.events import SubmodulesChanged
from pnfarm.protocols.profinet.errors import OK
from pnfarm.protocols.profinet.wire.alarms.rta import parse_rta
from pnfarm.protocols.profinet.wire.any_block import emit_blocks, parse_blocks
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand, SubmoduleList, control_response
from pnfarm.protocols.profinet.wire.cm.expected import ExpectedSubmoduleBlockReq, ModuleDiffBlock
from pnfarm.protocols.profinet.wire.cm.iocr import FrameSlot, IocrApi

TAKEOVER_ALLOWED = LEGACY | 0x08
PAP, TELEGRAM = (DRIVE_API, 1, 1), (DRIVE_API, 1, 2)
DAP = (0, 0, 1)
SHARED = replace(DRIVE, limits=replace(DRIVE.limits, max_ars=2))


def dap_only():
    """A Connect that expects the DAP's submodules and nothing of the drive."""
    inputs = (IocrApi(0, tuple(FrameSlot(0, s, i) for i, s in enumerate((1, 0x8000, 0x8001, 0x8002)))),)
    outputs = (IocrApi(0, (), tuple(FrameSlot(0, s, i) for i, s in enumerate((1, 0x8000, 0x8001, 0x8002)))),)
    return inputs, outputs, (DAP_BLOCK,)


def drive_only():
    """A Connect that expects the drive's submodules and not the DAP's."""
    inputs = (IocrApi(DRIVE_API, (FrameSlot(1, 1, 4), FrameSlot(1, 2, 5)), (FrameSlot(1, 2, 18),)),)
    outputs = (IocrApi(DRIVE_API, (FrameSlot(1, 2, 6),), (FrameSlot(1, 1, 4), FrameSlot(1, 2, 5))),)
    return inputs, outputs, (DRIVE_BLOCK,)


def everything():
    plan = Plan()
    return plan.inputs.apis, plan.outputs.apis, (DAP_BLOCK, DRIVE_BLOCK)


class Controller:
    """One controller or supervisor at the device of ``bench``."""

    def __init__(self, bench, number, wants=everything, *, ar_type=1, properties=LEGACY, acknowledges=True):
        self.bench = bench
        self.number = number
        self.mac = bytes([2, 0, 0, 0, 1, number])
        self.uuid = UUID(int=number + 0x1000)
        self.acknowledges = acknowledges
        self.wants, self.ar_type, self.properties = wants, ar_type, properties
        self.alarms = []
        self.channel = None
        self.key = None

    def payload(self):
        plan = Plan()
        inputs, outputs, expected = self.wants()
        object_uuid = UUID(bytes=OBJECT_UUID.bytes[:-1] + bytes([self.number]))
        ar = ArBlockReq(
            self.ar_type, self.uuid, self.number, self.mac, object_uuid, self.properties, 100, 0x8892,
            f"plc-{self.number}".encode(),
        )  # fmt: skip
        blocks = [
            ar,
            replace(plan.inputs, apis=inputs, frame_id=0x8000 + self.number),
            replace(plan.outputs, apis=outputs),
        ]
        blocks += [ExpectedSubmoduleBlockReq((e,)) for e in expected]
        blocks.append(replace(ALARM_BLOCK, local_alarm_reference=self.number))
        return emit_blocks(blocks)

    def connect(self):
        status, answer = self.bench.call(0, self.payload(), ROOM, PEER)
        if status.ok:
            self.key = self.bench.key()
            alarm_cr = next(b for b in parse_blocks(answer) if type(b).__name__ == "AlarmCrBlockRes")
            self.channel = channel(self.number, alarm_cr.local_alarm_reference)
        return status, answer

    def diff(self, answer):
        return next((b for b in parse_blocks(answer) if isinstance(b, ModuleDiffBlock)), None)

    def establish(self):
        status, answer = self.connect()
        assert status.ok, self.bench.events()
        assert self.control(BlockType.PRM_END_REQ, ControlCommand.PRM_END)[0].ok
        assert self.bench.cm.application_ready(self.key, self.bench.now)
        self.bench.cm.data_received(self.key, self.bench.now)
        self.confirm_calls()
        return answer

    def control(self, block_type, command, sequence=0, extra=()):
        block = ControlBlock(block_type, self.uuid, self.number, command, sequence)
        return self.bench.call(4, emit_blocks((block, *extra)))

    def prm_begin(self, *keys):
        return self.control(BlockType.PRM_BEGIN_REQ, ControlCommand.PRM_BEGIN, extra=(SubmoduleList(keys),))

    def prm_end(self):
        return self.control(BlockType.PRM_END_REQ, ControlCommand.PRM_END)

    def prm_end_plug(self, sequence):
        return self.control(BlockType.PRM_END_PLUG_REQ, ControlCommand.PRM_END, sequence)

    def release(self):
        block = ControlBlock(BlockType.RELEASE_REQ, self.uuid, self.number, ControlCommand.RELEASE)
        return self.bench.call(1, block.emit())[0]

    def confirm_calls(self):
        """Answer what the device calls; the blocks of each call."""
        seen = []
        for call in self.bench.cm.calls():
            blocks = parse_blocks(call.payload)
            seen.append(blocks)
            answer = control_response(blocks[0]).emit()
            self.bench.cm.call_returned(call.token, OK, answer, self.bench.now)
        return seen

    def pump(self, *others):
        """Carry alarm frames both ways until nothing moves; what this controller heard, as type names."""
        line = {c.mac: c for c in (self, *others)}
        for _ in range(64):
            frames = self.bench.cm.rta_to_send()
            for frame in frames:
                controller = line.get(frame.destination)
                if controller is not None and controller.channel is not None:
                    controller.channel.receive(parse_rta(frame.payload), self.bench.now)
            moved = bool(frames)
            for controller in line.values():
                moved = controller._answer() or moved
            if not moved:
                return self.heard()
        raise AssertionError("the alarms do not come to rest")

    def _answer(self):
        if self.channel is None:
            return False
        for event in self.channel.events():
            if isinstance(event, AlarmReceived):
                self.alarms.append(event.alarm)
                if self.acknowledges:
                    self.channel.acknowledge(event.alarm, self.bench.now)
            assert not isinstance(event, AlarmAcknowledged)
        frames = self.channel.to_send(self.bench.now)
        for _tag, payload in frames:
            self.bench.cm.receive_rta(payload, self.mac, self.bench.now)
        return bool(frames)

    def heard(self):
        heard, self.alarms = self.alarms, []
        return heard


def shared_bench():
    return Bench(SHARED)


def one_controller(**fields):
    bench = Bench()
    controller = Controller(bench, 1, **fields)
    controller.establish()
    bench.events()
    return bench, controller


def unusable(bench, key=None):
    """The last word on what an AR cannot use."""
    found = [e for e in bench.events() if isinstance(e, SubmodulesChanged) and key in {None, e.ar_key}]
    return found[-1].unusable if found else None


def places(alarms):
    return [(a.alarm_type, a.api, a.slot, a.subslot) for a in alarms]
