"""What happens to a drive on EtherNet/IP; see :mod:`pnfarm.station.events`."""

from __future__ import annotations

from ipaddress import IPv4Address  # noqa: TC003 - fields of dataclasses

from pnfarm.station.event import BY_PEER, Event, event, shown
from pnfarm.station.events import (
    ConnectionEstablished,
    ConnectionLost,
    ConnectionOpened,
    ConnectionRefused,
    ConnectionReleased,
)

__all__ = [
    "ForwardOpenRefused",
    "IoConnectionEstablished",
    "IoConnectionLost",
    "IoConnectionOpened",
    "IoConnectionReleased",
    "ProductionMoved",
    "SessionEnded",
    "SessionOpened",
]


@event("session opened", "debug", pace=BY_PEER)
class SessionOpened(Event):
    """A peer connected by TCP."""

    ip: IPv4Address
    port: int


@event("session ended")
class SessionEnded(SessionOpened):
    """A peer's TCP connection ended, whichever end closed it."""


@event()
class IoConnectionOpened(ConnectionOpened):
    """A Forward_Open of a cyclic connection was accepted; intervals and timeout in ns."""

    kind: str
    ip: IPv4Address
    originator: str
    rpi_ns: int
    production_ns: int
    timeout_ns: int
    multicast: bool

    @property
    def peer(self) -> str:
        return self.originator


@event()
class IoConnectionEstablished(ConnectionEstablished):
    """The first data of a cyclic connection came."""

    kind: str
    ip: IPv4Address


@event()
class IoConnectionLost(ConnectionLost):
    """A cyclic connection ended without Forward_Close; ``reason`` as in the metrics."""

    reason: str
    kind: str


@event()
class IoConnectionReleased(ConnectionReleased):
    """Forward_Close of a cyclic connection."""

    kind: str


@event()
class ForwardOpenRefused(ConnectionRefused):
    """A Forward_Open was refused; ``extended`` has the extended status first, ``meaning`` says it in words."""

    ip: IPv4Address
    status: int = shown("0x{:02X}".format)
    extended: tuple[int, ...] = shown(lambda words: [f"0x{word:04X}" for word in words])
    meaning: str


@event("production moved", pace=BY_PEER)
class ProductionMoved(Event):
    """The connection with which a multicast production began ended; it goes on for another one."""

    production_ns: int
