"""What happens to traces, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.station.events import Event

__all__ = ["TraceEnded", "TraceTriggered"]


@dataclass(frozen=True, slots=True)
class TraceTriggered(Event):
    """A trace's trigger fired; ``by`` is the drive whose signal or event it was, empty for none."""

    TEXT = "trace triggered"
    id: str
    by: str


@dataclass(frozen=True, slots=True)
class TraceEnded(Event):
    """A trace is complete."""

    TEXT = "trace complete"
    id: str
    samples: int
