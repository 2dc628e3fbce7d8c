"""Inputs of the sensor interface: reference marks, probes, and whether the encoder can be read.

``sensor.marks`` defines each function's reference mark: a probe's edge, as in Moog MSD
manual 11.4, or the encoder's own zero mark.  Measured on the fly, functions 1 and 2 are the rising and the falling edge
of probe 1, functions 3 and 4 those of probe 2 (PROFIdrive 4.2, 6.3.6.5).
"""

from __future__ import annotations

from math import ceil, floor
from typing import Any

from pnfarm.firmware.causes import cause_held
from pnfarm.table.axis_codes import EDGE_FALLING, FAULT_SLOTS, MARK_NONE, MARK_PROBE_1, MARK_ZERO, NUMBER_MASK
from pnfarm.table.compiling.compiled import inlined

__all__ = ["ALL_FUNCTIONS", "can_wait", "cause_stays", "encoder_faulty", "look_for_marks"]

#: Functions 1 to 4, bit by bit.
ALL_FUNCTIONS = 0x0F


@inlined
def encoder_faulty(faults: Any, sensor: Any) -> bool:
    """Whether the drive shows the encoder's own fault."""
    number = int(sensor.settings.fault) & NUMBER_MASK
    found = False
    for i in range(FAULT_SLOTS):
        found = found or (number != 0 and (int(faults.code[i]) & NUMBER_MASK) == number)
    return found


@inlined
def cause_stays(faults: Any, sensor: Any) -> bool:
    """Whether the encoder cannot be read now."""
    return cause_held(faults, int(sensor.settings.fault))


@inlined
def _probe_there(sensor: Any, probe: int) -> bool:
    return sensor.settings.probe_mode == 0 and sensor.settings.probe_inputs[probe] != 0


@inlined
def can_wait(sensor: Any, function: int, probing: int) -> bool:
    """Whether a function (0 to 3) has a mark or a probe to wait for."""
    if probing:
        # function 1: probe 1, rising; 2: probe 1, falling; 3 and 4: probe 2
        return _probe_there(sensor, function >> 1)
    source = int(sensor.settings.marks[function])
    if source == MARK_NONE:
        return False
    return source == MARK_ZERO or _probe_there(sensor, source - MARK_PROBE_1)


@inlined
def _found(sensor: Any, function: int) -> None:
    sensor.active = int(sensor.active) & ~(1 << function) & ALL_FUNCTIONS
    sensor.found = int(sensor.found) | 1 << function


@inlined
def _zero_mark_passed(motor: Any, sensor: Any) -> bool:
    """Whether the shaft passed its zero mark since the last step."""
    now = motor.measured_position
    before = sensor.position
    return (now > before and floor(now) > floor(before)) or (now < before and ceil(now) < ceil(before))


@inlined
def look_for_marks(machine: Any, motor: Any, sensor: Any) -> None:
    """Record the marks and edges of active functions that occurred since the last step."""
    inputs = int(machine.inputs)
    changed = inputs ^ int(sensor.inputs)
    for function in range(4):
        if not sensor.active & (1 << function):
            continue
        if sensor.probing:
            probe = function >> 1
            falling = function & 1
        elif sensor.settings.marks[function] == MARK_ZERO:
            if _zero_mark_passed(motor, sensor):
                sensor.value[function] = (
                    floor(motor.measured_position)
                    if motor.measured_position > sensor.position
                    else ceil(motor.measured_position)
                )
                _found(sensor, function)
            continue
        else:
            probe = int(sensor.settings.marks[function]) - MARK_PROBE_1
            falling = 1 if sensor.settings.marks[4 + function] == EDGE_FALLING else 0
        bit = int(sensor.settings.probe_inputs[probe])
        if changed & bit and (inputs & bit == 0) == (falling == 1):
            sensor.value[function] = motor.measured_position
            _found(sensor, function)
