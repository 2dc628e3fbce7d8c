"""The controller's session with one drive: found, addressed, connected, run, and found again.

States, each named by what it waits for:

=========  =========================================================
WAIT       the pause before the next search
SEARCH     the drive's answer to an Identify by name
ADDRESS    the drive's answer to Set IP
CONNECT    its turn, then the end of the start-up (the AR's own machine has its states)
DATA       the end of the connection
RELEASE    the confirmation of a release
STOPPED    nothing
=========  =========================================================
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum, auto
from typing import TYPE_CHECKING

from pnfarm.buses.controllers import session
from pnfarm.protocols.named import Named

if TYPE_CHECKING:
    from uuid import UUID

    from pnfarm.buses.profinet.controller.device_plan import DevicePlan
    from pnfarm.buses.profinet.controller.identity import Identification
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout
    from pnfarm.protocols.profinet.cm.controller.cmctl import CmController

__all__ = ["TRANSITIONS", "DeviceSession", "Measures", "SessionState", "Sign"]


class SessionState(StrEnum):
    WAIT = "WAIT"
    SEARCH = "SEARCH"
    ADDRESS = "ADDRESS"
    CONNECT = "CONNECT"
    DATA = "DATA"
    RELEASE = "RELEASE"
    STOPPED = "STOPPED"


class Sign(Named):
    """Input of a session's state machine."""

    TIME = auto()  # the pause is over, or the time for the first cyclic data of a start-up or a connection
    FOUND = auto()  # the drive answered, with another address than planned
    FOUND_READY = auto()  # the drive answered and has its address
    MISSED = auto()  # no answer, or Set IP failed
    ADDRESSED = auto()
    ESTABLISHED = auto()
    LOST = auto()  # the start-up failed, or the connection ended
    RELEASE = auto()  # the owner ends it
    RELEASED = auto()


_S, _E = SessionState, Sign

#: (state, sign) -> (next state, name of the controller's action or "").
TRANSITIONS: dict[tuple[SessionState, Sign], tuple[SessionState, str]] = {
    (_S.WAIT, _E.TIME): (_S.SEARCH, "search"),
    (_S.WAIT, _E.RELEASE): (_S.STOPPED, ""),
    (_S.SEARCH, _E.FOUND): (_S.ADDRESS, "address"),
    (_S.SEARCH, _E.FOUND_READY): (_S.CONNECT, "connect"),
    (_S.SEARCH, _E.MISSED): (_S.WAIT, "pause"),
    (_S.SEARCH, _E.RELEASE): (_S.STOPPED, ""),
    (_S.ADDRESS, _E.ADDRESSED): (_S.CONNECT, "connect"),
    (_S.ADDRESS, _E.MISSED): (_S.WAIT, "pause"),
    (_S.ADDRESS, _E.RELEASE): (_S.STOPPED, ""),
    (_S.CONNECT, _E.TIME): (_S.CONNECT, "expect_data"),
    (_S.CONNECT, _E.ESTABLISHED): (_S.DATA, "established"),
    (_S.CONNECT, _E.LOST): (_S.WAIT, "pause"),
    (_S.CONNECT, _E.RELEASE): (_S.RELEASE, "release"),
    (_S.DATA, _E.TIME): (_S.DATA, "expect_data"),
    (_S.DATA, _E.LOST): (_S.WAIT, "pause"),
    (_S.DATA, _E.RELEASE): (_S.RELEASE, "release"),
    (_S.RELEASE, _E.ESTABLISHED): (_S.RELEASE, ""),
    (_S.RELEASE, _E.LOST): (_S.STOPPED, ""),
    (_S.RELEASE, _E.RELEASED): (_S.STOPPED, ""),
}


@dataclass(slots=True)
class Measures(session.Measures):
    """Alarms of the drive, in all its connections, and the text of the last one."""

    alarms_received: int = 0
    last_alarm: str = ""


@dataclass(slots=True, eq=False)
class DeviceSession(session.Session):
    """See the module's docstring."""

    plan: DevicePlan
    state: SessionState = SessionState.WAIT
    machine: CmController | None = None
    ar_uuid: UUID | None = None
    #: Layouts of the input frames, then of the output frames, while the channels are open.
    layouts: tuple[IocrLayout, ...] = ()
    #: That of the first input CR; those of further ones follow.
    frame_id: int = 0
    #: Submodules that cannot be used at present, and why.
    unusable: dict[ExpectedKey, str] = field(default_factory=dict)
    identification: Identification | None = None
    calls: dict[int, int] = field(default_factory=dict)
    measures: Measures = field(default_factory=Measures)
    station_type: str = ""

    @property
    def out_of_use(self) -> list[str]:
        """``unusable`` as text."""
        return [f"slot {slot} subslot 0x{sub:04X}: {why}" for (_, slot, sub), why in sorted(self.unusable.items())]
