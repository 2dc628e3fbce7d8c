"""Connections of a target: what it offers, what is open, and what is reported to its owner."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, StrEnum
from typing import TYPE_CHECKING, Final

from pnfarm.protocols.enip.connection_states import ConnectionState
from pnfarm.protocols.enip.status import ConnectionStatus
from pnfarm.protocols.enip.wire.encapsulation import IO_PORT
from pnfarm.protocols.enip.wire.forward_open import CYCLIC, ConnectionType, ForwardOpen, Priority, Triad

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from pnfarm.protocols.enip.wire.epath import ElectronicKey

__all__ = [
    "CloseReason",
    "Connection",
    "ConnectionClosed",
    "ConnectionKind",
    "ConnectionOpened",
    "ConnectionRefused",
    "ConnectionSettings",
    "IoOffer",
    "ManagerEvent",
    "ProductionMoved",
    "RpiBelowMinimum",
    "originator_name",
]


_EITHER: Final = frozenset({False, True})
_TYPES: Final[frozenset[int]] = frozenset({ConnectionType.MULTICAST, ConnectionType.POINT_TO_POINT})


class ConnectionKind(StrEnum):
    """Application connection types (CIP volume 1, chapter 3-6.4), and class 3."""

    EXCLUSIVE_OWNER = "exclusive owner"
    INPUT_ONLY = "input only"
    LISTEN_ONLY = "listen only"
    EXPLICIT = "explicit"


class CloseReason(StrEnum):
    FORWARD_CLOSE = "forward-close"
    TIMED_OUT = "timed-out"
    STREAM_CLOSED = "stream-closed"
    OWNER_GONE = "owner-gone"
    ENDED = "ended"


class RpiBelowMinimum(Enum):
    """What a target does with a packet interval below its own."""

    #: The reply's interval of production is the minimum; the originator's own is taken as it is, with its timeout.
    ROUND_UP = "round-up"
    REFUSE = "refuse"
    ACCEPT = "accept"


@dataclass(frozen=True, slots=True)
class IoOffer:
    """One pair of connection points that a class 1 connection may have.

    ``configuration``, ``consumed`` and ``produced`` are instances of the Assembly object; sizes in octets of data
    alone.  An offer of the kinds without an owner consumes a heartbeat: 0 octets.

    ``*_least``: an originator may choose so few octets, None: none but the size.  ``*_variable``: which of fixed
    (False) and variable (True) size it may ask for; ``produced_types``: to an address, to a group.  ``*_rpi_us``: least
    and greatest packet interval, None: any that the target accepts.
    """

    kind: ConnectionKind
    consumed: int
    produced: int
    consumed_octets: int
    produced_octets: int
    configuration: int | None = None
    configuration_octets: int = 0
    consumed_header: bool = True
    produced_header: bool = False
    consumed_least: int | None = None
    produced_least: int | None = None
    consumed_variable: frozenset[bool] = _EITHER
    produced_variable: frozenset[bool] = _EITHER
    produced_types: frozenset[int] = _TYPES
    triggers: frozenset[int] = frozenset({CYCLIC})
    consumed_rpi_us: tuple[int, int] | None = None
    produced_rpi_us: tuple[int, int] | None = None

    @property
    def consumes_header(self) -> bool:
        """Whether what it consumes has the run/idle header; a heartbeat has none."""
        return self.consumed_header and self.consumed_octets > 0

    @property
    def consumed_size(self) -> int:
        """Size as the network connection parameters have it."""
        return 2 + self.consumed_octets + 4 * self.consumes_header

    @property
    def produced_size(self) -> int:
        return 2 + self.produced_octets + 4 * self.produced_header

    @property
    def consumed_sizes(self) -> range:
        """All sizes that an originator may ask for."""
        return _sizes(self.consumed_size, self.consumed_octets, self.consumed_least)

    @property
    def produced_sizes(self) -> range:
        return _sizes(self.produced_size, self.produced_octets, self.produced_least)


def _sizes(size: int, octets: int, least: int | None) -> range:
    return range(size if least is None else size - octets + least, size + 1)


@dataclass(frozen=True, slots=True)
class ConnectionSettings:
    """What a target accepts; intervals in microseconds.  ``key`` is its own identity.

    ``paths_told_apart``: a class that takes no connection (0x0117) and a connection point that is in no offer (0x0129
    to 0x012B) have a status of their own, else every unknown combination is 0x012F.  ``interval_step_us``: the target
    produces at multiples of it, and rounds an interval up.  ``null_open_status`` refuses a Forward_Open that opens
    nothing in either direction (a ping, a reconfiguration), unless it names a connection that is open (0x0100).
    """

    key: ElectronicKey
    offers: tuple[IoOffer, ...]
    multicast_address: IPv4Address
    io_connections: int = 8
    explicit_connections: int = 16
    explicit_size: int = 504
    large_explicit_size: int = 4002
    minimum_rpi_us: int = 10_000
    maximum_rpi_us: int = 10_000_000
    interval_step_us: int = 1
    below_minimum: RpiBelowMinimum = RpiBelowMinimum.ROUND_UP
    null_open_status: int = ConnectionStatus.NULL_FORWARD_OPEN_NOT_SUPPORTED
    paths_told_apart: bool = False
    io_port: int = IO_PORT
    #: Data must have come within so long after Forward_Open at the latest, or its own timeout if that is longer
    #: (CIP volume 1, 3-4.4.2).
    first_data_ns: int = 10_000_000_000


@dataclass(slots=True)
class Connection:
    """One row of the Connection Manager's table; ``number`` is never used twice."""

    number: int
    kind: ConnectionKind
    triad: Triad
    offer: IoOffer | None
    stream: int
    originator: IPv4Address
    o_to_t_id: int
    t_to_o_id: int
    o_to_t_api_us: int
    t_to_o_api_us: int
    timeout_multiplier: int
    o_to_t_size: int
    t_to_o_size: int
    multicast: bool
    destination: tuple[IPv4Address, int]
    #: Priority of what is produced, which chooses its DSCP.
    priority: int = Priority.SCHEDULED
    state: ConnectionState = ConnectionState.NON_EXISTENT
    #: Whether the production began with this connection, or was taken over; others of the same multicast listen to it.
    produces: bool = False
    received: bool = False
    last_count: int | None = None
    last_reply: bytes = field(default=b"", repr=False)

    @property
    def originator_name(self) -> str:
        """See :func:`originator_name`."""
        return originator_name(self.triad)

    @property
    def timeout_ns(self) -> int:
        """Silence of the originator that ends the connection: the interval times 4, 8, ... 512."""
        return (self.o_to_t_api_us * 1000) << (2 + self.timeout_multiplier)

    @property
    def originator_timeout_ns(self) -> int:
        """After this time without the target's data the originator gives up, ns; 0: it gets none."""
        return (self.t_to_o_api_us * 1000) << (2 + self.timeout_multiplier)

    @property
    def consumed_octets(self) -> int:
        """Data that it consumes, of a cyclic connection."""
        return 0 if self.offer is None else self.offer.consumed_octets + self.o_to_t_size - self.offer.consumed_size

    @property
    def produced_octets(self) -> int:
        return 0 if self.offer is None else self.offer.produced_octets + self.t_to_o_size - self.offer.produced_size

    @property
    def explicit(self) -> bool:
        return self.kind is ConnectionKind.EXPLICIT


MAXIMUM_MULTIPLIER: Final = 7


# Events


@dataclass(frozen=True, slots=True)
class ConnectionOpened:
    """``connection`` as it is now.  A producer is needed if ``produces``, a consumer for each I/O connection."""

    connection: Connection


@dataclass(frozen=True, slots=True)
class ConnectionClosed:
    """``before_data``: it timed out and nothing had come at all."""

    connection: Connection
    reason: CloseReason
    before_data: bool = False


@dataclass(frozen=True, slots=True)
class ProductionMoved:
    """The connection that drove a multicast production has ended; another one takes it over as it is."""

    source: Connection
    connection: Connection


@dataclass(frozen=True, slots=True)
class ConnectionRefused:
    """A Forward_Open was refused; ``extended`` has the extended status first."""

    status: int
    extended: tuple[int, ...]
    request: ForwardOpen
    originator: IPv4Address


def originator_name(triad: Triad) -> str:
    """Vendor and serial number of the originator: it has no name."""
    return f"0x{triad.vendor_id:04x}-{triad.originator_serial:08x}"


ManagerEvent = ConnectionOpened | ConnectionClosed | ProductionMoved | ConnectionRefused
