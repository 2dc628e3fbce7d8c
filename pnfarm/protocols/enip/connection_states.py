"""The state table of a connection (CIP volume 1, chapter 3-4.3, I/O and explicit connection state), as
:class:`~pnfarm.protocols.enip.connection_manager.ConnectionManager` runs it for each row of its table.

Forward_Open configures and applies in one service, so CONFIGURING is left within the same call; TIMED_OUT too, because
the watchdog's action is auto delete.  A row's action is the name of a method of the manager, empty for none.
"""

from __future__ import annotations

from enum import StrEnum

from pnfarm.protocols.named import Named

__all__ = ["CONNECTION", "ConnectionEvent", "ConnectionState"]


class ConnectionState(StrEnum):
    NON_EXISTENT = "Non-existent"
    CONFIGURING = "Configuring"
    ESTABLISHED = "Established"
    TIMED_OUT = "Timed out"


class ConnectionEvent(Named):
    CREATE = "Forward_Open"
    APPLY = "Apply"
    DATA = "Receive_Data"
    WATCHDOG = "Inactivity/Watchdog timer expires"
    AUTO_DELETE = "Auto delete"
    CLOSE = "Forward_Close"
    #: The TCP connection of a class 3 connection, or the owner of a listen-only one, is gone; or the drive ends it.
    RELEASE = "Release"


_S, _E = ConnectionState, ConnectionEvent
CONNECTION: dict[tuple[ConnectionState, ConnectionEvent], tuple[ConnectionState, str]] = {
    (_S.NON_EXISTENT, _E.CREATE): (_S.CONFIGURING, ""),
    (_S.CONFIGURING, _E.APPLY): (_S.ESTABLISHED, "_start"),
    (_S.ESTABLISHED, _E.DATA): (_S.ESTABLISHED, "_restart_watchdog"),
    (_S.ESTABLISHED, _E.WATCHDOG): (_S.TIMED_OUT, ""),
    (_S.ESTABLISHED, _E.CLOSE): (_S.NON_EXISTENT, "_remove"),
    (_S.ESTABLISHED, _E.RELEASE): (_S.NON_EXISTENT, "_remove"),
    (_S.TIMED_OUT, _E.AUTO_DELETE): (_S.NON_EXISTENT, "_remove"),
}
