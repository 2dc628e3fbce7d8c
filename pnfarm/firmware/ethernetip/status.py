"""Output: the response assembly (AKD EtherNet/IP manual 6.2.3)."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.ethernetip.attributes import attribute_value, readable
from pnfarm.firmware.ethernetip.maps import DYNAMIC_MAP, MAP_TYPE, show_map
from pnfarm.firmware.ethernetip.message_types import (
    ACTUAL_TORQUE,
    ERROR_TYPE,
    NO_ATTRIBUTE,
    NO_RESPONSE_TYPE,
    RESPONSE_NUMBERS,
)
from pnfarm.firmware.ethernetip.octets import put, received_octet
from pnfarm.firmware.motion.positioning import BRAKING, HOMING, TASK
from pnfarm.firmware.motion.travel import limits_reached, position_number
from pnfarm.firmware.motor.measurement import measured_current, measured_position, measured_velocity
from pnfarm.firmware.reported import at_target, drive_inputs, has_task, motion_status
from pnfarm.firmware.whole_numbers import clamp32, signed32
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.signals import ASSEMBLY, ASSEMBLY_WORDS, DRIVE_INPUTS

__all__ = ["show_response"]

# Status word 1.
IN_MOTION = 0x01
BLOCK_IN_EXECUTION = 0x02
IN_POSITION = 0x04
GENERAL_FAULT = 0x08
DIRECTION = 0x10
HOMED = 0x20
ENABLED = 0x80
# Status word 2.
POSITIVE_SWITCH = 0x02
NEGATIVE_SWITCH = 0x04
POSITIVE_LIMIT = 0x08
NEGATIVE_LIMIT = 0x10
LOAD_COMPLETE = 0x80

ATTRIBUTE_TO_GET = 32
TORQUE_MODE = 0
VELOCITY_MODE = 1
POSITION_MODE = 2


@inlined
def _moving(axis: Any) -> bool:
    """In Motion: from the first step of a motion to the end of its profile."""
    if axis.drive.state == 5:
        return True
    if axis.drive.state != 4:
        return False
    mode = int(axis.drive.settings.opmode)
    if mode == POSITION_MODE:
        if axis.positioning.state == TASK and axis.positioning.endless:
            return axis.positioning.top != 0.0 or axis.profile.velocity != 0.0
        return axis.positioning.state in (TASK, BRAKING, HOMING) or axis.profile.velocity != 0.0
    if mode == VELOCITY_MODE:
        return axis.ethernetip.speed_command != 0.0 or axis.ramp.command != 0.0
    return axis.torque.setpoint != 0.0 or (axis.orders.halt != 0 and axis.ramp.command != 0.0)


@inlined
def _in_position(axis: Any) -> bool:
    """In Position: on the last targeted position; in other modes, not moving (6.3.2, 6.5.2)."""
    if axis.ethernetip.moving:
        return False
    if axis.drive.settings.opmode != POSITION_MODE:
        return True
    if axis.drive.state != 4:
        return at_target(axis.motor, axis.positioning, axis.profile, axis.measurement)
    place = measured_position(axis.motor, axis.measurement)
    return abs(axis.profile.position - place) <= axis.positioning.settings.target_window


@inlined
def _first_status(axis: Any) -> int:
    word = ENABLED if axis.drive.state >= 4 else 0
    if axis.homing.homed:
        word |= HOMED
    if measured_velocity(axis.motor, axis.measurement) > axis.ramp.settings.standstill:
        word |= DIRECTION
    if axis.faults.code[0] != 0:
        word |= GENERAL_FAULT
    if _in_position(axis):
        word |= IN_POSITION
    if has_task(axis.positioning) and axis.positioning.task >= 0:
        word |= BLOCK_IN_EXECUTION
    if axis.ethernetip.moving:
        word |= IN_MOTION
    return word


@inlined
def _second_status(axis: Any) -> int:
    limits = limits_reached(axis)
    switch = int(axis.machine.limit_switch)
    word = LOAD_COMPLETE if axis.ethernetip.loaded else 0
    if limits & 0x1:
        word |= NEGATIVE_LIMIT
    if limits & 0x2:
        word |= POSITIVE_LIMIT
    if switch & 0x1:
        word |= NEGATIVE_SWITCH
    if switch & 0x2:
        word |= POSITIVE_SWITCH
    return word


@compiled
def _error(image: Any, own: Any, attribute: int, kind: int) -> int:
    """The error that the response carries, 0 for none; that of the loaded command first."""
    if own.error != 0:
        return int(own.error)
    if not image.valid:
        return 0
    if kind not in RESPONSE_NUMBERS:
        return NO_RESPONSE_TYPE
    return NO_ATTRIBUTE if attribute != 0 and not readable(attribute) else 0


@inlined
def show_response(axis: Any, image: Any) -> None:
    """All 64 octets, once in each step."""
    own = axis.ethernetip
    for word in range(ASSEMBLY_WORDS):
        image.sent[ASSEMBLY + word] = 0
    inputs = drive_inputs(axis)
    axis.profidrive.motion_status = motion_status(axis)
    image.sent[DRIVE_INPUTS] = inputs
    own.moving = 1 if _moving(axis) else 0
    third = received_octet(image, 3) if image.valid else 0
    attribute = received_octet(image, ATTRIBUTE_TO_GET) if image.valid else 0
    map_type = received_octet(image, MAP_TYPE) if image.valid else 0
    error = _error(image, own, attribute, third & 0x1F)
    own.status = _first_status(axis) | _second_status(axis) << 8
    put(image, 0, 1, int(own.status) & 0xFF)
    if has_task(axis.positioning) and axis.positioning.task >= 0:
        put(image, 1, 1, int(axis.positioning.task))
    put(image, 2, 1, int(own.status) >> 8)
    if error != 0:
        put(image, 3, 1, (third & 0xE0) | ERROR_TYPE)
        put(image, 4, 2, error)
        put(image, 6, 1, received_octet(image, 2))
        put(image, 7, 1, third)
    else:
        put(image, 3, 1, third)
        if third & 0x1F == ACTUAL_TORQUE:
            put(image, 4, 4, clamp32(measured_current(axis.motor, axis.measurement) * 1000.0))
    place = measured_position(axis.motor, axis.measurement)
    put(image, 8, 4, signed32(position_number(axis.travel, axis.homing, place)))
    speed = measured_velocity(axis.motor, axis.measurement)
    put(image, 12, 4, clamp32(speed / own.settings.profile_step) if own.settings.profile_step > 0.0 else 0)
    put(image, 16, 4, int(axis.profidrive.motion_status))
    if attribute != 0:
        put(image, 24, 8, attribute_value(axis, attribute))
    elif own.read:
        put(image, 24, 8, int(own.read_value))
    put(image, ATTRIBUTE_TO_GET, 1, attribute)
    put(image, MAP_TYPE, 1, map_type)
    if map_type == DYNAMIC_MAP:
        show_map(axis, image, inputs)
