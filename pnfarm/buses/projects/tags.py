"""Tags of a PLC, and the signals of devices that they name by their addresses.

A tag's name is kept where a signal can have it.  Otherwise umlauts become two letters, other accents go, each other
character becomes an underscore, and what begins with a digit gets one in front; of two that are alike then, the second
gets ``_2``.  Two tags at one address are two names of one value.  A tag of a type that is no number (a structure, a
PLC data type) is left out: the export does not say what is in it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.signals.naming import plain_letters
from pnfarm.wire.value_types import BOOL, ValueType

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Sequence

    from pnfarm.buses.projects.caex import CaexElement
    from pnfarm.signals.signal import Direction

__all__ = ["DataPlace", "IoRange", "Tag", "signal_name", "signals_of", "tags_of"]

#: I and Q of the international mnemonics, E and A of the German ones.
_ADDRESS = re.compile(r"%?(?P<area>[IQEA])(?P<size>[XBWDL]?)(?P<octet>[0-9]{1,5})(?:\.(?P<bit>[0-7]))?", re.IGNORECASE)
_DIRECTIONS: dict[str, Direction] = {"I": "input", "E": "input", "Q": "output", "A": "output"}
_OF_SIZE = {"": 1, "X": 1, "B": 1, "W": 2, "D": 4, "L": 8}
#: Elementary types of IEC 61131-3, and times as the numbers that they are.
_TYPES = {
    **{name: ValueType("uint", octets) for octets, names in {
        1: "byte usint char", 2: "word uint date", 4: "dword udint tod time_of_day", 8: "lword ulint ldt ltod",
    }.items() for name in names.split()},
    **{name: ValueType("int", octets) for octets, names in {
        1: "sint", 2: "int", 4: "dint time", 8: "lint ltime",
    }.items() for name in names.split()},
    "real": ValueType("float", 4),
    "lreal": ValueType("float", 8),
}  # fmt: skip
_FITS = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,79}")
_OTHER = re.compile(r"[^A-Za-z0-9]+")
_LONGEST = 70


@dataclass(frozen=True, slots=True)
class IoRange:
    """Octets of a part in the PLC's memory."""

    direction: Direction
    start: int
    octets: int


@dataclass(frozen=True, slots=True)
class DataPlace:
    """Where such octets are in a device, from ``octet`` of a submodule's data of that direction.

    ``has_inputs``: the submodule has, whichever direction this one is.
    """

    range: IoRange
    slot: int
    subslot: int
    has_inputs: bool
    octet: int = 0


@dataclass(frozen=True, slots=True)
class Tag:
    """A tag with an address of inputs or outputs; ``type`` None where it is no number."""

    name: str
    type: ValueType | None
    direction: Direction
    octet: int
    bit: int | None


def tags_of(owner: CaexElement) -> tuple[Tag, ...]:
    """Those of the tables in ``owner``, a PLC."""
    found = []
    for one in owner.walk():
        for tag in one.interfaces:
            if not tag.has_role("Tag"):
                continue
            at = _ADDRESS.fullmatch(tag.attributes.get("LogicalAddress", "").strip())
            if at is None:
                continue
            bit = None if at["bit"] is None else int(at["bit"])
            kind = tag.attributes.get("DataType", "").strip().strip('"').lower()
            value = BOOL if bit is not None else _TYPES.get(kind)
            if value is not None and bit is None and value.octets != _OF_SIZE[at["size"].upper()]:
                value = None
            found.append(Tag(tag.name, value, _DIRECTIONS[at["area"].upper()], int(at["octet"]), bit))
    return tuple(found)


def signals_of(tags: Sequence[Tag], places: Iterable[DataPlace]) -> tuple[dict[str, Any], list[str]]:
    """The key ``signals`` of a device with these data, and what is to be said of it."""
    signals: dict[str, Any] = {}
    notes: list[str] = []
    for place in places:
        begin, end = place.range.start, place.range.start + place.range.octets
        for tag in tags:
            if tag.direction != place.range.direction or not begin <= tag.octet < end:
                continue
            if tag.type is None or tag.octet + tag.type.octets > end:
                why = "its type is no number" if tag.type is None else "it is longer than the module's data"
                notes.append(f"no signal for the tag {tag.name!r}: {why}")
                continue
            name = signal_name(tag.name, signals)
            if name != tag.name:
                notes.append(f"the signal {name} is the tag {tag.name!r}")
            at = f"{place.slot}.{place.subslot}.{place.octet + tag.octet - begin}"
            setting: dict[str, Any] = {"at": at if tag.bit is None else f"{at}.{tag.bit}"}
            if tag.bit is None:
                setting["type"] = tag.type.name
            if tag.direction == "output" and place.has_inputs:
                setting["direction"] = "output"
            signals[name] = setting if len(setting) > 1 else setting["at"]
    return signals, notes


def signal_name(text: str, taken: Container[str]) -> str:
    """The name of the signal for a tag, which no other one has."""
    own = text
    if _FITS.fullmatch(text) is None:
        own = _OTHER.sub("_", plain_letters(text)).strip("_")[:_LONGEST] or "tag"
        own = f"_{own}" if own[0].isdigit() else own
    first, number = own[:_LONGEST], 2
    while own in taken:
        own, number = f"{first}_{number}", number + 1
    return own
