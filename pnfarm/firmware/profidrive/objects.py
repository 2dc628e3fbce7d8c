"""Objects of a drive system that are no axis: which bits of STW1 and ZSW1 their telegrams' words have, and what else.

An infeed (E_STW1, E_ZSW1) has the profile's state machine without a quick stop: its line contactor closes with ON, and
it is ready once the DC link is charged.  A control unit (CU_STW1, CU_ZSW1) and an encoder (STW2_ENC, ZSW2_ENC) have no
states.  Sources: the entries ``[[bits]]`` of the model's ``telegrams.toml``.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.axis_codes import (
    CONTROL_BY_PLC,
    OBJECT_AXIS,
    OBJECT_CONTROL_UNIT,
    OBJECT_INFEED,
    POWER_NO_QUICK_STOP,
    POWER_ON,
)
from pnfarm.table.axis_readings import SETPOINTS_NONE, SETPOINTS_TAKEN
from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.signals import A_DIGITAL_SET, STW1, STW2

__all__ = ["INFEED_CONTROL", "STATELESS_CONTROL", "control_bits", "infeed_status", "stateless_status", "take_object"]

#: Of STW1 in E_STW1: on, no coast stop, enable, acknowledge, control by PLC.  (5 and 6 inhibit motor and generator
#: operation there, of which this infeed has none.)
INFEED_CONTROL = 0x048B
#: Of STW1 in the words of objects without states: acknowledge, control by PLC.
STATELESS_CONTROL = 0x0080 | CONTROL_BY_PLC
#: Of ZSW1 in E_ZSW1: without quick stop and the bits of the speed.
INFEED_STATUS = 0x02DF
#: Its bits that need a charged DC link.
READY_OR_IN_OPERATION = 0x0006
CHARGED, CONTACTOR_CLOSED = 0x0800, 0x1000
#: Of ZSW1 in ZSW2_ENC, and in CU_ZSW1.
ENCODER_STATUS, UNIT_STATUS = 0x0288, 0x0088
#: Bits of CU_ZSW1 that are 0 while there is something to report: a warning, a fault, a safety signal.
NO_WARNING, NO_FAULT, NO_SAFETY_SIGNAL = 0x0200, 0x0400, 0x0800


@inlined
def control_bits(profidrive: Any, image: Any) -> int:
    """The bits of STW1 that the telegram's control word has."""
    if profidrive.settings.object == OBJECT_AXIS:
        return int(image.received[STW1]) & 0xFFFF
    if profidrive.settings.object == OBJECT_INFEED:
        return int(image.received[STW1]) & INFEED_CONTROL
    return int(image.received[STW2]) & STATELESS_CONTROL


@inlined
def _charged(profidrive: Any, now: int) -> bool:
    """Whether an infeed has charged the DC link."""
    begun = profidrive.contactor_ns
    return begun != 0 and (now - begun) * 1e-9 >= profidrive.settings.precharge


@inlined
def take_object(axis: Any, image: Any, now: int) -> None:
    """Once in each step, after the axis's orders: an infeed's contactor, a control unit's digital outputs."""
    profidrive = axis.profidrive
    if profidrive.settings.object == OBJECT_INFEED:
        power = int(axis.orders.power) | POWER_NO_QUICK_STOP
        if not power & POWER_ON or axis.drive.state < 2:
            profidrive.contactor_ns = 0
        elif profidrive.contactor_ns == 0:
            profidrive.contactor_ns = now
        if axis.drive.state == 2 and not _charged(profidrive, now):
            power &= ~POWER_ON
        axis.orders.power = power
    elif profidrive.settings.object == OBJECT_CONTROL_UNIT:
        if profidrive.setpoints == SETPOINTS_TAKEN:
            axis.machine.outputs = int(image.received[A_DIGITAL_SET]) & 0xFFFF
        elif profidrive.setpoints == SETPOINTS_NONE:
            axis.machine.outputs = 0


@inlined
def infeed_status(profidrive: Any, word: int, now: int) -> int:
    """E_ZSW1, of ZSW1 ``word``."""
    word &= INFEED_STATUS
    if profidrive.contactor_ns != 0:
        word |= CONTACTOR_CLOSED
    # the contactor opens in the step that orders it, the state follows in the next one
    return word | CHARGED if _charged(profidrive, now) else word & ~READY_OR_IN_OPERATION


@inlined
def stateless_status(profidrive: Any) -> int:
    """ZSW2_ENC or CU_ZSW1 without its sign of life."""
    word = int(profidrive.zsw1)
    if profidrive.settings.object != OBJECT_CONTROL_UNIT:
        return word & ENCODER_STATUS
    told = word & UNIT_STATUS | NO_SAFETY_SIGNAL
    if not word & 0x0080:
        told |= NO_WARNING
    return told if word & 0x0008 or profidrive.settings.others_faulty else told | NO_FAULT
