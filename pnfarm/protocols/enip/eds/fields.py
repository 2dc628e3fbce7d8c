"""Fields of an electronic data sheet as numbers, paths and parameters (CIP volume 1, chapter 7-3.6.4)."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.eds.document import Limits, Parameter
from pnfarm.protocols.enip.eds.text import EdsString, whole
from pnfarm.protocols.enip.wire.data_types import TYPES
from pnfarm.vocabulary.quoting import shown
from pnfarm.wire.value_types import ValueType

if TYPE_CHECKING:
    from pnfarm.protocols.enip.eds.text import Eds, EdsEntry
    from pnfarm.wire.value_types import Value

__all__ = ["LONGEST_DATA", "NUMBERED", "FieldReader", "numbered", "refusal"]

#: Octets of data that a frame has room for.
LONGEST_DATA: Final = 1400
#: Octets of a path, whose number the Parameter object has in one octet (CIP volume 1, 5A-14.2).
_LONGEST_PATH: Final = 0xFF
#: Octets of one parameter.
_LONGEST_VALUE: Final = 500
_U8, _U16 = 0xFF, 0xFFFF
#: The first octet of a logical segment, without its kind and width.
_LOGICAL: Final = 0x20

# Fields of ParamN, from 0.
_PATH, _DESCRIPTOR, _TYPE, _SIZE, _NAME, _UNIT, _HELP, _MINIMUM, _MAXIMUM, _DEFAULT, _SCALING = range(2, 13)
_DECIMALS = 20

_SIGNED = frozenset({0xC2, 0xC3, 0xC4, 0xC5, 0xCC, 0xD6, 0xD7, 0xD8, 0xDB})
_FLOATS = {0xCA: 4, 0xCB: 8}
#: Types that are no numbers, whatever their length.
_TEXTS = frozenset({0xD0, 0xD5, 0xD9, 0xDA, 0xDC, 0xDE})
NUMBERED = re.compile(r"(param|assem|enum|connection|class|port)([0-9]{1,5})", re.IGNORECASE)
_PATH_PART = re.compile(r"\s*(?:([0-9a-f]{2})|\[?(param[0-9]{1,5})\]?)\s*", re.IGNORECASE)


def refusal(entry: EdsEntry, what: str) -> DecodeError:
    """An entry that cannot be followed, with its line."""
    return DecodeError("bad-entry", f"line {entry.line}: {entry.keyword}: {what}")


def numbered(eds: Eds, section: str, kind: str) -> dict[int, EdsEntry]:
    """The entries ``kindN`` of a section; the first of a number counts."""
    found: dict[int, EdsEntry] = {}
    known = eds.section(section)
    for entry in known.entries if known is not None else ():
        match = NUMBERED.fullmatch(entry.keyword)
        if match is not None and match[1].casefold() == kind:
            found.setdefault(int(match[2]), entry)
    return found


class FieldReader:
    """Reads fields of one file; ``entries`` are its parameters by number, each read when it is asked for first."""

    def __init__(self, eds: Eds) -> None:
        self._eds = eds
        self.entries = numbered(eds, "Params", "param")
        self._enums = self._all_enums()
        self._parameters: dict[int, Parameter] = {}

    # -- numbers -----------------------------------------------------------------------------------------------------

    def whole(self, entry: EdsEntry, place: int, default: int, most: int, *, what: str = "its number") -> int:
        """A field; ``default`` for an empty one."""
        text = entry.text(place).strip()
        if not text:
            return default
        found = whole(text)
        if found is None:
            raise refusal(entry, f"{what} {shown(text)} is not a number")
        if not 0 <= found <= most:
            raise refusal(entry, f"{what} is {found}, not 0 to {most}")
        return found

    def limits(self, entry: EdsEntry, text: str, most: int, what: str, *, free: bool = False) -> Limits:
        """A number, or a parameter whose value is one; a missing bound is its default, or none if ``free``."""
        found = whole(text)
        if found is not None:
            limits = Limits(found, found, found)
        else:
            match = NUMBERED.fullmatch(text)
            named = match is not None and match[1].casefold() == "param" and int(match[2]) in self.entries
            parameter = self.parameter(int(match[2])) if match is not None and named else None
            if parameter is None or not isinstance(parameter.default, int):
                raise refusal(entry, f"{what} {shown(text)} is not a number, and no default of a parameter")
            default = parameter.default
            least, greatest = parameter.minimum, parameter.maximum
            ends = (0, most) if free else (default, default)
            low, high = (int(end if one is None else one) for one, end in zip((least, greatest), ends, strict=True))
            limits = Limits(default, min(low, default), max(high, default))
        if not 0 <= limits.least <= limits.default <= most:
            raise refusal(entry, f"{what} is {limits.default}, not 0 to {most}")
        return Limits(limits.default, limits.least, min(limits.most, most))

    def octets(self, entry: EdsEntry, text: str) -> Limits:
        """A size."""
        try:
            return self.limits(entry, text, LONGEST_DATA, "the size")
        except DecodeError as exc:
            number = whole(text)
            if number is None or number < 0:
                raise
            raise refusal(entry, f"{number} octets of data do not fit into a frame") from exc

    # -- parameters --------------------------------------------------------------------------------------------------

    def _all_enums(self) -> dict[int, dict[int, str]]:
        """``EnumN = value, "text", ...``; the older ``ParamN = "text", ...`` counts from 0."""
        found: dict[int, dict[int, str]] = {}
        for name, kind in (("Params", "enum"), ("Enum", "enum"), ("EnumPar", "param")):
            for number, entry in numbered(self._eds, name, kind).items():
                texts: dict[int, str] = {}
                value: int | None = None
                for place, one in enumerate(entry.fields):
                    if isinstance(one, EdsString):
                        texts.setdefault(len(texts) if value is None else value, one.value.strip())
                        value = None
                    elif isinstance(one, str) and one and (value := whole(one)) is None:
                        raise refusal(entry, f"field {place + 1}, {shown(one)}, is neither a number nor a text")
                found.setdefault(number, texts)
        return found

    def parameter(self, number: int) -> Parameter:
        if number not in self._parameters:
            self._parameters[number] = self._read_parameter(number, self.entries[number])
        return self._parameters[number]

    def _read_parameter(self, number: int, entry: EdsEntry) -> Parameter:
        if number > _U16:
            raise refusal(entry, f"its number is above {_U16}, the highest instance of a parameter")
        code = self.whole(entry, _TYPE, 0, _U8, what="its data type")
        size = self.whole(entry, _SIZE, 0, _LONGEST_VALUE, what="its data size")
        if not size:
            known = TYPES.get(code)
            size = (known.size if known is not None else None) or 1
        kind = _type_of(code, size)
        default = self._value(entry, _DEFAULT, kind)
        least, greatest = self._bounds(entry, kind)
        multiplier, divisor, base = (
            self.whole(entry, _SCALING + place, 1, _U16, what="its scaling") for place in range(3)
        )
        offset = self._value(entry, _SCALING + 3, ValueType("int", 4))
        return Parameter(
            number=number,
            name=entry.text(_NAME).strip() or f"Param{number}",
            path=self.path(entry, _PATH),
            descriptor=self.whole(entry, _DESCRIPTOR, 0, 0xFFFF_FFFF, what="its descriptor"),
            code=code,
            type=kind,
            unit=entry.text(_UNIT).strip(),
            help=entry.text(_HELP).strip(),
            minimum=least,
            maximum=greatest,
            default=kind.decode(bytes(size)) if default is None else default,
            scaling=(multiplier, divisor, base, offset if isinstance(offset, int) else 0),
            decimals=self.whole(entry, _DECIMALS, 0, _U8, what="its precision"),
            enums=self._enums.get(number, {}),
        )

    def _bounds(self, entry: EdsEntry, kind: ValueType) -> tuple[int | float | None, int | float | None]:
        """Minimum and maximum; both the same, or the wrong way round, means none (files have 0 and 0)."""
        found = [self._value(entry, place, kind, bound=True) for place in (_MINIMUM, _MAXIMUM)]
        least, greatest = (one if isinstance(one, int | float) else None for one in found)
        if least is not None and greatest is not None and least >= greatest:
            return None, None
        return least, greatest

    def _value(self, entry: EdsEntry, place: int, kind: ValueType, *, bound: bool = False) -> Value | None:
        """A value of a type; None for an empty field, and for a bound that the type has anyway.

        A hexadecimal one has the bits of a negative number.
        """
        text = entry.text(place).strip()
        if not text:
            return None
        if kind.kind == "octets":
            return text.encode("latin-1", "replace")[: kind.octets].ljust(kind.octets, b"\0")
        if kind.kind == "float":
            try:
                number = float(text)
            except ValueError:
                number = math.nan
            if bound and abs(number) > kind.limits[1]:
                return None
            if not math.isfinite(number) or not kind.limits[0] <= number <= kind.limits[1]:
                raise refusal(entry, f"its value {shown(text)} is not a number of {kind.name}")
            return number
        found = whole(text)
        if found is None:
            raise refusal(entry, f"its value {shown(text)} is not a number")
        least, most = (int(limit) for limit in kind.limits)
        if kind.kind == "int" and text.lower().startswith("0x") and most < found <= most - least:
            found += least - most - 1
        if not least <= found <= most and bound:
            return None
        if not least <= found <= most:
            raise refusal(entry, f"its value {text} is outside of {kind.name}")
        return found

    def path(self, entry: EdsEntry, place: int) -> bytes:
        """Octets in hexadecimal, among them the defaults of parameters."""
        text = entry.text(place).strip()
        found, at = bytearray(), 0
        while at < len(text):
            match = _PATH_PART.match(text, at)
            if match is None or (match[2] and self._numbered_in(match[2]) is None):
                raise refusal(entry, f"its path {shown(text)} is not octets alone")
            if match[1]:
                found.append(int(match[1], 16))
            else:
                parameter = self.parameter(int(match[2][5:]))
                found += parameter.encode(parameter.default)
            at = match.end()
            if len(found) > _LONGEST_PATH:
                raise refusal(entry, f"its path {shown(text)} is longer than {_LONGEST_PATH} octets")
        path = _padded(bytes(found))
        if len(path) % 2:
            raise refusal(entry, f"its path {shown(text)} is not whole words")
        return path

    def _numbered_in(self, keyword: str) -> EdsEntry | None:
        """The entry of a parameter by which a path is completed; a parameter's own path has none."""
        number = int(keyword[5:])
        return self.entries.get(number) if number in self._parameters else None


def _padded(path: bytes) -> bytes:
    """A path as messages have it: some files leave out the octet before a value of 16 or 32 bits (packed EPATH)."""
    return path if _relaid(path, 1) is not None else _relaid(path, 0) or path


def _relaid(path: bytes, pad: int) -> bytes | None:
    """Logical segments with so many octets before a long value, padded; None for anything else."""
    found, at = bytearray(), 0
    while at < len(path) and path[at] & 0xE0 == _LOGICAL:
        wide = path[at] & 3
        begin = at + 1 + (pad if wide else 0)
        if any(path[at + 1 : begin]) or begin + (1 << wide) > len(path):
            return None
        found += path[at : at + 1] + bytes(1 if wide else 0) + path[begin : begin + (1 << wide)]
        at = begin + (1 << wide)
    return bytes(found) if at == len(path) else None


def _type_of(code: int, size: int) -> ValueType:
    """Little-endian data of this size; a type that is not known, or has another size than its own, is a number."""
    if _FLOATS.get(code) == size:
        return ValueType("float", size)
    if code in _TEXTS or size > 8:
        return ValueType("octets", size)
    return ValueType("int" if code in _SIGNED else "uint", size)
