"""Where a farm file says what a station is: for views that name the line to change."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.config.device import DeviceConfig

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pnfarm.config.drive import DriveConfig
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.vocabulary.issues import Location

__all__ = ["NO_FILE", "FilePlaces", "places_of"]


def _nowhere(location: Location) -> tuple[str, int, int]:
    del location
    return "", 0, 0


@dataclass(frozen=True, slots=True)
class FilePlaces:
    """``place``: file, line and column of a key, or of the nearest key above it, 0 where it is in none.

    ``groups``: the path of the group of every station of the file, also of those that another shard runs, by name.
    """

    place: Callable[[Location], tuple[str, int, int]] = _nowhere
    groups: Mapping[str, Location] = field(default_factory=dict)


#: Of stations that are not from a file.
NO_FILE = FilePlaces()


def places_of(config: FarmConfig, stations: Iterable[DriveConfig | DeviceConfig]) -> FilePlaces:
    """Of a file and all stations in it."""
    groups: dict[str, Location] = {
        one.name: ("devices" if isinstance(one, DeviceConfig) else "drives", one.group) for one in stations
    }
    return FilePlaces(config.place, groups)
