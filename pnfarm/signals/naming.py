"""Names of signals made from a description file's texts.

The rule: ``slot3_pressure``, the slot and the text of the datum or bit as an identifier (small letters, digits and
underscores; umlauts as two letters, other accents dropped; ``data`` where no such character is left).  A name depends
on its own slot alone, so another module elsewhere changes nothing.  Texts of one slot that are alike get the subslot
(``slot3_2_pressure``), or the direction (``slot3_pressure_in``), or both, or as well octet and bit
(``slot3_2_pressure_in_0_5``): the first of these that makes them differ.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.signals.signal import Direction

__all__ = ["Datum", "identifier", "plain_letters", "signal_names"]

_TWO_LETTERS = {"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "æ": "ae", "ø": "oe", "å": "aa", "µ": "u"}
_UMLAUTS = str.maketrans(
    _TWO_LETTERS | {one.upper(): two.capitalize() for one, two in _TWO_LETTERS.items() if one not in "ßµ"}
)
_OTHER = re.compile(r"[^a-z0-9]+")
#: Letters of the text's part of a name.
_LONGEST = 40
#: What of the place a name has, from the least: subslot, direction, octet and bit.
_FORMS = ((False, False, False), (True, False, False), (False, True, False), (True, True, False), (True, True, True))


@dataclass(frozen=True, slots=True)
class Datum:
    """A text of the file, and its place; ``bit`` None where it has whole octets."""

    text: str
    direction: Direction
    slot: int
    subslot: int
    octet: int
    bit: int | None = None


def plain_letters(text: str) -> str:
    """Umlauts as two letters, without other accents, and without what is not ASCII then."""
    return unicodedata.normalize("NFKD", text.translate(_UMLAUTS)).encode("ascii", "ignore").decode()


def identifier(text: str) -> str:
    """``Druck (Öl), 2`` as ``druck_oel_2``."""
    return _OTHER.sub("_", plain_letters(text.lower())).strip("_")[:_LONGEST].strip("_") or "data"


def _name(datum: Datum, word: str, form: int) -> str:
    subslot, direction, place = _FORMS[form]
    name = f"slot{datum.slot}_{datum.subslot}_{word}" if subslot else f"slot{datum.slot}_{word}"
    if direction:
        name += "_in" if datum.direction == "input" else "_out"
    if place:
        name += f"_{datum.octet}" if datum.bit is None else f"_{datum.octet}_{datum.bit}"
    return name


def signal_names(data: Sequence[Datum]) -> list[str]:
    """A name for each datum, all different; the data have places of their own."""
    words = [identifier(datum.text) for datum in data]
    alike: dict[tuple[int, str], list[int]] = {}
    for index, (datum, word) in enumerate(zip(data, words, strict=True)):
        alike.setdefault((datum.slot, word), []).append(index)
    names = [""] * len(data)
    for (_, word), indexes in alike.items():
        for form in range(len(_FORMS)):
            found = [_name(data[index], word, form) for index in indexes]
            if len(set(found)) == len(found):
                break
        for index, name in zip(indexes, found, strict=True):
            names[index] = name
    # a text may look like another one's longer name
    while True:
        counts = Counter(names)
        longer = {index: _name(data[index], words[index], -1) for index, name in enumerate(names) if counts[name] > 1}
        longer = {index: name for index, name in longer.items() if names[index] != name}
        if not longer:
            return names
        for index, name in longer.items():
            names[index] = name
