"""What happens to traces, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from pnfarm.station.event import Event, event

__all__ = ["TraceEnded", "TraceTriggered"]


@event("trace triggered")
class TraceTriggered(Event):
    """A trace's trigger fired; ``by`` is the drive whose signal or event it was, empty for none."""

    id: str
    by: str


@event("trace complete")
class TraceEnded(Event):
    """A trace is complete."""

    id: str
    samples: int
