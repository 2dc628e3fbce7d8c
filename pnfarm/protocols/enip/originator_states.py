"""The state table of an originator's session with one target (CIP volume 2, chapter 2-5), as
:class:`~pnfarm.protocols.enip.originator.Originator` runs it.
"""

from __future__ import annotations

from enum import StrEnum

from pnfarm.protocols.named import Named

__all__ = ["ORIGINATOR", "OriginatorEvent", "OriginatorState"]


class OriginatorState(StrEnum):
    CLOSED = "Closed"
    REGISTERING = "Registering"
    ESTABLISHED = "Established"


class OriginatorEvent(Named):
    TCP_OPENED = "TCP connection opened"
    REGISTERED = "RegisterSession reply, success"
    REFUSED = "RegisterSession reply, error"
    UNREGISTER = "UnRegisterSession"
    TIMEOUT = "no reply in time"
    #: The peer sent what cannot be followed.
    ABORT = "Abort"
    TCP_CLOSED = "TCP connection closed"


_S, _E = OriginatorState, OriginatorEvent
#: A row's action is the name of a method, empty for none.
ORIGINATOR: dict[tuple[OriginatorState, OriginatorEvent], tuple[OriginatorState, str]] = {
    (_S.CLOSED, _E.TCP_OPENED): (_S.REGISTERING, "_send_register"),
    (_S.REGISTERING, _E.REGISTERED): (_S.ESTABLISHED, "_report_registered"),
    (_S.REGISTERING, _E.REFUSED): (_S.CLOSED, "_end"),
    (_S.REGISTERING, _E.TIMEOUT): (_S.CLOSED, "_end"),
    (_S.ESTABLISHED, _E.UNREGISTER): (_S.CLOSED, "_send_unregister"),
    **{
        (state, event): (_S.CLOSED, "_end")
        for state in (_S.REGISTERING, _S.ESTABLISHED)
        for event in (_E.ABORT, _E.TCP_CLOSED)
    },
}
