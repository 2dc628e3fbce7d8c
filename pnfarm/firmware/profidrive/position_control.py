"""POS_STW1 and POS_STW2: how telegram 111 asks for motion, each bit where the drive has it.

Bits 8 and 15 of the first word and 1 of the second: HIWIN E1 manual 3.12, 3.13.  The others (the sources are in the
models' ``telegrams.toml``): traversing blocks, set-up mode, continuous transfer, jogging by a distance, homing on the
fly and its direction, which limits count.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.motion.motion_tasks import select_task
from pnfarm.table.axis_codes import (
    MDI_SELECTED,
    MOTION_INTERMEDIATE_STOP,
    MOTION_TASK,
    SWITCHED_NOT,
    SWITCHED_OFF,
    SWITCHED_ON,
)
from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.signals import OVERRIDE, POS_STW1, POS_STW2

__all__ = ["forget_position_words", "take_first_position_word", "take_override", "take_second_position_word"]

# POS_STW1.
BLOCK = 0x003F  # number of a traversing block
ABSOLUTE = 0x0100
FORWARDS = 0x0200  # direction of set-up mode
BACKWARDS = 0x0400
CONTINUOUS = 0x1000
SET_UP = 0x4000
# POS_STW2.
HERE = 0x0002
INCREMENTAL = 0x0020
FLYING = 0x0100
OTHER_WAY = 0x0200  # of homing: backwards
PROBE_2 = 0x0400
FALLING = 0x0800
SOFTWARE_LIMITS = 0x4000
LIMIT_SWITCHES = 0x8000

#: Override of 100 % (HIWIN E1 manual 6.6.1 has this figure for the other percentages).
WHOLE = 16384.0


@inlined
def forget_position_words(axis: Any) -> None:
    """No telegram with these words counts in this step."""
    axis.machine.switches_off = 0
    axis.travel.switched = SWITCHED_NOT
    axis.homing.reversed = 0
    axis.homing.flying = 0
    axis.jog.incremental = 0


@inlined
def _make_reference(axis: Any, place: float) -> None:
    """Make a position the reference point; the target of a running absolute task moves with it."""
    before = axis.homing.origin
    axis.homing.origin = place - axis.homing.settings.position
    axis.homing.homed = 1
    runs = axis.positioning.state in (MOTION_TASK, MOTION_INTERMEDIATE_STOP) and not axis.positioning.endless
    if runs and not axis.positioning.relative and not axis.asked.settings.reference_keeps_place:
        axis.profile.target += axis.homing.origin - before


@inlined
def take_override(axis: Any, image: Any) -> None:
    """OVERRIDE, and the reference point by POS_STW or POS_STW2."""
    axis.asked.override = (image.received[OVERRIDE] & 0xFFFF) / WHOLE
    word = image.received[POS_STW2] & 0xFFFF
    if word & ~axis.asked.pos_stw2 & HERE:
        _make_reference(axis, axis.motor.position)
    axis.asked.pos_stw2 = word


@inlined
def take_first_position_word(axis: Any, image: Any, before: Any) -> None:
    """POS_STW1; ``before``: position, velocity, ramps and direction that the last step asked for."""
    bits = int(axis.profidrive.settings.position_bits[0])
    word = int(image.received[POS_STW1]) & bits
    asked = axis.asked
    asked.relative = 0 if word & ABSOLUTE else 1
    asked.mdi = 1 if word & MDI_SELECTED else 0
    if not asked.mdi:
        if asked.begins and bits & BLOCK:
            select_task(asked, axis.motion_tasks, word & BLOCK)
        else:
            asked.begins = 0
        return
    if word & SET_UP:
        # neither direction, or both, is none
        asked.relative = 0
        asked.endless = 1
        asked.backwards = 1 if word & BACKWARDS else 0
        if (word & FORWARDS != 0) == (word & BACKWARDS != 0):
            asked.velocity = 0.0
    other = before != (asked.position, asked.velocity, asked.acceleration, asked.deceleration, asked.backwards)
    runs = axis.positioning.state == MOTION_TASK and axis.positioning.endless == asked.endless
    if other and word & CONTINUOUS and runs and axis.positioning.task < 0 and not asked.relative:
        # a change counts without an edge while the task runs
        asked.begins = 1


@inlined
def take_second_position_word(axis: Any, image: Any) -> None:
    """POS_STW2 without its reference point."""
    bits = int(axis.profidrive.settings.position_bits[1])
    word = int(image.received[POS_STW2]) & bits
    axis.jog.incremental = 1 if word & INCREMENTAL else 0
    axis.homing.reversed = 1 if word & OTHER_WAY else 0
    if bits & SOFTWARE_LIMITS:
        axis.travel.switched = SWITCHED_ON if word & SOFTWARE_LIMITS else SWITCHED_OFF
    if bits & LIMIT_SWITCHES:
        axis.machine.switches_off = 0 if word & LIMIT_SWITCHES else 1
    _take_flying(axis, word)


@inlined
def _take_flying(axis: Any, word: int) -> None:
    """Homing on the fly: STW1.11 arms it in operation, and the edge of the probe sets the home position."""
    inputs, homing = int(axis.machine.inputs), axis.homing
    if not word & FLYING or not axis.orders.home or axis.drive.state != 4:
        homing.flying = 0
    elif axis.orders.home_changed:
        homing.flying = 1
    if word & FLYING:
        axis.orders.home = 0
        axis.orders.home_changed = 0
        probe = int(axis.sensor.settings.probe_inputs[1 if word & PROBE_2 else 0])
        if homing.flying and (inputs ^ int(homing.inputs)) & probe and (inputs & probe == 0) == (word & FALLING != 0):
            _make_reference(axis, axis.motor.measured_position)
            homing.flying = 0
    homing.inputs = inputs
