"""Where the plain data of a station's submodules are in its rows: one after the other, a status for each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.signals.signal import Direction

__all__ = ["PlainLayout", "PlainPlace", "plain_layout", "signal_places"]


@dataclass(frozen=True, slots=True)
class PlainPlace:
    """Where the plain data of a submodule are in the station's row, and the place of their status."""

    place: int
    length: int
    status: int


@dataclass(frozen=True, slots=True)
class PlainLayout:
    """One direction: the places by slot and subslot, in the order of the statuses; ``octets`` of data."""

    places: Mapping[tuple[int, int], PlainPlace]
    octets: int


def signal_places(inputs: PlainLayout, outputs: PlainLayout) -> dict[tuple[int, int, Direction], int]:
    """The first octet of each submodule's data, in the order of their statuses."""
    ways: tuple[tuple[Direction, PlainLayout], ...] = (("input", inputs), ("output", outputs))
    return {(*key, way): place.place for way, layout in ways for key, place in layout.places.items()}


def plain_layout(lengths: Iterable[tuple[int, int, int]]) -> PlainLayout:
    """Of submodules (slot, subslot, octets); those without data have no place."""
    with_data = [(slot, subslot, octets) for slot, subslot, octets in lengths if octets]
    total = sum(octets for _, _, octets in with_data)
    places: dict[tuple[int, int], PlainPlace] = {}
    place = 0
    for number, (slot, subslot, octets) in enumerate(with_data):
        places[slot, subslot] = PlainPlace(place, octets, total + number)
        place += octets
    return PlainLayout(places, total)
