"""Where a field of a drive's rows is in the tables' 64-bit words, as the engine's probes name it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pnfarm.errors import InternalError
from pnfarm.table.trace import SOURCE_AXIS_INTEGER, SOURCE_AXIS_REAL

if TYPE_CHECKING:
    import numpy as np

    from pnfarm.table.layout import Layout

__all__ = ["Place", "place_of"]

#: Fields that a probe has as well.
_OF_PROBE = ("source", "word", "less", "shift", "mask", "sign", "scale", "row", "octets", "big", "received")

WORD_OCTETS = 8


@dataclass(frozen=True, slots=True)
class Place:
    """Fields of :data:`pnfarm.table.trace.PROBE`, for the drive in row 0; :meth:`in_row` gives any other's.

    ``row_words`` are the 64-bit words of one row, 0 of a place in plain data, whose row is ``row``.
    """

    source: int
    word: int
    row_words: int
    less: int = -1
    shift: int = 0
    mask: int = -1
    sign: int = 0
    scale: float = 1.0
    row: int = 0
    octets: int = 0
    big: bool = False
    received: bool = False

    def in_row(self, row: int) -> Place:
        """The same field of the drive in this row, which is then the only one that it means."""
        base = row * self.row_words
        return replace(self, word=self.word + base, less=self.less if self.less < 0 else self.less + base, row_words=0)

    def fill(self, probe: Any) -> None:
        """Have a probe read it."""
        for name in _OF_PROBE:
            probe[name] = getattr(self, name)


def place_of(
    layout: Layout,
    key: str,
    *,
    source: int | None = None,
    less: str = "",
    element: int = 0,
    mask: int | None = None,
    signed: bool | None = None,
    scale: float = 1.0,
) -> Place:
    """The place of the field ``key``, of an array its ``element``.

    ``source`` may be left out for the axis; ``less``: the field that is subtracted; ``mask`` selects bits of a whole
    number; ``signed`` replaces the sign of the field's type.  Raises :class:`InternalError` for a field that a probe
    cannot hold.
    """
    offset, kind = _offset(layout, key, element)
    if layout.dtype.itemsize % WORD_OCTETS or kind.itemsize > WORD_OCTETS or offset % kind.itemsize:
        raise InternalError(f"{layout.name}.{key} does not lie within a 64-bit word")
    words = layout.dtype.itemsize // WORD_OCTETS
    if kind.kind == "f":
        if kind.itemsize != WORD_OCTETS:
            raise InternalError(f"{layout.name}.{key} is no number of double precision")
        minuend = _offset(layout, less, 0)[0] // WORD_OCTETS if less else -1
        return Place(SOURCE_AXIS_REAL, offset // WORD_OCTETS, words, less=minuend, scale=scale)
    bits = kind.itemsize * 8
    whole = -1 if bits == 64 else (1 << bits) - 1
    has_sign = kind.kind == "i" if signed is None else signed
    chosen = whole if mask is None else mask
    sign = (chosen + 1) >> 1 if has_sign and chosen > 0 else 0
    return Place(
        SOURCE_AXIS_INTEGER if source is None else source,
        offset // WORD_OCTETS,
        words,
        shift=offset % WORD_OCTETS * 8,
        mask=chosen,
        sign=sign,
        scale=scale,
    )


def _offset(layout: Layout, key: str, element: int) -> tuple[int, np.dtype[Any]]:
    """Octets from the start of a row to the field or its element, and the type."""
    offset, kind = layout.place(key)
    if kind.subdtype is not None:
        kind, shape = kind.subdtype
        if not 0 <= element < shape[0]:
            raise InternalError(f"{layout.name}.{key} has no element {element}")
        offset += element * kind.itemsize
    return offset, kind
