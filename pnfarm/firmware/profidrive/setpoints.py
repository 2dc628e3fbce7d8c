"""Set points other than speed and tasks: torque limits, jogging speeds, cyclic positions."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.motion.interpolation import interpolates, take_position
from pnfarm.firmware.motion.jog import by_sequence
from pnfarm.firmware.profidrive.telegram import signed16, torque_step
from pnfarm.table.axis_readings import SETPOINTS_NONE, SETPOINTS_TAKEN
from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.signals import JOG_SPEED_1, KPC, M_ADD1, M_LIMIT_POS, MOMRED, TORQUE_LIMIT_POSITIVE, XERR, XSOLL_A

__all__ = ["take_cyclic", "take_jog_speeds", "take_torque_limits"]

#: One increment of a torque limit (Moog MSD manual 14.3), and of KPC.
THOUSANDTH = 0.001
#: MOMRED of this takes all torque away.
WHOLE = 16384.0
#: Of ``torque_signals``.
REDUCED, LIMITED, ADDED = 0x04, 0x08, 0x10


@inlined
def _limit_share(axis: Any, word: int) -> float:
    """A torque limit in the unit of torque signals, its sign aside, as a share of the peak torque."""
    peak = axis.motor.settings.torque_constant * axis.motor.settings.peak_current
    return abs(signed16(word)) * torque_step(axis.profidrive, axis.motor) / peak


@inlined
def take_torque_limits(axis: Any, image: Any) -> None:
    """Once in each step: torque limits and additional torque, by parameters or by a telegram with valid set points."""
    signals = int(axis.profidrive.settings.torque_signals)
    if axis.profidrive.setpoints == SETPOINTS_NONE or not signals:
        axis.torque.added = 0.0
        for direction in range(2):
            axis.torque.shares_in_force[direction] = axis.torque.settings.shares[direction]
        return
    if axis.profidrive.setpoints != SETPOINTS_TAKEN:
        return
    left = 1.0
    if signals & REDUCED:
        left = max(0.0, 1.0 - (image.received[MOMRED] & 0xFFFF) / WHOLE)
    for direction in range(2):
        share = float(axis.torque.settings.shares[direction])
        if signals & (1 << direction):
            share = (image.received[TORQUE_LIMIT_POSITIVE + direction] & 0xFFFF) * THOUSANDTH
        elif signals & LIMITED:
            share = min(share, _limit_share(axis, int(image.received[M_LIMIT_POS + direction])))
        axis.torque.shares_in_force[direction] = share * left
    axis.torque.added = (
        signed16(int(image.received[M_ADD1])) * torque_step(axis.profidrive, axis.motor) if signals & ADDED else 0.0
    )


@inlined
def take_jog_speeds(profidrive: Any, jog: Any, image: Any) -> None:
    """The two jogging speeds, from parameters or from a telegram with valid set points (Moog MSD manual 10.3.3)."""
    if not by_sequence(jog):
        return
    for which in range(2):
        if profidrive.setpoints == SETPOINTS_NONE or not profidrive.settings.jog_signals & (1 << which):
            jog.speeds[which] = jog.settings.velocity[which]
        elif profidrive.setpoints == SETPOINTS_TAKEN:
            jog.speeds[which] = image.received[JOG_SPEED_1 + which] * profidrive.settings.velocity_step


@inlined
def take_cyclic(axis: Any, image: Any, now: int) -> None:
    """Once in each step: positions to follow, and the deviation that dynamic servo control counts from (XERR)."""
    if image.filled != axis.interpolation.frames_told:
        axis.interpolation.frames_told = image.filled
        axis.interpolation.servo_shown = axis.sensor.position + axis.measurement.position_deviation
    if (
        axis.profidrive.setpoints == SETPOINTS_NONE
        or axis.profidrive.settings.reference_source != axis.profidrive.settings.bus_source
    ):
        axis.interpolation.servo_gain = 0.0
        axis.interpolation.frames_ns = 0
        return
    if image.frames == axis.interpolation.frames_taken or axis.profidrive.setpoints != SETPOINTS_TAKEN:
        return
    axis.interpolation.frames_taken = image.frames
    if axis.interpolation.settings.servo_control:
        deviation = image.received[XERR] * axis.sensor.settings.step
        axis.interpolation.servo_target = axis.interpolation.servo_shown + deviation
        axis.interpolation.servo_gain = max(0.0, image.received[KPC] * THOUSANDTH)
    elif interpolates(axis.drive, axis.ramp, axis.interpolation):
        take_position(axis, int(image.received[XSOLL_A]), now)
