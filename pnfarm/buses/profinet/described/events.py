"""Event types of a described device (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from pnfarm.station.event import BY_PEER, Event, event

__all__ = ["RecordDoubted", "RecordRefused"]


@event(pace=BY_PEER)
class _RecordJudged(Event):
    """Base of events about a written record that the device's file does not allow."""

    slot: int
    subslot: int
    index: int
    reason: str


@event("record refused", "warning")
class RecordRefused(_RecordJudged):
    """A written record does not fit what the device's file says of it."""


@event("record accepted though it is wrong", "warning")
class RecordDoubted(_RecordJudged):
    """The same, on a device with lax limits: it is kept."""
