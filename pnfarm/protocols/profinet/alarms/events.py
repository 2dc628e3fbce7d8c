"""Events of an alarm channel.

:class:`AlarmFailed` and :class:`PeerAborted` are the channel's end, and the end of its AR.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pnfarm.errors import PnfarmError

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.errors import RtaError
    from pnfarm.protocols.profinet.wire.alarms.notification import AlarmNotification
    from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

__all__ = [
    "AlarmAcknowledged",
    "AlarmEvent",
    "AlarmFailed",
    "AlarmReceived",
    "AlarmRefusedError",
    "PeerAborted",
]


class AlarmRefusedError(PnfarmError):
    """The channel refused an alarm because of ``reason``; nothing has changed."""

    def __init__(self, reason: Literal["closed", "queue-full", "too-long"], detail: str) -> None:
        super().__init__(detail)
        self.reason = reason


@dataclass(frozen=True, slots=True)
class AlarmReceived:
    """The peer's alarm: the owner must ``acknowledge`` it once, and gets no other of its priority before."""

    alarm: AlarmNotification


@dataclass(frozen=True, slots=True)
class AlarmAcknowledged:
    """The peer accepted alarm ``handle``, or refused it with ``status``; ``alarm`` is as sent."""

    handle: int
    alarm: AlarmNotification
    status: PnioStatus


@dataclass(frozen=True, slots=True)
class AlarmFailed:
    """The channel failed and is closed: the owner ends the AR with ``code``."""

    code: RtaError
    reason: str


@dataclass(frozen=True, slots=True)
class PeerAborted:
    """The peer ended the AR by an ERR-RTA-PDU; the channel is closed."""

    status: PnioStatus


AlarmEvent = AlarmReceived | AlarmAcknowledged | AlarmFailed | PeerAborted
