"""Octets of an assembly in the process image, which has them as 16 double words, least significant octet first."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.whole_numbers import signed32
from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.signals import ASSEMBLY

__all__ = ["put", "received", "received_long", "received_octet"]


@inlined
def received(image: Any, octet: int) -> int:
    """The signed double word that begins at this octet, a multiple of 4."""
    return int(image.received[ASSEMBLY + (octet >> 2)])


@inlined
def received_octet(image: Any, octet: int) -> int:
    """One octet."""
    return (int(image.received[ASSEMBLY + (octet >> 2)]) >> ((octet & 3) * 8)) & 0xFF


@inlined
def received_long(image: Any, octet: int) -> int:
    """The signed number of eight octets that begins at this one, a multiple of 4."""
    return received(image, octet + 4) << 32 | received(image, octet) & 0xFFFFFFFF


@inlined
def put(image: Any, octet: int, size: int, value: int) -> None:
    """Put the lowest ``size`` octets of a number into the response, whose octets there are zero."""
    for i in range(size):
        slot = ASSEMBLY + ((octet + i) >> 2)
        part = ((value >> (8 * i)) & 0xFF) << (((octet + i) & 3) * 8)
        image.sent[slot] = signed32(int(image.sent[slot]) | part)
