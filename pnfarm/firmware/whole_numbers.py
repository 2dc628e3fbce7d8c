"""Whole numbers of 32 bits, as process images have them."""

from __future__ import annotations

from pnfarm.table.compiling.compiled import inlined

__all__ = ["clamp32", "signed32"]


@inlined
def signed32(value: int) -> int:
    """Wrap to a signed 32-bit number."""
    value &= 0xFFFFFFFF
    return value - 0x100000000 if value & 0x80000000 else value


@inlined
def clamp32(value: float) -> int:
    """The nearest signed 32-bit number."""
    if value >= 2147483647.0:
        return 0x7FFFFFFF
    if value <= -2147483648.0:
        return -0x80000000
    return round(value)
