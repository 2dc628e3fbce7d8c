"""The fault buffer as PROFIdrive shows it (AKD PROFINET manual 5.14; profile 4.1, 6.3.8).

PNU 947 holds ``FAULT_SITUATIONS`` situations of ``FAULT_SLOTS`` faults: index = situation * 8 + fault.  Situation 0 is
the one not acknowledged yet; acknowledging moves it down by eight, or in a drive with ``faults.stays`` the next one
does (Moog MSD manual 10.9).  PNU 944 counts situations; equal values before and after reading 947 say that
nothing moved in between.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.axis_codes import FAULT_SITUATIONS, FAULT_SLOTS, NUMBER_MASK

__all__ = ["active_faults", "fault_counter", "fault_numbers", "fault_situations"]


def fault_numbers(axis: Any) -> list[int]:
    """PNU 947, element by element."""
    return [int(code) & NUMBER_MASK for code in axis.faults.buffer]


def fault_counter(axis: Any) -> int:
    """PNU 944."""
    return int(axis.faults.counter) & 0xFFFF


def active_faults(axis: Any) -> list[int]:
    """Numbers of the faults not acknowledged, oldest first."""
    return [number for code in axis.faults.code if (number := int(code) & NUMBER_MASK)]


def fault_situations(axis: Any) -> list[list[int]]:
    """The buffer by situation, newest first, without empty places; a situation has the drive's number of places."""
    numbers = fault_numbers(axis)
    places = int(axis.faults.settings.places) or FAULT_SLOTS
    rows = [numbers[n : n + places] for n in range(0, FAULT_SITUATIONS * FAULT_SLOTS, places)]
    return [[number for number in row if number] for row in rows]
