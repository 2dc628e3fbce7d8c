"""What happens to a drive on PROFIBUS; see :mod:`pnfarm.station.events`."""

from __future__ import annotations

from pnfarm.station.event import ATTEMPT, BY_PEER, Event, event, shown
from pnfarm.station.events import (
    ConnectionEstablished,
    ConnectionLost,
    ConnectionOpened,
    ConnectionRefused,
    ConnectionReleased,
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
    "ParametersDoubted",
    "ParametersRefused",
    "ParametersTaken",
    "SlaveReleased",
]


@event()
class ParametersTaken(ConnectionOpened):
    """A master parametrised the slave (Set_Prm); ``watchdog_ns`` is 0 without a watchdog."""

    master: int
    watchdog_ns: int


@event()
class DataExchangeBegan(ConnectionEstablished):
    """The first Data_Exchange after Set_Prm and Chk_Cfg."""

    master: int
    telegram: int


@event()
class DataExchangeLost(ConnectionLost):
    """The slave left its data exchange without being released; ``reason`` as in the metrics."""

    reason: str
    master: int


@event()
class SlaveReleased(ConnectionReleased):
    """The master released the slave (Set_Prm with Unlock_Req, or the farm stops)."""

    master: int


@event()
class ParametersRefused(ConnectionRefused):
    """A Set_Prm does not fit the slave (Prm_Fault); ``meaning`` says why."""

    master: int
    meaning: str


@event("parameters accepted though they are wrong", "warning", pace=ATTEMPT)
class ParametersDoubted(Event):
    """The user's octets of a Set_Prm do not fit what the device's file says; its limits are lax, so they are kept."""

    master: int
    meaning: str


@event()
class ConfigurationRefused(ConnectionRefused):
    """A Chk_Cfg does not fit the slave (Cfg_Fault); ``identifiers`` as the master sent them."""

    master: int
    identifiers: bytes = shown(lambda octets: octets.hex(" "))


@event("station address changed", pace=BY_PEER)
class AddressChanged(Event):
    """The slave has another station address from now on; ``by`` says by what."""

    address: int
    by: str


@event("baud rate found", pace=BY_PEER)
class BaudRateFound(Event):
    """The slave heard telegrams at the line's rate: it answers from now on."""

    baud: int


@event("seeking baud rate", pace=BY_PEER)
class BaudRateLost(Event):
    """The line has been silent, or carried nothing but garbage: the slave seeks the baud rate."""


@event("acyclic connection opened", pace=BY_PEER)
class AcyclicConnectionOpened(Event):
    """A master of class 2 opened a connection; ``sap`` is the slave's access point of it."""

    master: int
    sap: int


@event("acyclic connection ended")
class AcyclicConnectionEnded(AcyclicConnectionOpened):
    """Such a connection ended; ``reason`` says why."""

    reason: str
