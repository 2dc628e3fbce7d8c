"""Elementary data types of CIP, little-endian (CIP volume 1, appendix C-2 and table C-6.1).

A value is an integer, a float, a bool, or octets (strings, paths).  Types whose size is fixed have a ``size``.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "BOOL",
    "BYTE",
    "DINT",
    "DWORD",
    "EPATH",
    "INT",
    "LINT",
    "REAL",
    "SHORT_STRING",
    "SINT",
    "STRING",
    "TYPES",
    "UDINT",
    "UINT",
    "USINT",
    "WORD",
    "CipType",
    "Value",
]

Value = int | float | bool | bytes


@dataclass(frozen=True, slots=True)
class CipType:
    """One type: its code in data type segments, its name, its size in octets (None: as long as it says)."""

    code: int
    name: str
    size: int | None
    form: str = ""

    def read(self, r: Reader) -> Value:
        """The next value.  Raises ``short``, ``bad-value`` for a number that is not one of the type's."""
        if self.size is not None:
            (value,) = struct.unpack("<" + self.form, r.bytes(self.size))
            return bool(value) if self.name == "BOOL" else value
        return r.bytes(r.u16() * (2 if self.name == "EPATH" else 1) if self.name != "SHORT_STRING" else r.u8())

    def parse(self, data: bytes) -> Value:
        """Octets that hold one value and nothing else.  Raises ``short``, ``trailing``."""
        r = Reader(data, little=True)
        value = self.read(r)
        r.expect_end()
        return value

    def emit(self, value: Value) -> bytes:
        """Raises :class:`ValueError` for a value that the type cannot hold."""
        if self.size is not None:
            try:
                return struct.pack("<" + self.form, value)
            except struct.error as exc:
                raise ValueError(f"{value!r} is no {self.name}") from exc
        if not isinstance(value, bytes):
            raise ValueError(f"{value!r} is no {self.name}")  # noqa: TRY004 - one error for every value that does not fit
        if self.name == "SHORT_STRING":
            return Writer(little=True).u8(len(value)).bytes(value).getvalue()
        if self.name == "EPATH":
            return Writer(little=True).u16(len(value) // 2).bytes(value).getvalue()
        return Writer(little=True).u16(len(value)).bytes(value).getvalue()


BOOL: Final = CipType(0xC1, "BOOL", 1, "B")
SINT: Final = CipType(0xC2, "SINT", 1, "b")
INT: Final = CipType(0xC3, "INT", 2, "h")
DINT: Final = CipType(0xC4, "DINT", 4, "i")
LINT: Final = CipType(0xC5, "LINT", 8, "q")
USINT: Final = CipType(0xC6, "USINT", 1, "B")
UINT: Final = CipType(0xC7, "UINT", 2, "H")
UDINT: Final = CipType(0xC8, "UDINT", 4, "I")
ULINT: Final = CipType(0xC9, "ULINT", 8, "Q")
REAL: Final = CipType(0xCA, "REAL", 4, "f")
LREAL: Final = CipType(0xCB, "LREAL", 8, "d")
STRING: Final = CipType(0xD0, "STRING", None)
BYTE: Final = CipType(0xD1, "BYTE", 1, "B")
WORD: Final = CipType(0xD2, "WORD", 2, "H")
DWORD: Final = CipType(0xD3, "DWORD", 4, "I")
LWORD: Final = CipType(0xD4, "LWORD", 8, "Q")
SHORT_STRING: Final = CipType(0xDA, "SHORT_STRING", None)
#: As an attribute holds it: a count of words, then a padded EPATH.
EPATH: Final = CipType(0xDC, "EPATH", None)

TYPES: Final = {
    kind.code: kind
    for kind in (
        BOOL, SINT, INT, DINT, LINT, USINT, UINT, UDINT, ULINT, REAL, LREAL, STRING, BYTE, WORD, DWORD, LWORD,
        SHORT_STRING, EPATH,
    )
}  # fmt: skip
