"""What happens to injections, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.station.events import Event

__all__ = ["InjectionBegan", "InjectionEnded"]


@dataclass(frozen=True, slots=True)
class InjectionBegan(Event):
    """An injection took effect on a drive."""

    TEXT = "fault injected"
    LEVEL = "warning"
    id: str
    kind: str


@dataclass(frozen=True, slots=True)
class InjectionEnded(Event):
    """An injection ended on a drive, with its evidence.

    ``reason``: ``count``, ``time``, ``cleared``, ``ttl``, or why it failed; ``why`` it was not confirmed.
    """

    TEXT = "injected fault ended"
    id: str
    kind: str
    reason: str
    checks: int
    activations: int
    confirmed: bool
    confirmation: str
    why: str
