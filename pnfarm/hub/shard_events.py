"""What happens to the shards, as entries of the hub's log."""

from __future__ import annotations

from pnfarm.station.event import Event, event

__all__ = ["DrivesClaimedTwice", "ShardForgotten", "ShardLost", "ShardReturned"]


@event("shard answers")
class ShardReturned(Event):
    """A shard answers, for the first time or again."""

    shard: str
    farm: str
    drives: int


@event("shard unreachable", "warning")
class ShardLost(Event):
    """A shard does not answer any more."""

    shard: str
    reason: str
    drives: int


@event("shard forgotten")
class ShardForgotten(Event):
    """A shard that left DNS is not shown any more."""

    shard: str


@event("drives claimed twice", "error")
class DrivesClaimedTwice(Event):
    """Two shards claim the same drives; requests for these are refused."""

    drives: str
    shards: str
