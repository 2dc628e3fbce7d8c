"""What happens to a drive on PROFIBUS; see :mod:`pnfarm.station.events`."""

from __future__ import annotations

from dataclasses import dataclass
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
    "AcyclicConnectionEnded",
    "AcyclicConnectionOpened",
    "AddressChanged",
    "BaudRateFound",
    "BaudRateLost",
    "ConfigurationRefused",
    "DataExchangeBegan",
    "DataExchangeLost",
    "ParametersRefused",
    "ParametersTaken",
    "SlaveReleased",
]


@dataclass(frozen=True, slots=True)
class ParametersTaken(ConnectionOpened):
    """A master parametrised the slave (Set_Prm); ``watchdog_ns`` is 0 without a watchdog."""

    master: int
    watchdog_ns: int

    def details(self) -> dict[str, Any]:
        return {"master": self.master, "watchdog_seconds": seconds(self.watchdog_ns)}


@dataclass(frozen=True, slots=True)
class DataExchangeBegan(ConnectionEstablished):
    """The first Data_Exchange behind Set_Prm and Chk_Cfg."""

    master: int
    telegram: int

    def details(self) -> dict[str, Any]:
        return {"master": self.master, "telegram": self.telegram}


@dataclass(frozen=True, slots=True)
class DataExchangeLost(ConnectionLost):
    """The slave left its data exchange without being released; ``reason`` as in the metrics."""

    reason: str
    master: int


@dataclass(frozen=True, slots=True)
class SlaveReleased(ConnectionReleased):
    """The master released the slave (Set_Prm with Unlock_Req, or the farm stops)."""

    master: int

    def details(self) -> dict[str, Any]:
        return {"master": self.master}


@dataclass(frozen=True, slots=True)
class ParametersRefused(ConnectionRefused):
    """A Set_Prm does not fit the slave (Prm_Fault); ``meaning`` says why."""

    master: int
    meaning: str

    def details(self) -> dict[str, Any]:
        return {"master": self.master, "meaning": self.meaning}


@dataclass(frozen=True, slots=True)
class ConfigurationRefused(ConnectionRefused):
    """A Chk_Cfg does not fit the slave (Cfg_Fault); ``identifiers`` as the master sent them."""

    master: int
    identifiers: bytes

    def details(self) -> dict[str, Any]:
        return {"master": self.master, "identifiers": self.identifiers.hex(" ")}


@dataclass(frozen=True, slots=True)
class AddressChanged(Event):
    """The slave has another station address from now on; ``by`` says by what."""

    TEXT = "station address changed"
    address: int
    by: str


@dataclass(frozen=True, slots=True)
class BaudRateFound(Event):
    """The slave heard telegrams at the line's rate: it answers from now on."""

    TEXT = "baud rate found"
    baud: int


@dataclass(frozen=True, slots=True)
class BaudRateLost(Event):
    """The line has been silent, or told nothing but garbage: the slave seeks the baud rate."""

    TEXT = "seeking baud rate"


@dataclass(frozen=True, slots=True)
class AcyclicConnectionOpened(Event):
    """A master of class 2 opened a connection; ``sap`` is the slave's access point of it."""

    TEXT = "acyclic connection opened"
    master: int
    sap: int


@dataclass(frozen=True, slots=True)
class AcyclicConnectionEnded(AcyclicConnectionOpened):
    """Such a connection ended; ``reason`` says why."""

    TEXT = "acyclic connection ended"
    reason: str
