"""Status of position mode: bits of ZSW1, DRV.MOTIONSTAT, the words of telegram 111, limits."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.interlocks import torque_free
from pnfarm.firmware.measurement import measured_position, measured_velocity
from pnfarm.firmware.positioning import BRAKING, HOMING, INTERMEDIATE_STOP, JOG, OUT, STANDBY, TASK
from pnfarm.firmware.travel import limits_reached
from pnfarm.table.axis_codes import LACKS_ENABLE, LACKS_RELEASE, MDI_SELECTED, TASKS_TABLE
from pnfarm.table.axis_readings import REACHED_NO_MOTION, REACHED_TASK_ACTIVE
from pnfarm.table.compiled import compiled

__all__ = [
    "actual_task",
    "drive_inputs",
    "first_position_word",
    "motion_status",
    "position_bits",
    "second_position_word",
]


@compiled
def _has_task(positioning: Any) -> bool:
    """Whether a task runs, or waits in an intermediate stop."""
    return positioning.state in (TASK, INTERMEDIATE_STOP)


@compiled
def _standing(axis: Any) -> bool:
    """Whether the axis is reported at rest: no profile moves it, and the shaft does not turn.

    Homing counts as motion until it ends, also while the axis reverses at the mark (AKD PROFINET manual 5.10.3).
    """
    if axis.positioning.state in (BRAKING, HOMING):
        return False
    if axis.positioning.state != OUT and axis.profile.velocity != 0.0:
        return False
    return abs(measured_velocity(axis.motor, axis.measurement)) <= axis.ramp.settings.standstill


@compiled
def _basic(positioning: Any) -> bool:
    """Whether no motion is active: the basic state of AKD PROFINET manual, edition B, 5.10.1."""
    return positioning.state in (OUT, STANDBY)


@compiled
def _at_target(motor: Any, positioning: Any, profile: Any, measurement: Any) -> bool:
    """Whether the last task ended in its target, and the shaft is there.

    It is not if the shaft was turned away, by hand or by its load (HIWIN E1 manual, table 3.5.2.1).
    """
    return (
        positioning.target_reached
        and abs(profile.target - measured_position(motor, measurement)) <= positioning.settings.target_window
    )


@compiled
def _reached(axis: Any) -> bool:
    """ZSW1.10: the axis is at its target, or no motion is active, or a task is (AKD, edition B, 5.5)."""
    if axis.profidrive.settings.reached_without_task == REACHED_NO_MOTION:
        return _basic(axis.positioning)
    return (
        _has_task(axis.positioning)
        if axis.profidrive.settings.reached_without_task == REACHED_TASK_ACTIVE
        else _at_target(axis.motor, axis.positioning, axis.profile, axis.measurement)
    )


@compiled
def _rests(axis: Any) -> bool:
    """ZSW1.13, where it means that the axis stands."""
    return _standing(axis) and (not axis.positioning.settings.rest_without_task or _basic(axis.positioning))


@compiled
def position_bits(axis: Any) -> int:
    """Bits 8 and 10 to 14 of ZSW1 in position mode (AKD PROFINET manual 5.5; HIWIN E1 manual 3.5.2)."""
    word = 0
    near = (
        abs(axis.positioning.following_error - axis.measurement.position_deviation)
        <= axis.positioning.settings.following_window
    )
    if near != (axis.profidrive.settings.following_error_bit != 0):
        word |= 0x0100
    if _reached(axis):
        word |= 0x0400
    if axis.homing.homed:
        word |= 0x0800
    if axis.positioning.acknowledged:
        word |= 0x1000
    if not _standing(axis) if axis.profidrive.settings.moving_bit else _rests(axis):
        word |= 0x2000
    if _has_task(axis.positioning):
        word |= axis.profidrive.settings.task_active
    return word


@compiled
def motion_status(axis: Any) -> int:
    """DRV.MOTIONSTAT (AKD PROFINET manual 5.5 for bits 0, 1, 2 and 11; the others: AKD parameter reference)."""
    word = 0
    if _has_task(axis.positioning):
        word |= 0x0001
    if axis.homing.homed:
        word |= 0x0006
    if axis.positioning.state == HOMING:
        word |= 0x0008
    if axis.homing.error:
        word |= 0x0010
    if axis.drive.state == 5 and axis.drive.stop >= 2:
        word |= 0x0080
    if axis.service.leg:
        word |= 0x0200
    if axis.positioning.error:
        word |= 0x0400
    if _at_target(axis.motor, axis.positioning, axis.profile, axis.measurement):
        word |= 0x0800
    if (
        axis.positioning.state == TASK
        and abs(abs(measured_velocity(axis.motor, axis.measurement)) - abs(axis.profile.top))
        <= axis.positioning.settings.target_velocity_window
    ):
        word |= 0x1000
    return word


@compiled
def first_position_word(machine: Any, asked: Any, positioning: Any) -> int:
    """POS_ZSW1 (HIWIN E1 manual 3.14)."""
    word = (int(machine.limit_switch) & 0x3) << 8
    if positioning.state == JOG:
        word |= 0x0400
    if positioning.state == HOMING:
        word |= 0x0800
    if asked.mdi:
        word |= 0x8000
    return word


@compiled
def second_position_word(axis: Any) -> int:
    """POS_ZSW2 (HIWIN E1 manual 3.15)."""
    word = 0
    if _has_task(axis.positioning):
        word |= 0x8004
    if not _standing(axis):
        # for a shaft that does not turn, the direction is that of its profile
        velocity = measured_velocity(axis.motor, axis.measurement)
        speed = velocity if abs(velocity) > axis.ramp.settings.standstill else axis.profile.velocity
        if speed != 0.0:
            word |= 0x0010 if speed > 0.0 else 0x0020
    return word


@compiled
def actual_task(profidrive: Any, asked: Any, positioning: Any) -> int:
    """AKTSATZ: the number of the running motion task; 0 for none.  Bit 15 alone: the MDI submode.

    A selection in SATZANW for the next task does not change the number of the running one (AKD PROFINET manual 5.10.1).
    With driving sets, the last one that was started (Moog MSD manual, table 8.6: the actual set).
    """
    if profidrive.settings.task_form == TASKS_TABLE:
        return max(0, int(positioning.task))
    if _has_task(positioning) and positioning.task >= 0:
        return int(positioning.task)
    return MDI_SELECTED if asked.mdi else 0


@compiled
def drive_inputs(axis: Any) -> int:
    """DRIVE_INPUTS (AKD PROFINET manual 5.8.1).

    Bits 0 to 3 are limits by software and by switch, bits 4 and 5 those of DRV.DISSOURCES for the hardware disable and
    an input that asks for a controlled stop.  Bit 6 is STO.STATE, 1 while torque is allowed (AKD parameter reference).
    """
    word = limits_reached(axis) | (int(axis.machine.limit_switch) & 0x3) << 2
    lacks = int(axis.drive.lacks)
    if lacks & LACKS_ENABLE:
        word |= 0x10
    if lacks & LACKS_RELEASE:
        word |= 0x20
    if axis.faults.settings.sto_fault != 0 and not torque_free(axis.faults):
        word |= 0x40
    return word
