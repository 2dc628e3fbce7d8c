"""The state table of a session (CIP volume 2, chapter 2-5), one for each TCP connection to port 44818, as
:class:`~pnfarm.protocols.enip.encapsulation.Encapsulation` runs it.

A TCP connection has one session at most, and the session ends with it.
"""

from __future__ import annotations

from enum import StrEnum

from pnfarm.protocols.named import Named

__all__ = ["SESSION", "SessionEvent", "SessionState"]


class SessionState(StrEnum):
    IDLE = "Idle"
    ESTABLISHED = "Established"
    CLOSED = "Closed"


class SessionEvent(Named):
    REGISTER = "RegisterSession"
    UNREGISTER = "UnRegisterSession"
    INACTIVITY = "Encapsulation inactivity timeout"
    #: The peer sent what cannot be followed, or more than this end holds for it.
    ABORT = "Abort"
    TCP_CLOSED = "TCP connection closed"


_S, _E = SessionState, SessionEvent
#: A row's action is the name of a method, empty for none.
SESSION: dict[tuple[SessionState, SessionEvent], tuple[SessionState, str]] = {
    (_S.IDLE, _E.REGISTER): (_S.ESTABLISHED, ""),
    (_S.ESTABLISHED, _E.UNREGISTER): (_S.CLOSED, "_close_stream"),
    **{
        (state, event): (_S.CLOSED, "_close_stream")
        for state in (_S.IDLE, _S.ESTABLISHED)
        for event in (_E.INACTIVITY, _E.ABORT)
    },
    (_S.IDLE, _E.TCP_CLOSED): (_S.CLOSED, "_forget_stream"),
    (_S.ESTABLISHED, _E.TCP_CLOSED): (_S.CLOSED, "_forget_stream"),
}
