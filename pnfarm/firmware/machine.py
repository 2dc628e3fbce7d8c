"""The machine around the axis: limit switches, cams on digital inputs, end stops.

Its positions are the shaft's, relative to the axis' position when the farm started; they do not change when the drive
is switched off.  Switches are read once in each step; an end stop holds the shaft within the step of motor and load.
"""

from __future__ import annotations

from math import inf
from typing import Any

from pnfarm.firmware.direction import shaft_sign
from pnfarm.table.axis_codes import (
    CAMS,
    FARTHEST,
    INPUT_CONTROLLED_STOP,
    INPUT_HOME_SWITCH,
    INPUT_LIMIT_HIGH,
    INPUT_LIMIT_LOW,
    MACHINE_CAMS,
    MACHINE_STOP_HIGH,
    MACHINE_STOP_LOW,
    MACHINE_STOPS_MOVED,
    MACHINE_SWITCH_HIGH,
    MACHINE_SWITCH_LOW,
    USED_INPUTS,
)
from pnfarm.table.compiling.compiled import inlined

__all__ = ["hold_at_stops", "take_switches"]


@inlined
def take_switches(direction: Any, machine: Any, outside: Any, motor: Any) -> None:
    """Read the switches that the axis' position, the plant and faults press, and apply the use of each input."""
    place = shaft_sign(direction) * motor.position
    limits = int(machine.settings.fault_limits) | (int(outside.limits) & 0x3)
    if machine.settings.parts & MACHINE_SWITCH_LOW and place <= machine.settings.switch_low:
        limits |= 0x1
    if machine.settings.parts & MACHINE_SWITCH_HIGH and place >= machine.settings.switch_high:
        limits |= 0x2
    inputs = int(machine.settings.fault_inputs) | int(outside.inputs)
    if machine.settings.parts & MACHINE_CAMS:
        for i in range(CAMS):
            if machine.settings.cam_low[i] <= place <= machine.settings.cam_high[i]:
                inputs |= int(machine.settings.cam_inputs[i])
    machine.inputs = inputs
    machine.home_switch = 0
    machine.stop_input = 0
    for i in range(USED_INPUTS):
        mode = int(machine.settings.input_modes[i])
        if mode == 0:
            continue
        active = (inputs >> i & 1) != int(machine.settings.input_inverted[i])
        if mode == INPUT_HOME_SWITCH and active:
            machine.home_switch = 1
        elif mode == INPUT_CONTROLLED_STOP and active:
            machine.stop_input = 1
        # a limit switch opens where it is pressed
        elif mode == INPUT_LIMIT_LOW and not active:
            limits |= 0x1
        elif mode == INPUT_LIMIT_HIGH and not active:
            limits |= 0x2
    machine.limit_switch = 0 if machine.switches_off else limits


@inlined
def hold_at_stops(direction: Any, machine: Any, outside: Any, motor: Any) -> None:
    """Stop a shaft that hits an end stop of the machine's or the plant's, whichever comes first."""
    parts = machine.settings.parts
    if not parts & (MACHINE_STOP_LOW | MACHINE_STOP_HIGH | MACHINE_STOPS_MOVED):
        return
    low = machine.settings.stop_low if parts & MACHINE_STOP_LOW else -inf
    high = machine.settings.stop_high if parts & MACHINE_STOP_HIGH else inf
    if parts & MACHINE_STOPS_MOVED:
        low, high = min(max(low, outside.stop_low), FARTHEST), max(min(high, outside.stop_high), -FARTHEST)
    sign = shaft_sign(direction)
    place, speed = sign * motor.position, sign * motor.velocity
    if place < low:
        motor.position = sign * low
        motor.velocity = sign * max(speed, 0.0)
    if place > high:
        motor.position = sign * high
        motor.velocity = sign * min(speed, 0.0)
