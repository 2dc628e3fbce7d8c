"""What happens to injections, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from pnfarm.station.event import Event, event

__all__ = ["InjectionBegan", "InjectionEnded"]


@event("fault injected", "warning")
class InjectionBegan(Event):
    """An injection took effect on a drive."""

    id: str
    kind: str


@event("injected fault ended")
class InjectionEnded(Event):
    """An injection ended on a drive, with its evidence.

    ``reason``: ``count``, ``time``, ``cleared``, ``ttl``, or why it failed; ``why`` it was not confirmed.
    """

    id: str
    kind: str
    reason: str
    checks: int
    activations: int
    confirmed: bool
    confirmation: str
    why: str
