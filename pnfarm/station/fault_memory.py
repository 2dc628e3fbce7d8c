"""The fault history in a drive's non-volatile memory, so that it outlives the farm as it outlives a power cycle.

AKD PROFINET manual 5.14, Moog MSD manual 10.9: the buffer holds what was before the supply went off.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.drives.profiles.profidrive.fault_buffer import active_faults, fault_numbers, fault_situations
from pnfarm.table.axis_codes import FAULT_SITUATIONS, FAULT_SLOTS

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["active_of", "history_of", "restore_history"]

PLACES = FAULT_SITUATIONS * FAULT_SLOTS


def history_of(axis: Any) -> list[int]:
    """The buffer as it is stored, without empty entries after the last fault."""
    numbers = fault_numbers(axis)
    while numbers and not numbers[-1]:
        numbers.pop()
    return numbers


def active_of(axis: Any) -> list[int]:
    """The fault situation that is not acknowledged: what remains of a buffer whose history is deleted."""
    return active_faults(axis)[: int(axis.faults.settings.places) or FAULT_SLOTS]


def restore_history(axis: Any, kept: Sequence[int]) -> None:
    """Put a kept buffer into the record of a drive that was off; a situation that was active then becomes history.

    A drive that loses its history begins with an empty one.
    """
    if axis.faults.settings.history_lost:
        return
    places = int(axis.faults.settings.places) or FAULT_SLOTS
    shift = places if any(kept[:places]) and not axis.faults.settings.stays else 0
    for place, number in enumerate(kept[: PLACES - shift]):
        axis.faults.buffer[place + shift] = number
    axis.faults.kept = sum(map(bool, fault_situations(axis)))
