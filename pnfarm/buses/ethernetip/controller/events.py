"""What happens to the scanner and its devices, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pnfarm.buses.axis_program import PHASES
from pnfarm.station.events import Event, seconds

__all__ = [
    "ConnectFailed",
    "Connected",
    "ConnectionBroken",
    "IdentityDiffers",
    "IdentityUnread",
    "OldConnectionClosed",
    "PhaseChanged",
    "Released",
    "SessionLost",
    "SessionResumed",
]


@dataclass(frozen=True, slots=True)
class Connected(Event):
    """The cyclic connection to a device is open, so long after the first attempt."""

    TEXT = "connected"
    after_ns: int
    mac: bytes
    kind: str
    group: str

    def details(self) -> dict[str, Any]:
        details = {"connect_seconds": seconds(self.after_ns), "mac": self.mac.hex(":"), "connection": self.kind}
        return details | ({"group": self.group} if self.group else {})


@dataclass(frozen=True, slots=True)
class ConnectFailed(Event):
    """A device could not be connected; ``status``: general and extended status of a refused Forward_Open."""

    TEXT = "connect failed"
    LEVEL = "warning"
    reason: str
    status: tuple[int, ...] = ()

    def details(self) -> dict[str, Any]:
        return {"reason": self.reason} | ({"status": list(self.status)} if self.status else {})


@dataclass(frozen=True, slots=True)
class ConnectionBroken(Event):
    """An open cyclic connection ended without a release."""

    TEXT = "connection lost"
    LEVEL = "warning"
    reason: str


@dataclass(frozen=True, slots=True)
class SessionLost(Event):
    """The TCP connection ended while cyclic data go on."""

    TEXT = "session lost"
    LEVEL = "warning"
    reason: str


@dataclass(frozen=True, slots=True)
class SessionResumed(Event):
    """There is a session again beside the cyclic data."""

    TEXT = "session resumed"


@dataclass(frozen=True, slots=True)
class OldConnectionClosed(Event):
    """A connection of the scanner's own, which the device still had, was in the way and is closed."""

    TEXT = "old connection closed"


@dataclass(frozen=True, slots=True)
class Released(Event):
    """The scanner ended the connection to a device in order."""

    TEXT = "released"


@dataclass(frozen=True, slots=True)
class PhaseChanged(Event):
    """An axis program goes on: numbers of :mod:`pnfarm.table.program`."""

    before: int
    after: int

    @property
    def text(self) -> str:
        return f"axis {PHASES[self.after]}"

    def details(self) -> dict[str, Any]:
        return {"before": PHASES[self.before]}


@dataclass(frozen=True, slots=True)
class IdentityUnread(Event):
    """A device's identity could not be read."""

    TEXT = "identity unread"
    LEVEL = "warning"
    detail: str


@dataclass(frozen=True, slots=True)
class IdentityDiffers(Event):
    """A device's identity is not as planned; its electronic key decides whether it can be connected."""

    TEXT = "identity differs"
    LEVEL = "warning"
    what: str
    found: str
    planned: str
