"""What happens to a master and its slaves, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from pnfarm.buses.controllers import events as session_events
from pnfarm.buses.controllers.events import ConnectFailed, ConnectionBroken, PhaseChanged, Released
from pnfarm.station.event import Event, event

__all__ = ["ConnectFailed", "Connected", "ConnectionBroken", "DiagnosisRead", "PhaseChanged", "Released"]


@event()
class Connected(session_events.Connected):
    """See :class:`pnfarm.buses.controllers.events.Connected`; ``address`` is the slave's."""

    address: int


@event("diagnosis", "warning")
class DiagnosisRead(Event):
    """A slave in data exchange had a diagnosis; ``status`` names its bits, ``extended`` is in hexadecimal."""

    status: tuple[str, ...]
    extended: str
