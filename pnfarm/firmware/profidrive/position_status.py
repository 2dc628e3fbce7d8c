"""Status of position mode: bits of ZSW1, the words of telegram 111."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.motion.positioning import HOMING, JOG, OUT, STANDBY
from pnfarm.firmware.motion.travel import limits_reached
from pnfarm.firmware.motor.measurement import measured_velocity
from pnfarm.firmware.reported import at_target, has_task, standing
from pnfarm.table.axis_codes import MDI_SELECTED, TASKS_TABLE
from pnfarm.table.axis_readings import REACHED_NO_MOTION, REACHED_TASK_ACTIVE
from pnfarm.table.compiling.compiled import inlined

__all__ = [
    "actual_task",
    "first_position_word",
    "position_bits",
    "second_position_word",
]


@inlined
def _basic(positioning: Any) -> bool:
    """Whether no motion is active: the basic state of AKD PROFINET manual, edition B, 5.10.1."""
    return positioning.state in (OUT, STANDBY)


@inlined
def _reached(axis: Any) -> bool:
    """ZSW1.10: the axis is at its target, or no motion is active, or a task is (AKD, edition B, 5.5)."""
    if axis.profidrive.settings.reached_without_task == REACHED_NO_MOTION:
        return _basic(axis.positioning)
    return (
        has_task(axis.positioning)
        if axis.profidrive.settings.reached_without_task == REACHED_TASK_ACTIVE
        else at_target(axis.motor, axis.positioning, axis.profile, axis.measurement)
    )


@inlined
def _rests(axis: Any) -> bool:
    """ZSW1.13, where it means that the axis stands."""
    return standing(axis) and (not axis.positioning.settings.rest_without_task or _basic(axis.positioning))


@inlined
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
    if not standing(axis) if axis.profidrive.settings.moving_bit else _rests(axis):
        word |= 0x2000
    if has_task(axis.positioning):
        word |= axis.profidrive.settings.task_active
    return word


@inlined
def first_position_word(axis: Any) -> int:
    """POS_ZSW1 (HIWIN E1 manual 3.14); a block's number while it runs or waits (Festo CMMT help, POS_ZSW1)."""
    positioning = axis.positioning
    word = (int(axis.machine.limit_switch) & 0x3) << 8
    if positioning.state == JOG:
        word |= 0x0400
    if positioning.state == HOMING:
        word |= 0x0800
    if axis.homing.flying:
        word |= 0x1000
    if has_task(positioning) and positioning.task >= 0:
        word |= 0x2000 | (int(positioning.task) & 0x3F)
    if axis.asked.mdi:
        word |= 0xC000 if axis.asked.endless else 0x8000
    return word & int(axis.profidrive.settings.position_bits[2])


@inlined
def second_position_word(axis: Any) -> int:
    """POS_ZSW2 (HIWIN E1 manual 3.15; bits 6 and 7: the software limits that the axis has reached)."""
    word = limits_reached(axis) << 6
    if has_task(axis.positioning):
        word |= 0x8004
    if not standing(axis):
        # for a shaft that does not turn, the direction is that of its profile
        velocity = measured_velocity(axis.motor, axis.measurement)
        speed = velocity if abs(velocity) > axis.ramp.settings.standstill else axis.profile.velocity
        if speed != 0.0:
            word |= 0x0010 if speed > 0.0 else 0x0020
    return word & int(axis.profidrive.settings.position_bits[3])


@inlined
def actual_task(profidrive: Any, asked: Any, positioning: Any) -> int:
    """AKTSATZ: the number of the running motion task; 0 for none.  Bit 15 alone: the MDI submode.

    A selection in SATZANW for the next task does not change the number of the running one (AKD PROFINET manual 5.10.1).
    With driving sets, the last one that was started (Moog MSD manual, table 8.6: the actual set).
    """
    if profidrive.settings.task_form == TASKS_TABLE:
        return max(0, int(positioning.task))
    if has_task(positioning) and positioning.task >= 0:
        return int(positioning.task)
    return MDI_SELECTED if asked.mdi else 0
