"""What the sensor interface looks at: reference marks, probes, and whether the encoder can be read.

A function waits for its reference mark where the axis's data has it (``sensor.marks``): a probe's edge, as in Moog MSD
manual 11.4, or the encoder's own zero mark.  Measured on the fly, functions 1 and 2 are the rising and the falling edge
of probe 1, functions 3 and 4 those of probe 2 (PROFIdrive 4.2, 6.3.6.5).
"""

from __future__ import annotations

from math import ceil, floor
from typing import Any

from pnfarm.firmware.causes import NUMBER_MASK, cause_held
from pnfarm.table.axis_codes import EDGE_FALLING, FAULT_SLOTS, MARK_NONE, MARK_PROBE_1, MARK_ZERO
from pnfarm.table.compiled import compiled

__all__ = ["ALL_FUNCTIONS", "can_wait", "cause_stays", "encoder_faulty", "look_for_marks"]

#: Functions 1 to 4, bit by bit.
ALL_FUNCTIONS = 0x0F


@compiled
def encoder_faulty(axis: Any) -> bool:
    """Whether the drive shows the encoder's own fault."""
    number = int(axis.sensor.settings.fault) & NUMBER_MASK
    found = False
    for i in range(FAULT_SLOTS):
        found = found or (number != 0 and (int(axis.faults.code[i]) & NUMBER_MASK) == number)
    return found


@compiled
def cause_stays(axis: Any) -> bool:
    """Whether the encoder cannot be read now."""
    return cause_held(axis, int(axis.sensor.settings.fault))


@compiled
def _probe_there(axis: Any, probe: int) -> bool:
    return axis.sensor.settings.probe_mode == 0 and axis.sensor.settings.probe_inputs[probe] != 0


@compiled
def can_wait(axis: Any, function: int, probing: int) -> bool:
    """Whether a function (0 to 3) has a mark or a probe to wait for."""
    if probing:
        # function 1: probe 1, rising; 2: probe 1, falling; 3 and 4: probe 2
        return _probe_there(axis, function >> 1)
    source = int(axis.sensor.settings.marks[function])
    if source == MARK_NONE:
        return False
    return source == MARK_ZERO or _probe_there(axis, source - MARK_PROBE_1)


@compiled
def _found(axis: Any, function: int) -> None:
    axis.sensor.active = int(axis.sensor.active) & ~(1 << function) & ALL_FUNCTIONS
    axis.sensor.found = int(axis.sensor.found) | 1 << function


@compiled
def _zero_mark_passed(axis: Any) -> bool:
    """Whether the shaft passed its zero mark since the last step."""
    now = axis.motor.measured_position
    before = axis.sensor.position
    return (now > before and floor(now) > floor(before)) or (now < before and ceil(now) < ceil(before))


@compiled
def look_for_marks(axis: Any) -> None:
    """What active functions wait for, if it came since the last step."""
    inputs = int(axis.machine.inputs)
    changed = inputs ^ int(axis.sensor.inputs)
    for function in range(4):
        if not axis.sensor.active & (1 << function):
            continue
        if axis.sensor.probing:
            probe = function >> 1
            falling = function & 1
        elif axis.sensor.settings.marks[function] == MARK_ZERO:
            if _zero_mark_passed(axis):
                axis.sensor.value[function] = (
                    floor(axis.motor.measured_position)
                    if axis.motor.measured_position > axis.sensor.position
                    else ceil(axis.motor.measured_position)
                )
                _found(axis, function)
            continue
        else:
            probe = int(axis.sensor.settings.marks[function]) - MARK_PROBE_1
            falling = 1 if axis.sensor.settings.marks[4 + function] == EDGE_FALLING else 0
        bit = int(axis.sensor.settings.probe_inputs[probe])
        if changed & bit and (inputs & bit == 0) == (falling == 1):
            axis.sensor.value[function] = axis.motor.measured_position
            _found(axis, function)
