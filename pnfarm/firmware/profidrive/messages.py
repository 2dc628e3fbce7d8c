"""Messages beside ZSW1: MELDW and MELD_NAMUR."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.motor.measurement import measured_velocity
from pnfarm.firmware.motor.torque_limits import torque_limited
from pnfarm.firmware.own_warnings import warned
from pnfarm.table.axis_codes import FAULT_SLOTS, FAULT_WORDS, NUMBER_MASK
from pnfarm.table.compiling.compiled import inlined

__all__ = ["message_word", "namur_word"]

#: Of MELD_NAMUR: any fault, and one that no other bit is for.
ANY_FAULT, OTHER_FAULT = 0x0001, 0x8000


@inlined
def message_word(axis: Any) -> int:
    """MELDW (SINAMICS G220 14.4.6.15; HIWIN E1 manual 3.16), of which a drive has ``message_bits``."""
    settings = axis.profidrive.settings
    velocity = measured_velocity(axis.motor, axis.measurement)
    word = 0
    if abs(axis.ramp.setpoint - axis.ramp.command) <= axis.ramp.settings.velocity_window:
        word |= 0x0001  # ramps are over
    if not torque_limited(axis):
        word |= 0x0002
    if abs(velocity) < settings.message_speeds[0]:
        word |= 0x0004
    if abs(velocity) < settings.message_speeds[1]:
        word |= 0x0008
    if not warned(axis.warnings, int(axis.warnings.settings.thermal[0])):
        word |= 0x0040  # no motor overload warning
    if not warned(axis.warnings, int(axis.warnings.settings.thermal[1])):
        word |= 0x0080  # no i2t warning
    if abs(axis.ramp.reference - velocity) <= axis.ramp.settings.velocity_window:
        word |= 0x0100
    if axis.drive.state == 4:
        word |= 0x0800  # controller enabled
    if axis.drive.state >= 2:
        word |= 0x1000  # drive ready
    if axis.drive.state >= 4:
        word |= 0x2000  # pulses enabled
    return (word & int(settings.message_bits)) | int(settings.message_set)


@inlined
def namur_word(axis: Any) -> int:
    """MELD_NAMUR, by the bits of the active faults (SINAMICS G115D 6.5.6; VIK-NAMUR)."""
    word = 0
    for place in range(FAULT_SLOTS):
        number = int(axis.faults.code[place]) & NUMBER_MASK
        if number != 0:
            bit = int(axis.profidrive.settings.namur_bits[number]) if number < FAULT_WORDS else 0
            word |= ANY_FAULT | (bit or OTHER_FAULT)
    return word
