"""States, signals and table of CMCTL, and how an AR ends; the actions are :mod:`cmctl`'s."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from pnfarm.protocols.named import Named
from pnfarm.protocols.profinet.errors import ConnectFault, RtaError, describe_status

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.cm.controller.events import Phase
    from pnfarm.protocols.profinet.errors import PnioStatus

__all__ = ["CONNECTED", "PHASES", "TRANSITIONS", "CmctlEnd", "CmctlSignal", "CmctlState"]


class CmctlState(StrEnum):
    """Named by the confirmation or indication that is awaited, like the states of CMDEV."""

    IDLE = "IDLE"
    W_CCNF = "W_CCNF"
    W_WCNF = "W_WCNF"
    W_PECNF = "W_PECNF"
    W_ARDY = "W_ARDY"
    DATA = "DATA"
    W_RLCNF = "W_RLCNF"
    CLOSED = "CLOSED"


class CmctlSignal(Named):
    CONNECT = "connect.req"
    CONNECT_CNF = "connect.cnf"
    ACCESS_CNF = "connect.cnf for device access"
    RECORDS_WRITTEN = "write.cnf of the last record"
    PRM_END_CNF = "dcontrol.cnf"
    READY_IND = "ccontrol.ind"
    FAULT = "the start-up cannot go on"
    ABORT = "abort"
    RELEASE = "release.req"
    RELEASE_CNF = "release.cnf"


#: Phase of a start-up that fails in this state.
PHASES: dict[CmctlState, Phase] = {
    CmctlState.W_CCNF: "connect",
    CmctlState.W_WCNF: "write",
    CmctlState.W_PECNF: "parameter-end",
    CmctlState.W_ARDY: "application-ready",
}
#: States in which the device has the AR, so that records can be read and written in it.
CONNECTED = {CmctlState.W_WCNF, CmctlState.W_PECNF, CmctlState.W_ARDY, CmctlState.DATA}


_S, _E = CmctlState, CmctlSignal

#: (state, signal) -> (next state, name of the machine's action).  IEC 61158-6-10 names the services; a missing
#: pair is counted in ``dropped`` and changes nothing.
TRANSITIONS: dict[tuple[CmctlState, CmctlSignal], tuple[CmctlState, str]] = {
    (_S.IDLE, _E.CONNECT): (_S.W_CCNF, "send_connect"),
    (_S.IDLE, _E.RELEASE): (_S.CLOSED, "never_connected"),
    (_S.IDLE, _E.ABORT): (_S.CLOSED, "never_connected"),
    # connecting
    (_S.W_CCNF, _E.CONNECT_CNF): (_S.W_WCNF, "connected"),
    (_S.W_CCNF, _E.ACCESS_CNF): (_S.DATA, "accessible"),
    (_S.W_CCNF, _E.FAULT): (_S.CLOSED, "failed"),
    (_S.W_CCNF, _E.ABORT): (_S.CLOSED, "connect_given_up"),
    (_S.W_CCNF, _E.RELEASE): (_S.W_RLCNF, "send_release"),
    # writing the parameter records
    (_S.W_WCNF, _E.RECORDS_WRITTEN): (_S.W_PECNF, "send_parameter_end"),
    (_S.W_WCNF, _E.FAULT): (_S.CLOSED, "failed"),
    (_S.W_WCNF, _E.ABORT): (_S.CLOSED, "failed"),
    (_S.W_WCNF, _E.RELEASE): (_S.W_RLCNF, "send_release"),
    # ending the parametrisation
    (_S.W_PECNF, _E.READY_IND): (_S.W_PECNF, "hold_ready"),
    (_S.W_PECNF, _E.PRM_END_CNF): (_S.W_ARDY, "parametrised"),
    (_S.W_PECNF, _E.FAULT): (_S.CLOSED, "failed"),
    (_S.W_PECNF, _E.ABORT): (_S.CLOSED, "failed"),
    (_S.W_PECNF, _E.RELEASE): (_S.W_RLCNF, "send_release"),
    # waiting for the application of the device
    (_S.W_ARDY, _E.READY_IND): (_S.DATA, "established"),
    (_S.W_ARDY, _E.FAULT): (_S.CLOSED, "failed"),
    (_S.W_ARDY, _E.ABORT): (_S.CLOSED, "failed"),
    (_S.W_ARDY, _E.RELEASE): (_S.W_RLCNF, "send_release"),
    # exchanging data
    (_S.DATA, _E.READY_IND): (_S.DATA, "ready_again"),
    (_S.DATA, _E.ABORT): (_S.CLOSED, "aborted"),
    (_S.DATA, _E.RELEASE): (_S.W_RLCNF, "send_release"),
    # releasing
    (_S.W_RLCNF, _E.RELEASE_CNF): (_S.CLOSED, "released"),
    (_S.W_RLCNF, _E.ABORT): (_S.CLOSED, "released"),
}


@dataclass(frozen=True, slots=True)
class CmctlEnd:
    """Why an AR ends.  ``rta`` is the code sent to the device, None if it needs none."""

    reason: str
    status: PnioStatus | None = None
    rta: int | None = None
    by_device: bool = False
    error_code1: int = ConnectFault.RTA_ERR_CLS_PROTOCOL
    error_code2: int = RtaError.ABORT_REQUEST

    @classmethod
    def of_device(cls, status: PnioStatus) -> CmctlEnd:
        """The device ended it by an RTA error."""
        reason = f"the device aborts: {describe_status(status)}"
        code1, code2 = status.error_code1, status.error_code2
        return cls(reason, status, by_device=True, error_code1=code1, error_code2=code2)
