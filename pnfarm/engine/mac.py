"""MAC addresses in frames, as numbers."""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import inlined

__all__ = ["mac_at"]


@inlined
def mac_at(frame: Any, place: int) -> int:
    """The address of 6 octets that begins there."""
    # in this order LLVM makes two loads of it; of all octets in one row, six
    high = (int(frame[place]) << 24) | (int(frame[place + 1]) << 16)
    high |= (int(frame[place + 2]) << 8) | int(frame[place + 3])
    return (high << 16) | (int(frame[place + 4]) << 8) | int(frame[place + 5])
