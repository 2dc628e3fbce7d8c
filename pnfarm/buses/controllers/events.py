"""What happens to a controller and its stations on any bus, as types (:mod:`pnfarm.station.event`)."""

from __future__ import annotations

from pnfarm.buses.controllers.axis_program import PHASES
from pnfarm.station.event import Event, event, shown, unshown

__all__ = ["ConnectFailed", "Connected", "ConnectionBroken", "PhaseChanged", "Released"]


@event("connected")
class Connected(Event):
    """A station exchanges data, so long after the controller first looked for it."""

    after_ns: int = shown(name="connect_seconds")


@event("connect failed", "warning")
class ConnectFailed(Event):
    """A station does not answer, or refused what the controller wants."""

    reason: str


@event("connection lost", "warning")
class ConnectionBroken(Event):
    """An established connection ended without a release."""

    reason: str


@event("released")
class Released(Event):
    """The controller ended a connection in order."""


@event()
class PhaseChanged(Event):
    """An axis program goes on: numbers of :mod:`pnfarm.table.program`."""

    before: int = shown(PHASES.__getitem__)
    after: int = unshown()

    @property
    def text(self) -> str:
        return f"axis {PHASES[self.after]}"
