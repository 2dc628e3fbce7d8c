"""Shards: the parts of one farm file that run on several machines.

Every shard reads and checks the whole file and expands it, so that names, addresses and seeds are those of the whole
farm; then it takes its part.  The drives are dealt out in the file's order, each to the shard that costs least so far
(:func:`pnfarm.farm.load.costs_of`), the first of those that cost the same.  So the parts differ by one drive's cost at
most, every machine comes to the same result, and a drive at the end of the file moves no other.  The drives on one
serial line go together, where the first of them goes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.config.links import SerialLink, VethLink
from pnfarm.errors import ConfigError
from pnfarm.farm.load import costs_of, line_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.config.device import DeviceConfig
    from pnfarm.config.drive import DriveConfig
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["MOST_SHARDS", "Shard", "parse_shard", "part_of", "units_of"]

MOST_SHARDS = 9_999
_FORM = re.compile(r"([0-9]{1,5})/([0-9]{1,5})", re.ASCII)


@dataclass(frozen=True, slots=True)
class Shard:
    """Part ``index`` of ``count``, from 1."""

    index: int
    count: int

    def __post_init__(self) -> None:
        if not 1 <= self.index <= self.count <= MOST_SHARDS:
            raise ConfigError(f"there is no shard {self}: I/N with I from 1 to N, and N up to {MOST_SHARDS}")

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"

    def as_dict(self) -> dict[str, Any]:
        """For the API."""
        return {"index": self.index, "count": self.count}


def parse_shard(text: str, origin: str = "--shard") -> Shard:
    """``I/N``.  Raises :class:`ConfigError` that names where the text comes from."""
    found = _FORM.fullmatch(text.strip())
    if found is None:
        raise ConfigError(f"{origin}: {text!r} is not a shard: I/N with I from 1 to N, such as 1/3")
    try:
        return Shard(int(found[1]), int(found[2]))
    except ConfigError as exc:
        raise ConfigError(f"{origin}: {exc}") from exc


def units_of(config: FarmConfig, drives: Sequence[DriveConfig | DeviceConfig]) -> list[list[int]]:
    """Places of the drives that stay together, in the order of the first of each."""
    units: list[list[int]] = []
    lines: dict[str, list[int]] = {}
    for place, drive in enumerate(drives):
        line = line_name(config, drive)
        if line in lines:
            lines[line].append(place)
            continue
        units.append([place])
        if line:
            lines[line] = units[-1]
    return units


def part_of(
    config: FarmConfig, drives: Sequence[DriveConfig | DeviceConfig], shard: Shard
) -> list[DriveConfig | DeviceConfig]:
    """The drives of a shard, in the file's order, and then its devices.

    Raises :class:`ConfigError` where the farm cannot be divided so.
    """
    _check_link(config, shard)
    units = units_of(config, drives)
    if shard.count > len(units):
        members = "drives and devices" if config.devices else "drives"
        alone = len(units) == len(drives)
        raise ConfigError(
            f"{shard.count} shards are too many for farm {config.farm or 'farm'}: at most {len(units)}, "
            f"{f'as many as it has {members}' if alone else 'as its drives on a line stay together'}"
        )
    costs = costs_of(config, drives)
    dealt = [0] * shard.count
    mine: list[int] = []
    for unit in units:
        least = dealt.index(min(dealt))
        dealt[least] += sum(costs[place] for place in unit)
        if least == shard.index - 1:
            mine += unit
    return [drives[place] for place in sorted(mine)]


def _check_link(config: FarmConfig, shard: Shard) -> None:
    if shard.count == 1:
        return
    if config.plant is not None:
        raise ConfigError("a farm with a plant cannot be divided into shards: its wires join all stations")
    match config.link:
        case VethLink(bridge=None):
            raise ConfigError(
                "shards of a farm share a wire, and a veth link without `bridge` makes one for itself: name a bridge, "
                "such as `link: {kind: veth, bridge: br0}`"
            )
        case SerialLink():
            raise ConfigError("the drives of a farm on one serial line cannot be divided into shards")
        case _:
            return
