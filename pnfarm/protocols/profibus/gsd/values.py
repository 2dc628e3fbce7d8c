"""Parameters of Set_Prm as a GSD file describes them: constants, and named values within octets.

A value is an ``ExtUserPrmData`` block: type, default, what is allowed, texts for numbers.  Numbers of several octets
have the highest one first (GSD specification 5.1, Ext_User_Prm_Data_Ref).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from pnfarm.errors import ConfigError
from pnfarm.protocols.profibus.gsd.statements import gsd_number
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["MOST_USER", "PlugError", "UserParameters", "UserValue", "listed"]

#: Octets of Set_Prm after the seven of the standard.
MOST_USER: Final = 237


#: Names that a message lists.
_LISTED: Final = 12


def listed(names: Sequence[str]) -> str:
    """The first of them, and whether there are more."""
    return ", ".join(names[:_LISTED]) + (" and others" if len(names) > _LISTED else "")


class PlugError(ConfigError):
    """A choice that the file does not allow; ``slot`` says where, None where it is not about one.

    ``parameter``: it is about a parameter of what is there.
    """

    def __init__(self, message: str, *, slot: int | None = None, parameter: bool = False) -> None:
        super().__init__(message)
        self.slot = slot
        self.parameter = parameter


@dataclass(frozen=True, slots=True)
class UserValue:
    """``octets`` of a number; ``low`` and ``width`` in bits where it is a part of one octet, else None and 0.

    ``allowed``: ranges (lowest, highest), none for any; ``texts``: numbers that have one.
    """

    name: str
    octets: int
    default: int
    signed: bool = False
    low: int | None = None
    width: int = 0
    allowed: tuple[tuple[int, int], ...] = ()
    texts: Mapping[int, str] = field(default_factory=dict)

    def _bits(self) -> tuple[int, int]:
        """How far the number is shifted in its octets, and its mask."""
        return (0, (1 << 8 * self.octets) - 1) if self.low is None else (self.low, (1 << self.width) - 1)

    def put(self, data: bytearray, place: int, value: int) -> None:
        """Write it to octets that begin at ``place``, which are there."""
        shift, mask = self._bits()
        whole = int.from_bytes(data[place : place + self.octets], "big") & ~(mask << shift)
        data[place : place + self.octets] = (whole | (value & mask) << shift).to_bytes(self.octets, "big")

    def get(self, data: bytes, place: int) -> int:
        """The number in these octets."""
        shift, mask = self._bits()
        value = int.from_bytes(data[place : place + self.octets], "big") >> shift & mask
        return value - mask - 1 if self.signed and value > mask >> 1 else value

    def allows(self, value: int) -> bool:
        """Whether the file allows a number; one without ranges, any that the octets hold."""
        _, mask = self._bits()
        lowest, highest = (-(mask >> 1) - 1, mask >> 1) if self.signed else (0, mask)
        ranges = self.allowed or ((lowest, highest),)
        return lowest <= value <= highest and any(first <= value <= last for first, last in ranges)

    @property
    def choices(self) -> str:
        """What is allowed, for people."""
        if self.texts:
            return listed([text for number, text in self.texts.items() if self.allows(number)])
        ranges = [f"{first}" if first == last else f"{first} to {last}" for first, last in self.allowed]
        return listed(ranges) or f"any number of {self.width or 8 * self.octets} bits"

    def read(self, given: str | float) -> int:
        """A user's number or text; raises :class:`PlugError`."""
        word = str(given).strip()
        found = next((one for one, text in self.texts.items() if text.strip().casefold() == word.casefold()), None)
        if found is None:
            found = int(given) if isinstance(given, bool) else gsd_number(word)
        if found is None or not self.allows(found):
            raise PlugError(f"{self.name}: {word!r} is given, the file allows {self.choices}")
        return found


@dataclass(frozen=True, slots=True)
class UserParameters:
    """``constants``: octets at places; ``values``: what may be changed, with the places of their first octets.

    ``length`` of all, None: as far as these go.
    """

    constants: tuple[tuple[int, bytes], ...] = ()
    values: tuple[tuple[int, UserValue], ...] = ()
    length: int | None = None

    @property
    def octets(self) -> int:
        """How many there are."""
        if self.length is not None:
            return self.length
        ends = [place + len(data) for place, data in self.constants]
        return max([*ends, *(place + value.octets for place, value in self.values)], default=0)

    def _inside(self) -> list[tuple[int, UserValue]]:
        return [(place, value) for place, value in self.values if place + value.octets <= self.octets]

    def defaults(self) -> bytes:
        """Constants, and the defaults over them."""
        data = bytearray(self.octets)
        for place, octets in self.constants:
            data[place : place + len(octets)] = octets[: max(0, len(data) - place)]
        for place, value in self._inside():
            value.put(data, place, value.default)
        return bytes(data)

    def changed(self, given: Mapping[str, str | float]) -> bytes:
        """:meth:`defaults` with values by the file's names, in upper or lower case.

        Where several have a name, the place of one is put before it, octet and bit as far as needed: ``3/Filter``,
        ``3.1/Filter``.  Raises :class:`PlugError`.
        """
        data = bytearray(self.defaults())
        for key, wanted in given.items():
            place, value = self._find(key)
            value.put(data, place, value.read(wanted))
        return bytes(data)

    def _find(self, key: str) -> tuple[int, UserValue]:
        known = self._inside()
        before, slash, behind = key.partition("/")
        word = key.strip().casefold()
        found = [one for one in known if one[1].name.casefold() == word]
        if slash and not found:
            found = [
                (place, value)
                for place, value in known
                if value.name.casefold() == behind.strip().casefold()
                and before.strip() in {str(place), f"{place}.{value.low or 0}"}
            ]
        if not found:
            names = list(dict.fromkeys(value.name for _, value in known))
            raise PlugError(
                f"there is no parameter {key!r}, the file has {listed(names) or 'none'}"
                + did_you_mean(behind.strip() if slash else key, names)
            )
        if len(found) > 1:
            choices = [f"{place}.{value.low or 0}/{value.name}" for place, value in found]
            raise PlugError(f"there are {len(found)} parameters {key!r}, choose one by octet and bit: "
                            f"{listed(choices)}")  # fmt: skip
        return found[0]

    def complaint(self, data: bytes) -> str | None:
        """The first value in so many octets that the file does not allow."""
        for place, value in self._inside():
            number = value.get(data, place)
            if not value.allows(number):
                return f"{value.name} is {number}, the file allows {value.choices}"
        return None
