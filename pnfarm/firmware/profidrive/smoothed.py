"""Smoothed actual values of telegrams for process control, and the torque: 0x4000 is the reference of each."""

from __future__ import annotations

from math import pi
from typing import Any

from pnfarm.firmware.motor.measurement import measured_current, measured_torque, measured_velocity
from pnfarm.firmware.motor.torque_limits import most_torque
from pnfarm.firmware.profidrive.messages import namur_word
from pnfarm.firmware.profidrive.telegram import clamp16, current_step, torque_step
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.signals import AIST_GLATT, IAIST_GLATT, M_ACT, MELD_NAMUR, MIST_GLATT, NIST_A_GLATT, PIST_GLATT

__all__ = ["forget_smoothed", "show_smoothed"]

#: 100 % of a signal.
WHOLE = 16384.0
#: rad/s of one rpm.
RPM = pi / 30.0


@inlined
def forget_smoothed(profidrive: Any, now: int) -> None:
    """The drive was switched on: its filters begin at 0."""
    profidrive.smoothed_ns = now
    profidrive.smoothed_speed = 0.0
    profidrive.smoothed_current = 0.0
    profidrive.smoothed_torque = 0.0
    profidrive.smoothed_power = 0.0


@compiled
def show_smoothed(axis: Any, image: Any) -> None:
    """Once in each step, if the telegram has any of them."""
    profidrive = axis.profidrive
    seconds = (axis.last_ns - profidrive.smoothed_ns) * 1e-9
    profidrive.smoothed_ns = axis.last_ns
    part = seconds / (seconds + profidrive.settings.smoothing) if seconds > 0.0 else 0.0
    velocity = measured_velocity(axis.motor, axis.measurement)
    torque = measured_torque(axis.motor, axis.measurement)
    current = abs(measured_current(axis.motor, axis.measurement))
    profidrive.smoothed_speed += part * (velocity - profidrive.smoothed_speed)
    profidrive.smoothed_current += part * (current - profidrive.smoothed_current)
    profidrive.smoothed_torque += part * (torque - profidrive.smoothed_torque)
    profidrive.smoothed_power += part * (torque * velocity * RPM - profidrive.smoothed_power)
    step = torque_step(profidrive, axis.motor)
    # the reference power is that of reference speed and torque
    power = step * profidrive.settings.velocity_step * RPM * WHOLE
    image.sent[NIST_A_GLATT] = clamp16(profidrive.smoothed_speed / profidrive.settings.velocity_step)
    image.sent[IAIST_GLATT] = clamp16(profidrive.smoothed_current / current_step(profidrive, axis.motor))
    image.sent[MIST_GLATT] = clamp16(profidrive.smoothed_torque / step)
    image.sent[PIST_GLATT] = clamp16(profidrive.smoothed_power / power)
    most = most_torque(axis.motor, axis.torque, axis.homing, 1 if profidrive.smoothed_torque < 0.0 else 0)
    image.sent[AIST_GLATT] = clamp16(abs(profidrive.smoothed_torque) / most * WHOLE) if most > 0.0 else 0
    image.sent[M_ACT] = clamp16(torque / step)
    image.sent[MELD_NAMUR] = namur_word(axis)
