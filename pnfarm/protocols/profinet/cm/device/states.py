"""The state table of CMDEV (IEC 61158-6-10, CMDEV protocol machine), as :mod:`cmdev` runs it.

The device answers Connect and PrmEnd at once, so W_CRES, W_SUCNF and W_PERES are passed within one call.  An AR
without CRs (device access) goes from W_CRES straight to DATA.  ABORT ends every machine; the next
Connect starts another AR in W_CIND.
"""

from __future__ import annotations

from enum import auto

from pnfarm.protocols.named import Named
from pnfarm.protocols.profinet.cm.ar import CmdevState
from pnfarm.protocols.profinet.cm.device.events import ArEstablished, PrmEndReceived

__all__ = ["TRANSITIONS", "CmdevEvent"]


class CmdevEvent(Named):
    """Input of one AR's state machine."""

    CONNECT_IND = auto()
    CONNECT_RSP = auto()
    CONNECT_RSP_DEVICE_ACCESS = auto()
    STARTUP_CNF = auto()
    PRM_END_IND = auto()
    PRM_END_RSP = auto()
    APPLICATION_READY_REQ = auto()
    APPLICATION_READY_CNF = auto()
    APPLICATION_READY_CNF_DATA = auto()
    DATA_POSSIBLE = auto()
    RELEASE_IND = auto()
    ABORT = auto()


_S = CmdevState
_E = CmdevEvent
_ENDS = {_E.RELEASE_IND: (_S.ABORT, None), _E.ABORT: (_S.ABORT, None)}

#: (state, event) -> (next state, event reported on entering it).  What is not here does not happen.
TRANSITIONS: dict[tuple[CmdevState, CmdevEvent], tuple[CmdevState, type[PrmEndReceived | ArEstablished] | None]] = {
    (_S.W_CIND, _E.CONNECT_IND): (_S.W_CRES, None),
    (_S.W_CRES, _E.CONNECT_RSP): (_S.W_SUCNF, None),
    (_S.W_CRES, _E.CONNECT_RSP_DEVICE_ACCESS): (_S.DATA, None),
    (_S.W_SUCNF, _E.STARTUP_CNF): (_S.W_PEIND, None),
    (_S.W_PEIND, _E.PRM_END_IND): (_S.W_PERES, None),
    (_S.W_PERES, _E.PRM_END_RSP): (_S.W_ARDY, PrmEndReceived),
    (_S.W_ARDY, _E.APPLICATION_READY_REQ): (_S.W_ARDYCNF, None),
    (_S.W_ARDYCNF, _E.APPLICATION_READY_CNF): (_S.WDATA, None),
    (_S.W_ARDYCNF, _E.APPLICATION_READY_CNF_DATA): (_S.DATA, ArEstablished),
    (_S.WDATA, _E.DATA_POSSIBLE): (_S.DATA, ArEstablished),
    **{
        (state, event): end
        for state in (_S.W_PEIND, _S.W_PERES, _S.W_ARDY, _S.W_ARDYCNF, _S.WDATA, _S.DATA)
        for event, end in _ENDS.items()
    },
}
