"""The built-in controller's axis program over command assemblies, against the drive's own front, without a wire."""

from __future__ import annotations

import pytest
from assembly_bench import ENABLE, LOAD, MS, POSITION, REVOLUTION, VELOCITY, AssemblyBench
from from_python import called

from pnfarm.buses.ethernetip.device.objects.front_tasks import FrontTasks
from pnfarm.buses.ethernetip.device.objects.parameter_object import ParameterObject
from pnfarm.buses.ethernetip.device.objects.position_controller import PositionController
from pnfarm.buses.ethernetip.device.objects.values import CipValues
from pnfarm.firmware.ethernetip.tasks import tells
from pnfarm.firmware.front import step_program
from pnfarm.table import program as codes
from pnfarm.table.axis_codes import FIRMWARE_ETHERNETIP
from pnfarm.table.image import IMAGE, LOST_EXPIRED
from pnfarm.table.program import PROGRAM
from pnfarm.table.signals import ASSEMBLY, ASSEMBLY_WORDS

#: Packet interval, ms.
RPI = 10


class Axis(AssemblyBench):
    """Every packet interval the program's assembly goes to the drive, and the drive's back."""

    def __init__(self, kind: int, *, homed: bool = True, **fields) -> None:
        super().__init__(POSITION, homed=homed)
        values = CipValues(self.store)
        controller = PositionController(self.store, values)
        parameters = ParameterObject(self.store, values, controller.enable)
        self.tasks = FrontTasks(self.store, values, parameters, controller)
        self.programs, self.own = PROGRAM.allocate(1), IMAGE.allocate(1)
        self.program, self.here = self.programs[0], self.own[0]
        wanted = {
            "active": 1, "front": FIRMWARE_ETHERNETIP, "kind": kind, "enable": 1, "speed": 60.0,
            "velocity_step": 60.0 / REVOLUTION, "ramp_step": 60.0 / REVOLUTION, "target_step": 1.0 / REVOLUTION,
            "speed_up": 10_000.0, "speed_down": 10_000.0, "acceleration": 10_000.0, "period_ns": 2_000 * MS,
            "acknowledge_after_ns": -1, "clear_number": self.store.model.resolve("DRV.CLRFAULTS")[0].pnu,
        }  # fmt: skip
        for name, value in (wanted | fields).items():
            setattr(self.program, name, value)
        self.connected = True
        #: First octet of each assembly that was sent, with the type of its command.
        self.words: list[tuple[int, int]] = []

    def exchange(self, milliseconds: int) -> None:
        for _ in range(milliseconds // RPI):
            self.here.valid = int(self.connected)
            if self.connected:
                self.here.received[ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS] = self.image.sent[
                    ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS
                ]
            called(step_program)(self.program, self.here, self.now)
            assembly = self.here.sent[ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS].astype("<i4").tobytes()
            if not self.words or self.words[-1] != (assembly[0], assembly[2] & 0x1F):
                self.words.append((assembly[0], assembly[2] & 0x1F))
            if self.connected:
                self.send(assembly, 0)
            for _ in range(RPI):
                self.run(1)
                if called(tells)(self.axis.ethernetip, self.image, self.now):
                    self.tasks.take(int(self.image.parameter_task), self.now)

    @property
    def speed(self) -> float:
        return float(self.axis.motor.velocity)

    @property
    def phase(self) -> int:
        return int(self.program.phase)


def test_the_mode_is_set_then_enable_rises_then_the_speed_is_loaded():
    axis = Axis(codes.CONSTANT)
    axis.exchange(1000)
    assert axis.phase == codes.RUNNING
    assert axis.store.get("DRV.OPMODE") == VELOCITY
    assert axis.speed == pytest.approx(60.0, abs=1.0)
    assert axis.words == [
        (0x00, 0x1B), (LOAD, 0x1B), (0x00, 0x1B), (ENABLE, 0x00),
        (ENABLE | 0x08, 0x07), (ENABLE | 0x08 | LOAD, 0x07), (ENABLE | 0x08, 0x07),
    ]  # fmt: skip
    assert axis.program.zsw1 & 0xFF & ENABLE
    assert axis.program.stw1 == ENABLE | 0x08 | 0x07 << 8
    assert 0 < axis.program.reaction_ns < 100 * MS


def test_a_speed_backwards_has_no_direction_bit():
    axis = Axis(codes.CONSTANT, speed=-30.0)
    axis.exchange(1000)
    assert axis.speed == pytest.approx(-30.0, abs=1.0)


@pytest.mark.parametrize("kind", [codes.RAMP, codes.SINE])
def test_a_changing_speed_follows_jog_by_jog_both_ways(kind):
    axis = Axis(kind, speed=300.0)
    axis.exchange(1000)
    seen = []
    for _ in range(20):
        axis.exchange(100)
        seen.append(axis.speed)
    assert max(seen) == pytest.approx(300.0, abs=60.0)
    assert min(seen) == pytest.approx(-300.0, abs=60.0)
    assert axis.program.refused == 0


def test_targets_are_reached_in_turn_after_homing():
    axis = Axis(
        codes.POSITIONS, homed=False, speed=600.0, targets=(0.0, 2.0) + (0.0,) * 6, target_count=2, dwell_ns=50 * MS
    )
    axis.exchange(3000)
    assert axis.store.get("DRV.OPMODE") == POSITION
    assert axis.axis.homing.homed
    assert axis.program.moves >= 4, (axis.phase, axis.program.leg, axis.program.refused, hex(axis.program.error))
    assert axis.program.refused == 0
    for _ in range(300):
        axis.exchange(RPI)
        if axis.program.leg == codes.LEG_DWELLING and axis.program.target_index == 1:
            break
    assert axis.axis.profile.position - axis.axis.homing.origin == pytest.approx(2.0, abs=0.01)


def fault(axis: Axis) -> None:
    """The drive misses its controller's data, and finds them again."""
    axis.lose(LOST_EXPIRED, 5)
    axis.exchange(20)


def test_a_fault_withdraws_enable_and_is_cleared_after_the_user_s_time():
    axis = Axis(codes.CONSTANT, acknowledge_after_ns=200 * MS)
    axis.exchange(1000)
    fault(axis)
    axis.exchange(100)
    assert axis.phase == codes.FAULTED
    assert axis.axis.faults.code[0] != 0
    assert not axis.program.stw1 & ENABLE
    axis.exchange(1500)
    assert axis.axis.faults.code[0] == 0
    assert axis.phase == codes.RUNNING
    assert axis.speed == pytest.approx(60.0, abs=1.0)
    assert axis.program.faults == 1
    assert axis.program.recovery_ns >= 200 * MS
    assert (LOAD, 0x1F) in axis.words


def test_a_fault_stays_where_the_user_wants_no_acknowledgement():
    axis = Axis(codes.CONSTANT)
    axis.exchange(1000)
    fault(axis)
    axis.exchange(3000)
    assert axis.phase == codes.FAULTED
    assert axis.axis.faults.code[0] != 0


def test_an_axis_that_is_not_to_be_enabled_is_stopped():
    axis = Axis(codes.IDLE, enable=0)
    axis.exchange(500)
    assert axis.phase == codes.STOPPED
    assert axis.words == [(0, 0)]
    axis.connected = False
    axis.exchange(20)
    assert axis.phase == codes.OFFLINE


def test_a_command_that_the_drive_refuses_is_told_and_loaded_again_later():
    axis = Axis(codes.POSITIONS, speed=600.0, targets=(2.0,) * 8, target_count=1, dwell_ns=0)
    axis.store.set("SWLS.EN", 2)
    axis.store.set("SWLS.LIMIT1", REVOLUTION << 16)
    axis.exchange(2000)
    assert axis.program.refused in {2, 3, 4}
    assert axis.program.error == 0xFF09
    assert axis.program.moves == 0
    axis.store.set("SWLS.EN", 0)
    axis.exchange(1500)
    assert axis.program.moves >= 1


def test_a_drive_that_loses_enable_gets_its_rising_edge_again():
    axis = Axis(codes.CONSTANT)
    axis.exchange(1000)
    axis.store.set("DRV.DIS", 1)
    axis.exchange(500)
    assert axis.phase == codes.SWITCHING_ON
    axis.exchange(6000)
    assert axis.phase == codes.RUNNING
    assert axis.speed == pytest.approx(60.0, abs=1.0)
