"""Parameters for submodules while an AR is in DATA: after a plug (PLUGSM) and after PrmBegin (CMPBE).

Theory (IEC 61158-6-10).  A submodule that is plugged, or released to an AR, is reported by an alarm.  The controller
acknowledges it, writes the submodule's records and ends with PrmEnd.plug, which names the alarm by its sequence number;
the device answers with ApplicationReady.plug, and the submodule's data are good again.  Each alarm has a machine of
its own, and several may be under way.

PrmBegin lists submodules of a running AR; the controller writes their records and ends with an ordinary PrmEnd; the
device answers with an ordinary ApplicationReady.  An AR has one such machine, and sends no alarms while it works.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum, auto
from typing import TYPE_CHECKING

from pnfarm.protocols.named import Named

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey

__all__ = [
    "CMPBE_TRANSITIONS",
    "PLUGSM_TRANSITIONS",
    "CmpbeEvent",
    "CmpbeState",
    "ParameterBegin",
    "Plug",
    "PlugsmEvent",
]


class PlugsmState(StrEnum):
    """States of PLUGSM; IDLE: the alarm is sent and not acknowledged yet."""

    IDLE = "IDLE"
    WFPRMIND = "WFPRMIND"
    WFDATAUPDATE = "WFDATAUPDATE"
    WFAPLRDYCNF = "WFAPLRDYCNF"
    DONE = "DONE"


class PlugsmEvent(Named):
    ALARM_ACK = auto()
    ALARM_REFUSED = auto()
    PRM_END_IND = auto()
    APPLICATION_READY_REQ = auto()
    APPLICATION_READY_CNF = auto()


_P, _Q = PlugsmState, PlugsmEvent

#: (state, event) -> next state.  What is not here is a state conflict.
PLUGSM_TRANSITIONS: dict[tuple[PlugsmState, PlugsmEvent], PlugsmState] = {
    (_P.IDLE, _Q.ALARM_ACK): _P.WFPRMIND,
    (_P.IDLE, _Q.ALARM_REFUSED): _P.DONE,
    # the acknowledgement travels by Ethernet, PrmEnd by UDP: either may come first
    (_P.IDLE, _Q.PRM_END_IND): _P.WFDATAUPDATE,
    (_P.WFPRMIND, _Q.PRM_END_IND): _P.WFDATAUPDATE,
    (_P.WFDATAUPDATE, _Q.ALARM_ACK): _P.WFDATAUPDATE,
    (_P.WFDATAUPDATE, _Q.APPLICATION_READY_REQ): _P.WFAPLRDYCNF,
    (_P.WFAPLRDYCNF, _Q.ALARM_ACK): _P.WFAPLRDYCNF,
    (_P.WFAPLRDYCNF, _Q.APPLICATION_READY_CNF): _P.DONE,
}


@dataclass(slots=True)
class Plug:
    """One submodule that was plugged or released.

    ``number`` is its alarm's in this device; the alarm's sequence number is known once it was sent.
    """

    key: ExpectedKey
    number: int
    sequence: int | None = None
    state: PlugsmState = PlugsmState.IDLE

    def step(self, event: PlugsmEvent) -> bool:
        """False when the event does not belong to this state."""
        after = PLUGSM_TRANSITIONS.get((self.state, event))
        if after is None:
            return False
        self.state = after
        return True

    @property
    def done(self) -> bool:
        """Nothing is awaited any more."""
        return self.state is PlugsmState.DONE


class CmpbeState(StrEnum):
    """States of CMPBE."""

    IDLE = "IDLE"
    WFIND = "WFIND"
    WFRSP = "WFRSP"
    WFPEI = "WFPEI"
    WFPER = "WFPER"
    WFREQ = "WFREQ"
    WFCNF = "WFCNF"


class CmpbeEvent(Named):
    DATA = auto()
    PRM_BEGIN_IND = auto()
    PRM_BEGIN_RSP = auto()
    PRM_END_IND = auto()
    PRM_END_RSP = auto()
    APPLICATION_READY_REQ = auto()
    APPLICATION_READY_CNF = auto()


_S, _E = CmpbeState, CmpbeEvent

#: (state, event) -> next state.  What is not here is a state conflict.
CMPBE_TRANSITIONS: dict[tuple[CmpbeState, CmpbeEvent], CmpbeState] = {
    (_S.IDLE, _E.DATA): _S.WFIND,
    (_S.WFIND, _E.PRM_BEGIN_IND): _S.WFRSP,
    (_S.WFRSP, _E.PRM_BEGIN_RSP): _S.WFPEI,
    (_S.WFPEI, _E.PRM_END_IND): _S.WFPER,
    (_S.WFPER, _E.PRM_END_RSP): _S.WFREQ,
    (_S.WFREQ, _E.APPLICATION_READY_REQ): _S.WFCNF,
    (_S.WFCNF, _E.APPLICATION_READY_CNF): _S.WFIND,
}


@dataclass(slots=True)
class ParameterBegin:
    """An AR's CMPBE."""

    state: CmpbeState = CmpbeState.IDLE

    def step(self, event: CmpbeEvent) -> bool:
        """False when the event does not belong to this state."""
        after = CMPBE_TRANSITIONS.get((self.state, event))
        if after is None:
            return False
        self.state = after
        return True
