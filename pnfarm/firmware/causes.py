"""Causes of faults that are present, and whether the drive raises a fault for them."""

from __future__ import annotations

from typing import Any

from pnfarm.table.axis_codes import FAULT_ACTIONS, FAULT_SLOTS, NUMBER_MASK
from pnfarm.table.compiling.compiled import inlined

__all__ = ["cause_held", "ignored"]


@inlined
def cause_held(faults: Any, code: int) -> bool:
    """Whether the cause of the fault ``code`` is present; false for code 0, no fault."""
    held = False
    if faults.causes == 0:
        return held
    number = code & NUMBER_MASK
    for i in range(FAULT_SLOTS):
        held = held or (number != 0 and (int(faults.held[i]) & NUMBER_MASK) == number)
    return held


@inlined
def ignored(faults: Any, code: int) -> bool:
    """Whether a parameter keeps this fault from being raised (AKD PROFINET manual 5.6: FAULT130.ACTION and others)."""
    number = code & NUMBER_MASK
    for i in range(FAULT_ACTIONS):
        if int(faults.settings.ignored[i]) == number:
            return number != 0
    return False
