"""Output: ZSW1 and ZSW2, as in the profile or as a maker defines them; ``status_form`` is evaluated here only."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.profidrive.objects import infeed_status, stateless_status
from pnfarm.firmware.profidrive.position_status import position_bits
from pnfarm.firmware.profidrive.speed_status import speed_bits
from pnfarm.firmware.profidrive.status_msd import second_status_msd, status_msd
from pnfarm.table.axis_codes import (
    CONTROL_BY_PLC,
    OBJECT_CONTROL_UNIT,
    OBJECT_ENCODER,
    OBJECT_INFEED,
    STATUS_MOOG,
)
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["second_status_word", "status_word"]

#: Bit offset of the sign of life in ZSW2.
LIFE_SHIFT = 12


@inlined
def _control_requested(drive: Any, profidrive: Any) -> bool:
    """ZSW1.9: the drive requests control, or the bit shows STW1.10."""
    return drive.state > 0 and (
        not profidrive.settings.control_shown or int(profidrive.stw1_seen) & CONTROL_BY_PLC != 0
    )


@compiled
def _as_in_the_profile(axis: Any) -> int:
    """ZSW1, bit by bit (AKD PROFINET manual 5.5)."""
    state = axis.drive.state
    stw1 = axis.profidrive.stw1
    word = 0
    if state >= 2:
        word |= 0x0001  # ready to switch on
    if state >= 3:
        word |= 0x0002  # ready to operate
    if state == 4:
        word |= 0x0004  # operation enabled
    if axis.faults.code[0] != 0:
        word |= 0x0008
    if stw1 & 0x0002:
        word |= 0x0010  # coast stop not activated
    if stw1 & 0x0004:
        word |= 0x0020  # quick stop not activated
    if state <= 1:
        word |= 0x0040  # switching on inhibited
    if axis.warnings.code != 0:
        word |= 0x0080
    if _control_requested(axis.drive, axis.profidrive):
        word |= 0x0200
    if axis.drive.settings.opmode == 2:
        word |= position_bits(axis)
    elif axis.drive.settings.opmode == 1:
        word |= speed_bits(axis)
    return word


@inlined
def status_word(axis: Any) -> int:
    """ZSW1."""
    word = _as_in_the_profile(axis)
    if axis.profidrive.settings.object == OBJECT_INFEED:
        return infeed_status(axis.profidrive, word, axis.last_ns)
    return status_msd(axis, word) if axis.profidrive.settings.status_form == STATUS_MOOG else word


@inlined
def second_status_word(axis: Any) -> int:
    """ZSW2: the drive's sign of life, and in some telegrams whether pulses are enabled.

    HIWIN E1 manual 3.6; Moog MSD manual, table 10.17.
    """
    word = int(axis.life.sent) << LIFE_SHIFT
    if axis.profidrive.settings.object in (OBJECT_ENCODER, OBJECT_CONTROL_UNIT):
        return word | stateless_status(axis.profidrive)
    if axis.profidrive.settings.status_form == STATUS_MOOG:
        return word | second_status_msd(axis)
    if axis.drive.state >= 4:
        word |= int(axis.profidrive.settings.pulses_enabled)
    return word
