"""Where the engine finds a signal of plain data, as its probes name it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.table.access.places import Place
from pnfarm.table.trace import SOURCE_PLAIN_FLAG, SOURCE_PLAIN_REAL, SOURCE_PLAIN_SIGNED, SOURCE_PLAIN_UNSIGNED

if TYPE_CHECKING:
    from pnfarm.signals.signal import Signal

__all__ = ["PLAIN_SOURCES", "plain_place"]

#: By kind of type: what a probe can read.
PLAIN_SOURCES = {
    "bool": SOURCE_PLAIN_FLAG,
    "uint": SOURCE_PLAIN_UNSIGNED,
    "int": SOURCE_PLAIN_SIGNED,
    "float": SOURCE_PLAIN_REAL,
}


def plain_place(signal: Signal, row: int, octet: int) -> Place:
    """A number or a bit whose first octet is ``octet`` of a ``row`` of plain data; one bit of it is :attr:`bit`."""
    kind = signal.type
    return Place(
        SOURCE_PLAIN_UNSIGNED if signal.bit is not None else PLAIN_SOURCES[kind.kind],
        octet,
        0,
        scale=signal.scale,
        row=row,
        octets=kind.octets,
        big=signal.order == "big",
        received=signal.direction == "output",
    )
