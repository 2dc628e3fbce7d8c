"""What happens to a drive on EtherNet/IP; see :mod:`pnfarm.station.events`."""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import IPv4Address  # noqa: TC003 - fields of dataclasses
from typing import Any

from pnfarm.station.events import (
    ConnectionEstablished,
    ConnectionLost,
    ConnectionOpened,
    ConnectionRefused,
    ConnectionReleased,
    Event,
    seconds,
)

__all__ = [
    "AddressConflict",
    "AddressConflictOver",
    "AddressNotUsed",
    "ForwardOpenRefused",
    "IoConnectionEstablished",
    "IoConnectionLost",
    "IoConnectionOpened",
    "IoConnectionReleased",
    "ProductionMoved",
    "SessionEnded",
    "SessionOpened",
]


@dataclass(frozen=True, slots=True)
class SessionOpened(Event):
    """A peer connected by TCP."""

    TEXT = "session opened"
    LEVEL = "debug"
    ip: IPv4Address
    port: int

    def details(self) -> dict[str, Any]:
        return {"ip": str(self.ip), "port": self.port}


@dataclass(frozen=True, slots=True)
class SessionEnded(SessionOpened):
    """A peer's TCP connection ended, whoever closed it."""

    TEXT = "session ended"


@dataclass(frozen=True, slots=True)
class IoConnectionOpened(ConnectionOpened):
    """A Forward_Open of a cyclic connection was accepted; intervals and timeout in ns."""

    kind: str
    ip: IPv4Address
    vendor_id: int
    serial: int
    rpi_ns: int
    production_ns: int
    timeout_ns: int
    multicast: bool

    @property
    def peer(self) -> str:
        return f"0x{self.vendor_id:04x}-{self.serial:08x}"

    def details(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "ip": str(self.ip),
            "originator": self.peer,
            "rpi_seconds": seconds(self.rpi_ns),
            "production_seconds": seconds(self.production_ns),
            "timeout_seconds": seconds(self.timeout_ns),
            "multicast": self.multicast,
        }


@dataclass(frozen=True, slots=True)
class IoConnectionEstablished(ConnectionEstablished):
    """The first data of a cyclic connection came."""

    kind: str
    ip: IPv4Address

    def details(self) -> dict[str, Any]:
        return {"kind": self.kind, "ip": str(self.ip)}


@dataclass(frozen=True, slots=True)
class IoConnectionLost(ConnectionLost):
    """A cyclic connection ended without Forward_Close; ``reason`` as in the metrics."""

    reason: str
    kind: str


@dataclass(frozen=True, slots=True)
class IoConnectionReleased(ConnectionReleased):
    """Forward_Close of a cyclic connection."""

    kind: str

    def details(self) -> dict[str, Any]:
        return {"kind": self.kind}


@dataclass(frozen=True, slots=True)
class ForwardOpenRefused(ConnectionRefused):
    """A Forward_Open was refused; ``extended`` has the extended status first, ``meaning`` says it in words."""

    ip: IPv4Address
    status: int
    extended: tuple[int, ...]
    meaning: str

    def details(self) -> dict[str, Any]:
        return {
            "ip": str(self.ip),
            "status": f"0x{self.status:02X}",
            "extended": [f"0x{word:04X}" for word in self.extended],
            "meaning": self.meaning,
        }


@dataclass(frozen=True, slots=True)
class ProductionMoved(Event):
    """The connection whose interval drove a multicast production ended; another one drives it now."""

    TEXT = "production moved"
    production_ns: int

    def details(self) -> dict[str, Any]:
        return {"production_seconds": seconds(self.production_ns)}


@dataclass(frozen=True, slots=True)
class AddressConflict(Event):
    """Another station has the drive's address; the drive announces it again and keeps it."""

    TEXT = "address conflict"
    LEVEL = "warning"
    ip: IPv4Address
    mac: bytes

    def details(self) -> dict[str, Any]:
        return {"ip": str(self.ip), "mac": self.mac.hex(":")}


@dataclass(frozen=True, slots=True)
class AddressNotUsed(AddressConflict):
    """Another station had the address before the drive did; the drive stays without."""

    TEXT = "address not used"


@dataclass(frozen=True, slots=True)
class AddressConflictOver(Event):
    """No other station uses the drive's address any more."""

    TEXT = "address conflict over"
    ip: IPv4Address

    def details(self) -> dict[str, Any]:
        return {"ip": str(self.ip)}
