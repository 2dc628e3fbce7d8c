"""Input: STW1 and the loss of the controller, and the orders of the axis that follow from them.

The orders (:mod:`pnfarm.firmware.records.orders`) are independent of the bus: bits
4 to 6 of STW1 control the ramp generator in speed control, and tasks in position mode (PROFIdrive 4.2, 6.3.2, 6.3.3).
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.faults import acknowledge, raise_fault
from pnfarm.firmware.profidrive.objects import control_bits, take_object
from pnfarm.firmware.profidrive.telegram import from_setpoints, no_setpoints
from pnfarm.table.axis_codes import (
    CONTROL_BY_PLC,
    OBJECT_AXIS,
    POWER_ENABLE,
    POWER_NO_COAST,
    POWER_NO_QUICK_STOP,
    POWER_ON,
)
from pnfarm.table.axis_readings import (
    SETPOINTS_HELD,
    SETPOINTS_NONE,
    SETPOINTS_TAKEN,
    WITHOUT_CONTROL_HOLD,
    WITHOUT_CONTROL_TAKEN,
    WITHOUT_RUN_HOLD,
    WITHOUT_RUN_OFF,
)
from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.image import LOST_EXPIRED, LOST_STOP

__all__ = ["forget_control_word", "take_control_word"]

# Bits of STW1.
ON = 0x0001
NO_COAST = 0x0002
NO_QUICK_STOP = 0x0004
ENABLE = 0x0008
RAMP = 0x0010  # in position mode: not rejected
RAMP_RUNS = 0x0020  # in position mode: no intermediate stop
SETPOINT = 0x0040  # in position mode: a task begins
FAULT_ACKNOWLEDGE = 0x0080
JOG_SHIFT = 8
JOG_BITS = 0x3
HOME = 0x0800


@inlined
def _setpoints(profidrive: Any, image: Any, word: int) -> int:
    """SETPOINTS_* of this step for the STW1 ``word``."""
    if not image.valid:
        held = image.lost == LOST_STOP and profidrive.settings.without_run == WITHOUT_RUN_HOLD
        return SETPOINTS_HELD if held else SETPOINTS_NONE
    if word & CONTROL_BY_PLC or profidrive.settings.without_control == WITHOUT_CONTROL_TAKEN:
        return SETPOINTS_TAKEN
    return SETPOINTS_HELD if profidrive.settings.without_control == WITHOUT_CONTROL_HOLD else SETPOINTS_NONE


@inlined
def _take_word(axis: Any, image: Any, now: int) -> None:
    """Accept STW1, or hold the one accepted last, as the drive's open points are set."""
    valid = image.valid
    # a word may be in force still, too, of a controller that went to STOP before
    if not valid and (axis.profidrive.image_valid or axis.profidrive.stw1 != 0):
        if image.lost == LOST_EXPIRED and axis.faults.settings.loss_delay_ns == 0:
            raise_fault(axis.faults, axis.faults.settings.loss_fault, now)
        elif image.lost == LOST_STOP and axis.profidrive.image_valid:
            raise_fault(axis.faults, axis.faults.settings.stop_fault, now)
    if (
        image.frames != axis.profidrive.telegram_frames
        or (valid and not axis.profidrive.image_valid)
        or image.lost == LOST_STOP
    ):
        # telegrams arrive, whether their data is good or not
        axis.profidrive.telegram_frames = image.frames
        axis.profidrive.telegram_ns = now
    elif (
        axis.faults.settings.loss_delay_ns > 0
        and axis.profidrive.telegram_ns != 0
        and now - axis.profidrive.telegram_ns >= axis.faults.settings.loss_delay_ns
    ):
        axis.profidrive.telegram_ns = 0
        raise_fault(axis.faults, axis.faults.settings.loss_fault, now)
    axis.profidrive.image_valid = valid
    word = control_bits(axis.profidrive, image)
    axis.profidrive.setpoints = _setpoints(axis.profidrive, image, word)
    if axis.profidrive.setpoints == SETPOINTS_NONE:
        # no controller: the axis coasts, or stops as with STW1.0 = 0
        off = image.lost == LOST_STOP and axis.profidrive.settings.without_run == WITHOUT_RUN_OFF
        word = int(axis.profidrive.stw1) & ~ON if off else 0
    elif axis.profidrive.settings.control_location != axis.profidrive.settings.bus_location:
        # control is elsewhere (``control_location``): the controller's STW1 is ignored
        word = 0
    elif axis.profidrive.setpoints == SETPOINTS_HELD:
        # the other bits are not accepted; their edges are ignored, even when bit 10 returns
        if valid:
            axis.profidrive.stw1_seen = word
        axis.profidrive.stw1_changed = 0
        return
    axis.profidrive.stw1_changed = word ^ axis.profidrive.stw1_seen
    if word & FAULT_ACKNOWLEDGE and (
        axis.profidrive.settings.acknowledges_by_level or axis.profidrive.stw1_changed & FAULT_ACKNOWLEDGE
    ):
        acknowledge(axis.faults, axis.positioning, axis.profidrive.stw1_changed & FAULT_ACKNOWLEDGE != 0)
    axis.profidrive.stw1_seen = word
    axis.profidrive.stw1 = word
    if (
        axis.profidrive.setpoints != SETPOINTS_NONE
        and axis.profidrive.settings.reference_source == axis.profidrive.settings.bus_source
    ):
        from_setpoints(axis, image)
    else:
        no_setpoints(axis.torque, axis.ramp)
    if valid and axis.faults.code[0] != 0 and not axis.faults.reacted and (word & 0x0009) != 0x0009:
        axis.faults.reacted = 1


