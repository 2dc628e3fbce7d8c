"""What happens to the scanner and its devices, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from pnfarm.buses.controllers import events as session_events
from pnfarm.buses.controllers.events import ConnectionBroken, PhaseChanged, Released
from pnfarm.station.event import Event, event, shown

__all__ = [
    "ConnectFailed", "Connected", "ConnectionBroken", "IdentityDiffers", "IdentityUnread", "OldConnectionClosed",
    "PhaseChanged", "Released", "SessionLost", "SessionResumed",
]  # fmt: skip


@event()
class Connected(session_events.Connected):
    """The cyclic connection is open; ``group`` to which the device sends, empty for none."""

    mac: bytes
    kind: str = shown(name="connection")
    group: str = shown(always=False)


@event()
class ConnectFailed(session_events.ConnectFailed):
    """``status``: general and extended status of a refused Forward_Open."""

    status: tuple[int, ...] = shown(always=False, default=())


@event("session lost", "warning")
class SessionLost(Event):
    """The TCP connection ended while cyclic data go on."""

    reason: str


@event("session resumed")
class SessionResumed(Event):
    """There is a session again beside the cyclic data."""


@event("old connection closed")
class OldConnectionClosed(Event):
    """A connection of the scanner's own, which the device still had, was in the way and is closed."""


@event("identity unread", "warning")
class IdentityUnread(Event):
    """A device's identity could not be read."""

    detail: str


@event("identity differs", "warning")
class IdentityDiffers(Event):
    """A device's identity is not as planned; its electronic key decides whether it can be connected."""

    what: str
    found: str
    planned: str
