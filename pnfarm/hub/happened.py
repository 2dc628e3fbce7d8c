"""What happens to the shards, as entries of the hub's log."""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.station.events import Event

__all__ = ["DrivesClaimedTwice", "ShardForgotten", "ShardLost", "ShardReturned"]


@dataclass(frozen=True, slots=True)
class ShardReturned(Event):
    """A shard answers, for the first time or again."""

    TEXT = "shard answers"
    shard: str
    farm: str
    drives: int


@dataclass(frozen=True, slots=True)
class ShardLost(Event):
    """A shard does not answer any more."""

    TEXT = "shard unreachable"
    LEVEL = "warning"
    shard: str
    reason: str
    drives: int


@dataclass(frozen=True, slots=True)
class ShardForgotten(Event):
    """A shard that left DNS is not shown any more."""

    TEXT = "shard forgotten"
    shard: str


@dataclass(frozen=True, slots=True)
class DrivesClaimedTwice(Event):
    """Two shards claim the same drives; requests for these are refused."""

    TEXT = "drives claimed twice"
    LEVEL = "error"
    drives: str
    shards: str
