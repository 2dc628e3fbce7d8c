"""Types of a value in cyclic data, and its octets: ``bool``, ``int8`` to ``int64``, ``uint8`` to ``uint64`` (each
number of whole octets), ``float32``, ``float64``, ``octets[N]``, ``text[N]``.

A ``bool`` of its own octet is written as 0x00 or 0xFF and read as any bit of it (IEC 61158-6-10, Boolean); a text is
UTF-8, filled up with zeros.
"""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass
from typing import Literal

from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown

__all__ = ["BOOL", "FLOAT64", "MAX_OCTETS", "TYPE_PATTERN", "UINT8", "ByteOrder", "Value", "ValueType", "read_type"]

Value = bool | int | float | bytes | str
ByteOrder = Literal["big", "little"]

#: Octets of one value: those of a frame.
MAX_OCTETS = 1440
TYPE_PATTERN = r"(bool|u?int(8|16|24|32|40|48|56|64)|float(32|64)|(octets|text)\[[0-9]{1,4}\])"
_FLOATS = {4: "f", 8: "d"}


@dataclass(frozen=True, slots=True)
class ValueType:
    """A type and how many octets it has."""

    kind: Literal["bool", "int", "uint", "float", "octets", "text"]
    octets: int

    @property
    def name(self) -> str:
        match self.kind:
            case "bool":
                return "bool"
            case "octets" | "text":
                return f"{self.kind}[{self.octets}]"
            case _:
                return f"{self.kind}{8 * self.octets}"

    @property
    def is_number(self) -> bool:
        return self.kind in {"int", "uint", "float"}

    @property
    def limits(self) -> tuple[float, float]:
        """The least and the greatest number."""
        match self.kind:
            case "int":
                return -(1 << 8 * self.octets - 1), (1 << 8 * self.octets - 1) - 1
            case "uint":
                return 0, (1 << 8 * self.octets) - 1
            case "float" if self.octets == 4:
                return -3.4028234663852886e38, 3.4028234663852886e38
            case "float":
                return -math.inf, math.inf
            case _:
                return 0, 1

    def decode(self, octets: bytes, order: ByteOrder = "big") -> Value:
        """The value of exactly as many octets as the type has."""
        match self.kind:
            case "bool":
                return any(octets)
            case "int" | "uint":
                return int.from_bytes(octets, order, signed=self.kind == "int")
            case "float":
                number: float = struct.unpack(self._packed(order), octets)[0]
                return number
            case "octets":
                return bytes(octets)
            case "text":
                # an octet of no character is one of another, so that what is read can be written
                return bytes(octets).rstrip(b"\0").decode(errors="replace").replace("\ufffd", "?")

    def encode(self, value: Value, order: ByteOrder = "big") -> bytes:
        """Its octets; :class:`Problem` for a value that the type does not hold."""
        match self.kind:
            case "bool":
                if not isinstance(value, bool) and value not in {0, 1}:
                    raise Problem(f"{shown(value)} is neither true nor false", "true or false")
                return b"\xff" if value else b"\0"
            case "int" | "uint":
                return self._whole(value).to_bytes(self.octets, order, signed=self.kind == "int")
            case "float":
                if not isinstance(value, int | float):
                    raise Problem(f"{shown(value)} is not a number", "a number")
                try:
                    return struct.pack(self._packed(order), value)
                except (struct.error, OverflowError) as error:
                    raise Problem(f"{shown(value)} is outside of {self.name}", self._range()) from error
            case "octets":
                if not isinstance(value, bytes | bytearray):
                    raise Problem(f"{shown(value)} are not octets", f"up to {self.octets} octets")
                return self._filled(bytes(value))
            case "text":
                if not isinstance(value, str):
                    raise Problem(f"{shown(value)} is not a text", f"a text of up to {self.octets} octets")
                try:
                    return self._filled(value.encode())
                except UnicodeEncodeError as error:
                    raise Problem(f"{shown(value)} is no text that can be encoded", "characters of Unicode") from error

    def _packed(self, order: ByteOrder) -> str:
        return (">" if order == "big" else "<") + _FLOATS[self.octets]

    def _whole(self, value: Value) -> int:
        if not isinstance(value, int | float):
            raise Problem(f"{shown(value)} is not a number", f"a whole number, {self._range()}")
        if isinstance(value, float) and not value.is_integer():
            raise Problem(f"{shown(value)} is not a whole number", f"a whole number, {self._range()}")
        low, high = self.limits
        if not low <= value <= high:
            raise Problem(f"{int(value)} is outside of {self.name}", self._range())
        return int(value)

    def _range(self) -> str:
        low, high = self.limits
        return f"{low:g} to {high:g}" if self.kind == "float" else f"{low} to {high}"

    def _filled(self, octets: bytes) -> bytes:
        if len(octets) > self.octets:
            raise Problem(f"has {len(octets)} octets", f"up to {self.octets}")
        return octets.ljust(self.octets, b"\0")


BOOL = ValueType("bool", 1)
UINT8 = ValueType("uint", 1)
FLOAT64 = ValueType("float", 8)
_NAMED = {
    kind.name: kind
    for kind in (
        BOOL,
        *(ValueType("int", octets) for octets in range(1, 9)),
        *(ValueType("uint", octets) for octets in range(1, 9)),
        ValueType("float", 4),
        FLOAT64,
    )
}
_SIZED = re.compile(r"(octets|text)\[([0-9]{1,4})\]")


def read_type(text: str) -> ValueType:
    """A type by its name; :class:`Problem` with those that there are."""
    word = text.strip().lower()
    found = _NAMED.get(word)
    if found is not None:
        return found
    sized = _SIZED.fullmatch(word)
    if sized is not None and 1 <= int(sized[2]) <= MAX_OCTETS:
        return ValueType("octets" if sized[1] == "octets" else "text", int(sized[2]))
    allowed = f"bool, int8 to int64, uint8 to uint64, float32, float64, octets[N] or text[N] with N up to {MAX_OCTETS}"
    raise Problem(f"{shown(text)} is not a type" + did_you_mean(word, [*_NAMED, "octets[N]", "text[N]"]), allowed)
