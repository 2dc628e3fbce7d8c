"""How a maker writes the numbers of parameters: a prefix, then decimal or hexadecimal digits that count from a PNU."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.drives.description.sections import Section

__all__ = ["HIGHEST_PNU", "Numbering", "read_number", "read_numbering"]

HIGHEST_PNU = 0xFFFF
_DECIMAL = re.compile(r"[0-9]{1,20}")
_HEXADECIMAL = re.compile(r"0[xX]([0-9a-fA-F]{1,8})|([0-9][0-9a-fA-F]{0,7})[hH]")


def read_number(text: str) -> int | None:
    """A number as manuals print it: ``8448``, ``0x2100`` or ``2100h``; None for anything else."""
    if _DECIMAL.fullmatch(text):
        return int(text)
    match = _HEXADECIMAL.fullmatch(text)
    return int(match[1] or match[2], 16) if match else None


@dataclass(frozen=True, slots=True)
class Numbering:
    """PNU ``base`` + n is written as ``prefix`` and n, with leading zeros up to ``digits``.

    ``radix`` is 10 or 16, ``highest`` the largest n.  Without a prefix the maker writes the PNU itself.
    """

    prefix: str = ""
    base: int = 0
    radix: int = 10
    digits: int = 4
    highest: int = HIGHEST_PNU

    def name(self, pnu: int) -> str:
        """The maker's number of a PNU; empty for a PNU without one."""
        number = pnu - self.base
        if not self.prefix or not 0 <= number <= self.highest:
            return ""
        return f"{self.prefix}{number:0{self.digits}{'X' if self.radix == 16 else 'd'}}"

    def names(self, pnu: int) -> tuple[str, ...]:
        """:meth:`name`, and the same without zeros in front; empty for a PNU without a number of the maker's."""
        name = self.name(pnu)
        digits = name[len(self.prefix) :].lstrip("0") or "0"
        return (name, self.prefix + digits) if name else ()

    def number(self, text: str) -> int | None:
        """The PNU that the maker writes like this, in any case and with or without zeros in front; else None."""
        if not self.prefix or text[: len(self.prefix)].lower() != self.prefix.lower():
            return None
        digits = text[len(self.prefix) :]
        allowed = r"[0-9a-fA-F]{1,4}" if self.radix == 16 else r"[0-9]{1,5}"
        if not re.fullmatch(allowed, digits) or (number := int(digits, self.radix)) > self.highest:
            return None
        return self.base + number


def read_numbering(section: Section) -> Numbering:
    """The section ``numbering``: the product gives the maker's notation, the bus the first PNU.

    Raises :class:`ConfigError`.
    """
    numbering: Numbering = section.build(Numbering)
    if not isinstance(numbering.prefix, str):
        raise section.wrong("prefix", f"{numbering.prefix!r} is not text")
    for key in ("base", "radix", "digits", "highest"):
        value = getattr(numbering, key)
        if type(value) is not int or not 0 <= value <= HIGHEST_PNU:
            raise section.wrong(key, f"{value!r} is not a number from 0 to {HIGHEST_PNU}")
    if numbering.radix not in {10, 16}:
        raise section.wrong("radix", f"{numbering.radix} is neither 10 nor 16")
    if numbering.base + numbering.highest > HIGHEST_PNU:
        raise section.wrong("highest", f"base + highest is {numbering.base + numbering.highest}, above {HIGHEST_PNU}")
    return numbering
