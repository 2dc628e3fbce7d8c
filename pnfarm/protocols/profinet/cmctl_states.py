"""States and signals of CMCTL, and how an AR ends; the table itself stands with its actions in :mod:`cmctl`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.errors import ConnectFault, RtaError, describe_status

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.cmctl_events import Phase
    from pnfarm.protocols.profinet.errors import PnioStatus

__all__ = ["CONNECTED", "PHASES", "CmctlEnd", "CmctlSignal", "CmctlState"]


class CmctlState(StrEnum):
    """Named by the confirmation or indication that is waited for, as the states of CMDEV are."""

    IDLE = "IDLE"
    W_CCNF = "W_CCNF"
    W_WCNF = "W_WCNF"
    W_PECNF = "W_PECNF"
    W_ARDY = "W_ARDY"
    DATA = "DATA"
    W_RLCNF = "W_RLCNF"
    CLOSED = "CLOSED"


class CmctlSignal(Enum):
    CONNECT = "connect.req"
    CONNECT_CNF = "connect.cnf"
    RECORDS_WRITTEN = "write.cnf of the last record"
    PRM_END_CNF = "dcontrol.cnf"
    READY_IND = "ccontrol.ind"
    FAULT = "the start-up cannot go on"
    ABORT = "abort"
    RELEASE = "release.req"
    RELEASE_CNF = "release.cnf"


#: Where a start-up stands that fails in this state.
PHASES: dict[CmctlState, Phase] = {
    CmctlState.W_CCNF: "connect",
    CmctlState.W_WCNF: "write",
    CmctlState.W_PECNF: "parameter-end",
    CmctlState.W_ARDY: "application-ready",
}
#: States in which the device has the AR, so that records can be read and written in it.
CONNECTED = {CmctlState.W_WCNF, CmctlState.W_PECNF, CmctlState.W_ARDY, CmctlState.DATA}


@dataclass(frozen=True, slots=True)
class CmctlEnd:
    """Why an AR ends.  ``rta`` is the code that the device is told, None when it needs no telling."""

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
