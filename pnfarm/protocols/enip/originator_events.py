"""What an originator reports to its owner, and what it asks its carrier to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.protocols.enip.wire.cpf import SocketAddress
    from pnfarm.protocols.enip.wire.forward_open import ForwardOpen, ForwardOpenReply, Triad
    from pnfarm.protocols.enip.wire.message import MessageReply

__all__ = [
    "CloseTcp",
    "ConnectionEnded",
    "ConnectionMade",
    "ConnectionNotMade",
    "OriginatorNote",
    "OriginatorOutput",
    "RequestAnswered",
    "RequestFailed",
    "SendTcp",
    "SessionEnded",
    "SessionRegistered",
]


@dataclass(frozen=True, slots=True)
class SendTcp:
    data: bytes


@dataclass(frozen=True, slots=True)
class CloseTcp:
    """Close the TCP connection, after what was sent on it."""


OriginatorOutput = SendTcp | CloseTcp


@dataclass(frozen=True, slots=True)
class SessionRegistered:
    session: int


@dataclass(frozen=True, slots=True)
class SessionEnded:
    """``reason`` in words; every request without a reply has failed."""

    reason: str


@dataclass(frozen=True, slots=True)
class RequestAnswered:
    number: int
    reply: MessageReply


@dataclass(frozen=True, slots=True)
class RequestFailed:
    """No reply, for a reason in words."""

    number: int
    reason: str


@dataclass(frozen=True, slots=True)
class ConnectionMade:
    """A Forward_Open was answered; ``items`` tell the target's port, and the multicast address where there is one."""

    number: int
    request: ForwardOpen
    reply: ForwardOpenReply
    items: tuple[SocketAddress, ...]


@dataclass(frozen=True, slots=True)
class ConnectionNotMade:
    """A Forward_Open was refused with a status, or had no reply (``reply`` None)."""

    number: int
    request: ForwardOpen
    reply: MessageReply | None
    reason: str


@dataclass(frozen=True, slots=True)
class ConnectionEnded:
    """A Forward_Close was answered: the target does not have the connection any more, or never had it."""

    number: int
    triad: Triad


OriginatorNote = (
    SessionRegistered
    | SessionEnded
    | RequestAnswered
    | RequestFailed
    | ConnectionMade
    | ConnectionNotMade
    | ConnectionEnded
)
