"""The scanner's work with one device: reached, connected, run, and reached again.

States, each named by what it waits for:

=========  =================================================================
WAIT       the pause before the next attempt
STREAM     the TCP connection
SESSION    the answer to RegisterSession
IDENTITY   the device's identity
OPEN       the answer to Forward_Open
DATA       the end of the cyclic connection
IDLE       two packet intervals, in which the device learns of the end: idle
CLOSE      the answer to Forward_Close
STOPPED    nothing
=========  =================================================================

Cyclic data do not hang on the TCP connection (CIP volume 2, 2-2): in DATA a lost one is made again beside them.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from enum import Enum, StrEnum, auto
from typing import TYPE_CHECKING, Final

from pnfarm.buses.controllers import session
from pnfarm.buses.ethernetip.controller.requests import RequestQueue

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from pnfarm.buses.ethernetip.controller.device_plan import DevicePlan
    from pnfarm.buses.ethernetip.controller.identity import Identification
    from pnfarm.protocols.enip.originator import Originator
    from pnfarm.protocols.enip.wire.forward_open import ForwardOpen

__all__ = ["TRANSITIONS", "DeviceSession", "Measures", "SessionState", "Sign"]

#: Connections that are kept to be closed; a device gives up older ones by itself.
MOST_LEFT: Final = 8


class SessionState(StrEnum):
    WAIT = "WAIT"
    STREAM = "STREAM"
    SESSION = "SESSION"
    IDENTITY = "IDENTITY"
    OPEN = "OPEN"
    DATA = "DATA"
    IDLE = "IDLE"
    CLOSE = "CLOSE"
    STOPPED = "STOPPED"


class Sign(Enum):
    """Input of a session's state machine."""

    TIME = auto()  # a pause, or the time for an answer, is over
    OPENED = auto()  # the TCP connection is up
    REGISTERED = auto()
    IDENTIFIED = auto()  # the identity was read, or could not be
    MADE = auto()  # Forward_Open was answered
    AGAIN = auto()  # what was in the way of Forward_Open is gone
    REFUSED = auto()  # Forward_Open was refused, or had no answer
    SESSION_LOST = auto()  # the TCP connection or the session ended
    EXPIRED = auto()  # no cyclic data for longer than the timeout
    RELEASE = auto()  # the owner ends it
    CLOSED = auto()  # Forward_Close was answered, or cannot be asked


_S, _E = SessionState, Sign

#: (state, sign) -> (next state, name of the scanner's action or "").
TRANSITIONS: dict[tuple[SessionState, Sign], tuple[SessionState, str]] = {
    (_S.WAIT, _E.TIME): (_S.STREAM, "connect"),
    (_S.WAIT, _E.RELEASE): (_S.STOPPED, ""),
    (_S.STREAM, _E.OPENED): (_S.SESSION, "register"),
    (_S.STREAM, _E.TIME): (_S.WAIT, "pause"),
    (_S.STREAM, _E.SESSION_LOST): (_S.WAIT, "pause"),
    (_S.STREAM, _E.RELEASE): (_S.STOPPED, "drop"),
    (_S.SESSION, _E.REGISTERED): (_S.IDENTITY, "identify"),
    (_S.SESSION, _E.SESSION_LOST): (_S.WAIT, "pause"),
    (_S.SESSION, _E.RELEASE): (_S.STOPPED, "drop"),
    (_S.IDENTITY, _E.IDENTIFIED): (_S.OPEN, "open"),
    (_S.IDENTITY, _E.SESSION_LOST): (_S.WAIT, "pause"),
    (_S.IDENTITY, _E.RELEASE): (_S.STOPPED, "drop"),
    (_S.OPEN, _E.MADE): (_S.DATA, "established"),
    (_S.OPEN, _E.AGAIN): (_S.OPEN, "open"),
    (_S.OPEN, _E.REFUSED): (_S.WAIT, "pause"),
    (_S.OPEN, _E.SESSION_LOST): (_S.WAIT, "pause"),
    (_S.OPEN, _E.RELEASE): (_S.CLOSE, "close"),
    (_S.DATA, _E.EXPIRED): (_S.WAIT, "pause"),
    (_S.DATA, _E.SESSION_LOST): (_S.DATA, "reopen"),
    (_S.DATA, _E.TIME): (_S.DATA, "resume"),
    (_S.DATA, _E.OPENED): (_S.DATA, "register"),
    (_S.DATA, _E.REGISTERED): (_S.DATA, "resumed"),
    (_S.DATA, _E.RELEASE): (_S.IDLE, "idle"),
    (_S.IDLE, _E.TIME): (_S.CLOSE, "close"),
    (_S.IDLE, _E.EXPIRED): (_S.STOPPED, "drop"),
    (_S.CLOSE, _E.CLOSED): (_S.STOPPED, "drop"),
    (_S.CLOSE, _E.TIME): (_S.STOPPED, "drop"),
    (_S.CLOSE, _E.SESSION_LOST): (_S.STOPPED, "drop"),
    (_S.CLOSE, _E.EXPIRED): (_S.STOPPED, "drop"),
}


@dataclass(slots=True)
class Measures(session.Measures):
    """TCP connections that ended beside cyclic data."""

    sessions_lost: int = 0


@dataclass(slots=True, eq=False)
class DeviceSession(session.Session):
    """See the module's docstring.  The machine is there from the TCP connection's opening to its end."""

    plan: DevicePlan
    queue: RequestQueue = field(default_factory=RequestQueue)
    state: SessionState = SessionState.WAIT
    stream: int | None = None
    machine: Originator | None = None
    #: Numbers of the requests under way, of the machine's.
    asked_identity: int | None = None
    asked_close: int | None = None
    #: The connection that was asked for last.
    opened: ForwardOpen | None = None
    #: Connections that may still be open in the device, the oldest first.
    left: deque[ForwardOpen] = field(default_factory=lambda: deque(maxlen=MOST_LEFT))
    #: The group to which the device sends, None for its own address.
    group: IPv4Address | None = None
    #: Refusals in a row.
    failures: int = 0
    #: Why the device cannot be reached, or its session is lost, as it was logged last.
    told: str = ""
    identification: Identification | None = None
    measures: Measures = field(default_factory=Measures)
