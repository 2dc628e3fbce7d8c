"""Events and settings of the two ends of connectionless RPC; the machines are in ``rpc_server`` and ``rpc_client``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from pnfarm.protocols.profinet.wire.rpc import BODY_MAX, RPC_PORT, UUID_PNIO_DEVICE, PnioStatus

if TYPE_CHECKING:
    from ipaddress import IPv4Address
    from uuid import UUID

    from pnfarm.protocols.profinet.rpc_endpoints import Endpoint
    from pnfarm.protocols.profinet.rpc_fragments import Peer

__all__ = [
    "CallCancelled",
    "CallFailed",
    "CallKey",
    "CallReceived",
    "CallReturned",
    "ClientEvent",
    "Interface",
    "LateAnswers",
    "RpcClientConfig",
    "RpcServerConfig",
    "ServerEvent",
]

_MS: Final = 1_000_000


class CallKey(NamedTuple):
    """Names one call: who calls, in which activity, with which sequence number."""

    ip: IPv4Address
    activity: UUID
    sequence: int


@dataclass(frozen=True, slots=True)
class CallReceived:
    """A call is complete and waits for :meth:`RpcServer.respond`; ``payload`` holds the blocks."""

    call: CallKey
    interface: UUID
    object_uuid: UUID
    opnum: int
    args_maximum: int
    payload: bytes
    peer: Peer
    local_port: int
    source_mac: bytes | None


@dataclass(frozen=True, slots=True)
class CallCancelled:
    """The client gave up a call that the application still holds; an answer to it may still be given."""

    call: CallKey
    peer: Peer


class LateAnswers(Protocol):
    """Whom a server asks how long it keeps an answer back (a fault kind is such a one)."""

    def wait_ns(self, call: CallKey, opnum: int, now: int) -> int:
        """Nanoseconds; 0: the answer leaves at once, and :meth:`left` is not called."""
        ...

    def left(self, call: CallKey, *, sent: bool) -> None:
        """The answer left; ``sent`` False: the call was no longer open."""
        ...


ServerEvent = CallReceived | CallCancelled


@dataclass(frozen=True, slots=True)
class Interface:
    """An interface that the server answers to."""

    uuid: UUID
    opnums: frozenset[int] = frozenset(range(6))
    version: int = 1


@dataclass(frozen=True, slots=True)
class RpcServerConfig:
    """What the server offers, and its bounds.

    ``boot_time`` 0 means unknown and is never compared.  ``stale_ns``: how long after the last sign of an activity an
    older sequence number counts as a late duplicate; afterwards it counts as a client that began anew.
    """

    interfaces: tuple[Interface, ...] = (Interface(UUID_PNIO_DEVICE),)
    endpoints: tuple[Endpoint, ...] = ()
    port: int = RPC_PORT
    boot_time: int = 0
    fragment_octets: int = BODY_MAX
    activities_max: int = 32
    calls_max: int = 16
    held_octets_max: int = 512 * 1024
    fragment_retry_ns: int = 500 * _MS
    fragment_tries: int = 4
    reassembly_ns: int = 5_000 * _MS
    execution_ns: int = 60_000 * _MS
    idle_ns: int = 30_000 * _MS
    stale_ns: int = 3_000 * _MS


@dataclass(frozen=True, slots=True)
class CallReturned:
    """The server answered.

    ``payload`` holds the blocks; of the endpoint mapper it is the whole stub, in the order that ``little_endian``
    tells, and ``status`` is then always OK.  ``peer`` is where the answer came from.
    """

    call_id: int
    status: PnioStatus
    payload: bytes
    peer: Peer
    little_endian: bool


@dataclass(frozen=True, slots=True)
class CallFailed:
    """No answer that could be used.

    ``reason``: ``no-answer`` (all tries were silent), ``timeout`` (the call's time is up), ``nocall`` (the server
    keeps losing the call), ``bad-response``, or ``reject`` and ``fault`` with the name of ``code``, such as
    ``reject nca_unk_if``.
    """

    call_id: int
    reason: str
    peer: Peer
    code: int = 0


ClientEvent = CallReturned | CallFailed


@dataclass(frozen=True, slots=True)
class RpcClientConfig:
    """Timing: the first retry after ``retry_ns``, each further one after twice the time, ``tries`` sendings in all."""

    retry_ns: int = 500 * _MS
    tries: int = 3
    timeout_ns: int = 10_000 * _MS
    working_ping_ns: int = 2_000 * _MS
    idle_ns: int = 60_000 * _MS
    fragment_octets: int = BODY_MAX
