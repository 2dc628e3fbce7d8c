"""What a drive reports whatever its front: DRV.MOTIONSTAT, limits and inputs, and what these are made of."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.interlocks import torque_free
from pnfarm.firmware.motion.positioning import BRAKING, HOMING, INTERMEDIATE_STOP, OUT, TASK
from pnfarm.firmware.motion.travel import limits_reached
from pnfarm.firmware.motor.measurement import measured_position, measured_velocity
from pnfarm.table.axis_codes import LACKS_ENABLE, LACKS_RELEASE
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["at_target", "drive_inputs", "has_task", "motion_status", "standing"]


@inlined
def has_task(positioning: Any) -> bool:
    """Whether a task runs, or waits in an intermediate stop."""
    return positioning.state in (TASK, INTERMEDIATE_STOP)


@inlined
def standing(axis: Any) -> bool:
    """Whether the axis is reported at rest: no profile moves it, and the shaft does not turn.

    Homing counts as motion until it ends, also while the axis reverses at the mark (AKD PROFINET manual 5.10.3).
    """
    if axis.positioning.state in (BRAKING, HOMING):
        return False
    if axis.positioning.state != OUT and axis.profile.velocity != 0.0:
        return False
    return abs(measured_velocity(axis.motor, axis.measurement)) <= axis.ramp.settings.standstill


@inlined
def at_target(motor: Any, positioning: Any, profile: Any, measurement: Any) -> bool:
    """Whether the last task ended in its target, and the shaft is there.

    It is not if the shaft was turned away, by hand or by its load (HIWIN E1 manual, table 3.5.2.1).
    """
    return (
        positioning.target_reached
        and abs(profile.target - measured_position(motor, measurement)) <= positioning.settings.target_window
    )


@compiled
def motion_status(axis: Any) -> int:
    """DRV.MOTIONSTAT (AKD PROFINET manual 5.5 for bits 0, 1, 2 and 11; the others: AKD parameter reference)."""
    word = 0
    if has_task(axis.positioning):
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
    if at_target(axis.motor, axis.positioning, axis.profile, axis.measurement):
        word |= 0x0800
    if (
        axis.positioning.state == TASK
        and abs(abs(measured_velocity(axis.motor, axis.measurement)) - abs(axis.profile.top))
        <= axis.positioning.settings.target_velocity_window
    ):
        word |= 0x1000
    return word


@inlined
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
