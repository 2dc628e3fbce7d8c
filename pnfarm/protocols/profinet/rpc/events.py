"""Events and settings of the two ends of connectionless RPC; the machines are in :mod:`server` and :mod:`client`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from pnfarm.protocols.profinet.wire.rpc.pdu import BODY_MAX, RPC_PORT, UUID_PNIO_DEVICE, PnioStatus
from pnfarm.wire.value import value_class

if TYPE_CHECKING:
    from ipaddress import IPv4Address
    from uuid import UUID

    from pnfarm.protocols.profinet.rpc.endpoints import Endpoint
    from pnfarm.protocols.profinet.rpc.fragments import Peer

__all__ = [
    "TIMEOUT_FRAG_NS",
    "TIMEOUT_IDLE_NS",
    "TIMEOUT_PING_NS",
    "TIMEOUT_RESEND_NS",
    "CallFailed",
    "CallKey",
    "CallMisdirected",
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

# C706 appendix K, default protocol machine values
TIMEOUT_FRAG_NS: Final = 2_000 * _MS
"""Time to wait for the fack that a fragment requested, before the fragment is repeated."""
TIMEOUT_IDLE_NS: Final = 300_000 * _MS
"""Time for which a server remembers an idle client."""
TIMEOUT_PING_NS: Final = 2_000 * _MS
"""Wait between two pings."""
TIMEOUT_RESEND_NS: Final = 2_000 * _MS
"""Wait for the ack of an answer to a call that must not run twice, before the answer goes out again."""


class CallKey(NamedTuple):
    """Names one call: who calls, in which activity, with which sequence number."""

    ip: IPv4Address
    activity: UUID
    sequence: int


@value_class
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
class CallMisdirected:
    """A call for an object of another device was rejected."""

    object_uuid: UUID
    opnum: int
    peer: Peer
    source_mac: bytes | None


class LateAnswers(Protocol):
    """Gives the delay of a server's response (used by injections)."""

    def wait_ns(self, call: CallKey, opnum: int, now: int) -> int:
        """Nanoseconds; 0: the answer leaves at once, and :meth:`left` is not called."""

    def left(self, call: CallKey, *, sent: bool) -> None:
        """The answer left; ``sent`` False: the call was no longer open."""


ServerEvent = CallReceived | CallMisdirected


@dataclass(frozen=True, slots=True)
class Interface:
    """An interface that the server answers to."""

    uuid: UUID
    opnums: frozenset[int] = frozenset(range(6))
    version: int = 1


def _check_fragments(octets: int) -> None:
    """C706 12.5: the body of every fragment but the last is a multiple of 8; no peer must take more than BODY_MAX."""
    if not 0 < octets <= BODY_MAX or octets % 8:
        raise ValueError(f"fragments of {octets} octets: allowed are multiples of 8 up to {BODY_MAX}")


@dataclass(frozen=True, slots=True)
class RpcServerConfig:
    """What the server offers, its times and its bounds.

    An interface with ``endpoints`` takes calls for their object UUIDs only; one without takes any.  ``boot_time`` 0
    means unknown and is never compared.  ``reply_ns``: how long an answer is kept for a client that asks again.
    ``idle_ns``: how long the number of the last call is remembered after that.  ``stale_ns``: how long after the last
    sign of an activity an older sequence number counts as a late duplicate; afterwards it counts as a client that
    started again.  The times that C706 has no value for are this implementation's.
    """

    interfaces: tuple[Interface, ...] = (Interface(UUID_PNIO_DEVICE),)
    endpoints: tuple[Endpoint, ...] = ()
    port: int = RPC_PORT
    boot_time: int = 0
    fragment_octets: int = BODY_MAX
    activities_max: int = 32
    calls_max: int = 16
    held_octets_max: int = 512 * 1024
    fragment_retry_ns: int = TIMEOUT_FRAG_NS
    fragment_tries: int = 4
    resend_ns: int = TIMEOUT_RESEND_NS
    reassembly_ns: int = 5_000 * _MS
    execution_ns: int = 60_000 * _MS
    reply_ns: int = 30_000 * _MS
    idle_ns: int = TIMEOUT_IDLE_NS
    stale_ns: int = 3_000 * _MS

    def __post_init__(self) -> None:
        _check_fragments(self.fragment_octets)


@value_class
class CallReturned:
    """The server answered.

    ``payload`` holds the blocks; of the endpoint mapper it is the whole stub, in the order that ``little_endian``
    gives, and ``status`` is then always OK.  ``peer`` is where the answer came from.
    """

    call_id: int
    status: PnioStatus
    payload: bytes
    peer: Peer
    little_endian: bool


@dataclass(frozen=True, slots=True)
class CallFailed:
    """No answer that could be used.

    ``reason``: ``no-answer`` (all tries were silent), ``timeout`` (the call took too long), ``nocall`` (the server
    keeps losing the call), ``bad-response``, or ``reject`` and ``fault`` with the name of ``code`` and what it means,
    such as ``reject nca_unk_if (no such interface, version or object)``.
    """

    call_id: int
    reason: str
    peer: Peer
    code: int = 0

    @property
    def text(self) -> str:
        """The reason as text, to end a sentence with."""
        return _FAILURES.get(self.reason, self.reason)


_FAILURES = {
    "no-answer": "no answer",
    "timeout": "no answer in time",
    "nocall": "the other side keeps losing the call",
    "bad-response": "the answer has no readable PNIOStatus",
}

ClientEvent = CallReturned | CallFailed


@dataclass(frozen=True, slots=True)
class RpcClientConfig:
    """Timing: first retry after ``retry_ns``, each further one after twice the time, ``tries`` transmissions in all.

    ``retry_ns`` is shorter than C706's TIMEOUT_PING, because a control network answers within milliseconds.
    """

    retry_ns: int = 500 * _MS
    tries: int = 3
    timeout_ns: int = 10_000 * _MS
    working_ping_ns: int = TIMEOUT_PING_NS
    idle_ns: int = 60_000 * _MS
    fragment_octets: int = BODY_MAX

    def __post_init__(self) -> None:
        _check_fragments(self.fragment_octets)
