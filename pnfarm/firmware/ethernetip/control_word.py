"""Input: octet 0 of the command assembly, the loss of the controller, and the orders of the axis that follow.

AKD EtherNet/IP manual 6.2.2.2.  Enable switches on with its rising edge; a fault or a disable by parameter ends that,
and Enable has to rise again (the manual says so of the controlled stop only; ``enable_outlasts_fault`` is the other
reading).  Without valid data the drive coasts (or stops: ``loss_stops``); cyclic data that stopped raise its fault
(5.3, F702).
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.ethernetip.octets import received_octet
from pnfarm.firmware.faults import raise_fault
from pnfarm.table.axis_codes import (
    DISABLE_STOPPED,
    POWER_ENABLE,
    POWER_NO_COAST,
    POWER_NO_QUICK_STOP,
    POWER_ON,
    STOP_DROP,
)
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.image import LOST_EXPIRED, LOST_STOP

__all__ = ["DIRECTION", "ENABLE", "LOAD", "RELATIVE", "START_BLOCK", "forget_control_word", "take_control_word"]

# Bits of the control word.
LOAD = 0x01
START_BLOCK = 0x02
RELATIVE = 0x04
DIRECTION = 0x08
SMOOTH_STOP = 0x10
HARD_STOP = 0x20
ENABLE = 0x80

POSITION_MODE = 2
READY = POWER_NO_COAST | POWER_NO_QUICK_STOP
RUN = READY | POWER_ON | POWER_ENABLE


@inlined
def _watch(own: Any, faults: Any, image: Any, now: int) -> None:
    """The loss of the controller's data."""
    if own.image_valid and not image.valid:
        own.by_attribute = 0
        if image.lost == LOST_EXPIRED:
            raise_fault(faults, faults.settings.loss_fault, now)
        elif image.lost == LOST_STOP:
            raise_fault(faults, faults.settings.stop_fault, now)
    own.image_valid = image.valid


@compiled
def _wanted(own: Any, word: int) -> bool:
    """Whether Enable is set: in the word, or by attribute 0x11 while no controller sends one."""
    if own.enables_seen != own.settings.enables:
        own.enables_seen = own.settings.enables
        own.by_attribute = own.settings.enable
        if own.settings.enable:
            # each writing counts as an edge
            own.wanted = 0
        else:
            # also of a drive that the word has enabled
            own.enabled = 0
    return word & ENABLE != 0 or (own.by_attribute != 0 and not own.image_valid)


@compiled
def _power(axis: Any, word: int) -> int:
    """POWER_* of this step."""
    own = axis.ethernetip
    wanted = _wanted(own, word)
    rises = wanted and not own.wanted
    own.wanted = 1 if wanted else 0
    faulty = axis.faults.code[0] != 0
    stops = axis.drive.settings.disable_method == DISABLE_STOPPED
    if word & HARD_STOP and wanted:
        own.stopped = 1
    elif not wanted and not word & HARD_STOP:
        own.stopped = 0
    if faulty and not own.settings.enable_outlasts_fault:
        rises = False
        own.enabled = 0
    if rises:
        own.enabled = 1
    if axis.commands.disable and axis.drive.state >= 4:
        if stops:
            own.stopped = 1
        else:
            own.enabled = 0
    if own.stopped and wanted:
        return RUN & ~POWER_NO_QUICK_STOP
    if wanted:
        return RUN if own.enabled else READY
    own.enabled = 0
    if (stops if own.image_valid else own.settings.loss_stops) and axis.drive.state >= 4:
        return RUN & ~POWER_NO_QUICK_STOP
    return 0


@inlined
def take_control_word(axis: Any, image: Any, now: int) -> int:
    """Once in each step; gives the word in force, 0 without valid data."""
    own = axis.ethernetip
    orders = axis.orders
    _watch(own, axis.faults, image, now)
    word = received_octet(image, 0) if image.valid else 0
    if image.valid and axis.faults.code[0] != 0 and not axis.faults.reacted and not word & ENABLE:
        axis.faults.reacted = 1
    power = _power(axis, word)
    orders.power_changed = power ^ int(orders.power)
    orders.power = power
    orders.led = 1 if own.wanted else 0
    halts = word & SMOOTH_STOP != 0 or own.stopped != 0
    if halts and not orders.halt and axis.drive.settings.opmode == POSITION_MODE:
        axis.commands.stop = STOP_DROP
    orders.halt = 1 if halts else 0
    orders.reject = orders.halt
    orders.pause = 0
    orders.ramp = 1
    orders.ramp_runs = 1
    orders.setpoint = 1
    orders.start = 1 if word & LOAD else 0
    orders.start_changed = 1 if (word ^ int(own.word)) & LOAD else 0
    orders.home = 0
    orders.home_changed = 0
    orders.jog = 0
    orders.jog_barred = 1
    return word


@inlined
def forget_control_word(own: Any) -> None:
    """The drive was switched on: no word has been received yet."""
    own.word = 0
    own.image_valid = 0
    own.enabled = 0
    own.stopped = 0
    own.wanted = 0
    own.by_attribute = 0
    own.enables_seen = own.settings.enables
