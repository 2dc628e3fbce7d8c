"""How fast and how far an axis in position mode may go: limits of velocity, of software and of switches."""

from __future__ import annotations

from typing import Any

from pnfarm.table.axis_codes import SWITCHED_NOT, SWITCHED_ON
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = [
    "at_limit_switch",
    "fastest",
    "limits_reached",
    "position_number",
    "software_limits",
    "take_ramps",
    "within_limits",
]


@inlined
def software_limits(travel: Any) -> int:
    """The software limits that count, coded as ``travel.software_limits``."""
    if travel.switched == SWITCHED_NOT:
        return int(travel.settings.software_limits)
    return 0x3 if travel.switched == SWITCHED_ON else 0


@inlined
def position_number(travel: Any, homing: Any, place: float) -> int:
    """A shaft position in position steps; XIST_A is its lower 32 bits."""
    return round((place - homing.origin) / travel.settings.position_step)


@inlined
def within_limits(travel: Any, homing: Any, target: float) -> bool:
    """Whether software limits let the shaft go to ``target``; they apply once the machine's zero is known."""
    if not homing.homed:
        return True
    place = target - homing.origin
    limits = software_limits(travel)
    if limits & 0x1 and place < travel.settings.low:
        return False
    return not (limits & 0x2 and place > travel.settings.high)


@inlined
def at_limit_switch(machine: Any, direction: float) -> bool:
    """Whether the limit switch in this direction (any number above or below 0) is pressed."""
    return (direction > 0.0 and machine.limit_switch & 0x2 != 0) or (
        direction < 0.0 and machine.limit_switch & 0x1 != 0
    )


@inlined
def fastest(motor: Any, travel: Any, velocity: float, forwards: bool) -> float:
    """A velocity, 0 or more, within the limits of motor and parameters in one direction, rpm."""
    limit = min(
        motor.settings.max_velocity,
        travel.settings.velocity_limit_positive if forwards else travel.settings.velocity_limit_negative,
    )
    if travel.settings.velocity_limit > 0.0 and travel.settings.velocity_limit < limit:
        limit = travel.settings.velocity_limit
    return min(velocity, limit)


@inlined
def take_ramps(profile: Any, velocity: float, up: float, down: float) -> None:
    """Set velocity, rpm, and ramps, rpm/s, of the next profile."""
    profile.top = velocity
    profile.acceleration = up
    profile.deceleration = down


@compiled
def limits_reached(axis: Any) -> int:
    """SWLS.STATE: software limits that the axis has reached, bit 0 the low one, bit 1 the high one."""
    word = 0
    if axis.homing.homed:
        place = axis.motor.position + axis.measurement.position_deviation - axis.homing.origin
        limits = software_limits(axis.travel)
        window = axis.positioning.settings.target_window
        if limits & 0x1 and place <= axis.travel.settings.low + window:
            word |= 0x1
        if limits & 0x2 and place >= axis.travel.settings.high - window:
            word |= 0x2
    return word
