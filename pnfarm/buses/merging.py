"""What two sources say of one plant, joined station by station: a project and a capture, or two projects.

Stations are the same by name, else by MAC address, by IP address, by their address on a line.  The first source counts
where both say something; the second adds what the first has not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import FoundDevice, FoundDrive, FoundStation, drives_first

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence

    from pnfarm.buses.imports import Found

__all__ = ["Source", "merged"]

#: Differences of one station that a user reads.
_MOST = 24
#: Keys that say which station it is, in words.
_ADDRESSES = {"ip": "IP address", "gateway": "router", "mac": "MAC address", "address": "station address"}
_COMPARED = {**_ADDRESSES, "rpi": "packet interval"}
#: Keys whose values do not depend on the model or file that plays a station.
_OF_DRIVES = frozenset({"identity", "rpi"})
_OWN_IDENTITY = frozenset({"identity", "gsdml"})
_OF_DEVICES = frozenset({"cycle", "cycles", "rpi"})


@dataclass(frozen=True, slots=True)
class Source:
    """``name`` is that of its file or files."""

    name: str
    found: Sequence[Found]


def merged(first: Source, second: Source) -> tuple[list[Found], list[str]]:
    """The stations of both, and a sentence for each thing in which they differ."""
    pairs, remarks = _pairs(first, second)
    found: list[Found] = []
    for number, one in enumerate(first.found):
        if number in pairs:
            joined, differing = _joined(one, second.found[pairs[number]], first.name, second.name)
            found.append(joined)
            remarks += [f"{joined.name}: {sentence}" for sentence in differing]
        else:
            found.append(replace(one, facts=(*one.facts, f"{second.name} does not show it")))
    joined_others = set(pairs.values())
    for number, other in enumerate(second.found):
        if number not in joined_others:
            found.append(replace(other, facts=(*other.facts, f"{first.name} does not have it")))
    return list(drives_first(found)), remarks


# -- which is which ----------------------------------------------------------------------------------------------------


def _name(one: Found) -> Hashable:
    return one.said.name.lower() or None


def _mac(one: Found) -> Hashable:
    return one.keys.get("mac")


def _ip(one: Found) -> Hashable:
    return one.keys.get("ip", "").partition("/")[0] or None


def _on_line(one: Found) -> Hashable:
    return (one.line, one.keys["address"]) if "address" in one.keys else None


_WAYS: tuple[tuple[str, Callable[[Found], Hashable]], ...] = (
    ("name", _name),
    ("MAC address", _mac),
    ("IP address", _ip),
    ("station address", _on_line),
)


def _pairs(first: Source, second: Source) -> tuple[dict[int, int], list[str]]:
    """The number of a station in ``second`` by its number in ``first``; what several stations have joins none."""
    pairs: dict[int, int] = {}
    remarks: list[str] = []
    ones, others = dict(enumerate(first.found)), dict(enumerate(second.found))
    for what, way in _WAYS:
        by_key = _by_key(others, way)
        for key, numbers in _by_key(ones, way).items():
            same = by_key.get(key, [])
            if len(numbers) == len(same) == 1:
                pairs[numbers[0]] = same[0]
                del ones[numbers[0]], others[same[0]]
            elif same:
                of = " ".join(first.found[number].name for number in numbers)
                remarks.append(f"{of}: several stations have this {what}, so that it joins none of them")
    return pairs, remarks


def _by_key(stations: Mapping[int, Found], way: Callable[[Found], Hashable]) -> dict[Hashable, list[int]]:
    found: dict[Hashable, list[int]] = {}
    for number, one in stations.items():
        if (key := way(one)) is not None:
            found.setdefault(key, []).append(number)
    return found


# -- one station -------------------------------------------------------------------------------------------------------


def _joined(one: Found, other: Found, first: str, second: str) -> tuple[Found, list[str]]:
    """``one`` with what ``other`` adds, and what they say differently."""
    played = other if isinstance(one, FoundStation) and not isinstance(other, FoundStation) else one
    differing = [
        f"{what}: {first} says {own}, {second} says {its}; {own if counts else its} is used"
        for what, own, its, counts in _differences(one, other, is_played=played is one)
    ]
    if len(differing) > _MOST:
        differing[_MOST:] = [f"and {len(differing) - _MOST} more differences"]
    keys = {**played.keys, **{key: one.keys[key] for key in _COMPARED if key in one.keys}}
    notes: list[str] = []
    if played is one:
        _add(keys, one, other, notes, second)
    facts = tuple(dict.fromkeys((*one.facts, *other.facts)))
    said = replace(
        one.said,
        name=one.said.name or other.said.name,
        identity={**other.said.identity, **one.said.identity},
        subjects={**other.said.subjects, **one.said.subjects},
        slots={**other.said.slots, **one.said.slots},
    )
    if isinstance(played, FoundStation):
        missing = played.missing or (other.missing if isinstance(other, FoundStation) else "")
        return replace(played, facts=(*differing, *facts), missing=missing, keys=keys, said=said), differing
    if isinstance(one, FoundStation) and one.missing:
        notes.append(f"with {one.missing}, it would be as in {first}")
    name = one.name if one.said.name else other.name if other.said.name else one.name
    return replace(
        played, name=name, keys=keys, notes=(*differing, *played.notes, *notes), facts=facts, said=said
    ), differing


def _differences(one: Found, other: Found, *, is_played: bool) -> Iterator[tuple[str, str, str, bool]]:
    """What differs, in the words of each; whether those of ``one`` count."""
    if one.said.name and other.said.name and _name(one) != _name(other):
        yield "name", one.said.name, other.said.name, True
    for key, what in _COMPARED.items():
        # the length of a prefix is often assumed
        own, its = (str(station.keys.get(key, "")).partition("/")[0] for station in (one, other))
        if own and its and own != its:
            yield what, own, its, True
    if isinstance(one, FoundDrive) and isinstance(other, FoundDrive) and one.model != other.model:
        yield "model", one.model, other.model, True
    # a drive has the identity of the second where the first has none, or less of it
    identity_stays = not isinstance(one, FoundDrive) or ("identity" not in other.keys and _OWN_IDENTITY & {*one.keys})
    for own_words, its_words, counts in (
        (one.said.identity, other.said.identity, is_played and bool(identity_stays)),
        (one.said.subjects, other.said.subjects, is_played),
    ):
        for what, own in own_words.items():
            if (its := its_words.get(what, own)) != own:
                yield what, own, its, counts
    if one.said.slots and other.said.slots:
        for slot in sorted({*one.said.slots, *other.said.slots}):
            own, its = (station.said.slots.get(slot, "nothing") for station in (one, other))
            # what only the second has is added
            if own not in {its, "nothing"}:
                yield f"slot {slot}", own, its, is_played


def _add(keys: dict[str, Any], one: Found, other: Found, notes: list[str], second: str) -> None:
    """What ``one`` leaves open and does not depend on what plays it."""
    if "ip" not in keys or _ip(one) == _ip(other):
        keys |= {key: other.keys[key] for key in ("ip", "gateway") if key in other.keys and key not in keys}
    wanted = {"mac", "address"} | (_OF_DRIVES if isinstance(one, FoundDrive) else _OF_DEVICES)
    keys |= {key: value for key, value in other.keys.items() if key in wanted and key not in keys}
    if isinstance(one, FoundDrive) and "identity" in keys and "identity" in other.keys:
        keys["identity"] = {**other.keys["identity"], **keys["identity"]}
    if other.keys.get("limits") == "lax" and "limits" not in keys and not isinstance(one, FoundStation):
        keys["limits"] = "lax"
        notes.append(f"limits are lax: {second} shows what strict ones refuse")
    if isinstance(one, FoundDevice) and isinstance(other, FoundDevice) and one.file.key == other.file.key:
        own, its = one.keys.get("slots", {}), other.keys.get("slots", {})
        more = {slot: its[slot] for slot in other.said.slots if slot in its and slot not in {*own, *one.said.slots}}
        if more and one.said.slots:
            keys["slots"] = dict(sorted({**own, **more}.items()))
            notes.append(f"only {second} has slot {', '.join(map(str, more))}")