@inlined
def _power(word: int) -> int:
    """POWER_* of a control word."""
    return (
        (POWER_ON if word & ON else 0)
        | (POWER_NO_COAST if word & NO_COAST else 0)
        | (POWER_NO_QUICK_STOP if word & NO_QUICK_STOP else 0)
        | (POWER_ENABLE if word & ENABLE else 0)
    )


@inlined
def _give_orders(orders: Any, profidrive: Any) -> None:
    """STW1 in force as orders of the axis."""
    word = int(profidrive.stw1)
    changed = int(profidrive.stw1_changed)
    orders.led = 1 if word else 0
    orders.power = _power(word)
    orders.power_changed = _power(changed)
    orders.ramp = 1 if word & RAMP else 0
    orders.ramp_runs = 1 if word & RAMP_RUNS else 0
    orders.setpoint = 1 if word & SETPOINT else 0
    orders.reject = 0 if word & RAMP else 1
    orders.pause = 0 if word & RAMP_RUNS else 1
    orders.start = 1 if word & SETPOINT else 0
    orders.start_changed = 1 if changed & SETPOINT else 0
    orders.home = 1 if word & HOME else 0
    orders.home_changed = 1 if changed & HOME else 0
    orders.jog = word >> JOG_SHIFT & JOG_BITS
    orders.jog_barred = 1 if word & (RAMP | RAMP_RUNS | SETPOINT) else 0


@inlined
def take_control_word(axis: Any, image: Any, now: int) -> None:
    """Once in each step: STW1 and the set points of speed and torque."""
    axis.profidrive.stw1_before = axis.profidrive.stw1
    _take_word(axis, image, now)
    _give_orders(axis.orders, axis.profidrive)
    if axis.profidrive.settings.object != OBJECT_AXIS:
        take_object(axis, image, now)


@inlined
def forget_control_word(profidrive: Any, image: Any) -> None:
    """The drive was switched on: no word has been received yet, and frames from before do not count."""
    profidrive.stw1 = 0
    profidrive.stw1_seen = 0
    profidrive.image_valid = 0
    profidrive.telegram_ns = 0
    profidrive.telegram_frames = image.frames
