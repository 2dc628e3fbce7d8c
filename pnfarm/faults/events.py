"""What happens to injections, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.station.events import Event

__all__ = ["InjectionBegan", "InjectionEnded"]


@dataclass(frozen=True, slots=True)
class InjectionBegan(Event):
    """An injection came in force on a drive."""

    TEXT = "fault injected"
    LEVEL = "warning"
    id: str
    kind: str


@dataclass(frozen=True, slots=True)
class InjectionEnded(Event):
    """An injection is over on a drive, and what was counted of it.

    ``reason``: ``count``, ``time``, ``cleared``, or why it failed.
    """

    TEXT = "injected fault ended"
    id: str
    kind: str
    reason: str
    checks: int
    activations: int
    confirmed: bool
