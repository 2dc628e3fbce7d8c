"""Event types of a PROFINET device (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.protocols.profinet.errors import describe_status
from pnfarm.protocols.profinet.wire.alarms.notification import alarm_type_text
from pnfarm.station.event import BY_PEER, Event, Level, event, shown, unshown
from pnfarm.station.events import (
    ConnectionEstablished,
    ConnectionLost,
    ConnectionOpened,
    ConnectionRefused,
    ConnectionReleased,
    StationRenamed,
)

if TYPE_CHECKING:
    from ipaddress import IPv4Address, IPv4Interface

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
    from pnfarm.protocols.profinet.errors import PnioStatus
    from pnfarm.protocols.profinet.lldp.agent import Neighbour
    from pnfarm.protocols.profinet.records.pdev_checks import CheckFailed, CheckPassed

__all__ = [
    "AddressSet",
    "AlarmAcknowledged",
    "ApplicationReadyWithheld",
    "ArAborted",
    "ArConnected",
    "ArEstablished",
    "ArReleased",
    "ConnectRefused",
    "DiagnosisAppeared",
    "DiagnosisDisappeared",
    "DiagnosisEvent",
    "FactoryResetDone",
    "FastStartUpNotUnderstood",
    "HelloSet",
    "IsochronousIgnored",
    "ModulePlugged",
    "ModulePulled",
    "NameSet",
    "NeighbourEvent",
    "NeighbourLost",
    "PortCheckFailed",
    "PortCheckPassed",
    "RecordWritten",
    "SignalBegan",
    "SignalEnded",
    "SubmodulesChanged",
    "SystemTextSet",
]


def _places(unusable: frozenset[ExpectedKey]) -> list[str]:
    return [f"{slot}.0x{subslot:04X}" for _, slot, subslot in sorted(unusable)]


def _of_entry(entry: DiagnosisEntry) -> dict[str, Any]:
    return {
        "slot": entry.slot,
        "subslot": entry.subslot,
        "channel": entry.channel,
    }


def _of_check(check: CheckPassed | CheckFailed) -> dict[str, Any]:
    return {
        "port": f"0x{check.subslot:04X}",
        "error_type": f"0x{check.error_type:04X}",
        "ext_error_type": f"0x{check.ext_error_type:04X}",
    }


# -- connections -------------------------------------------------------------------------------------------------------


@event("ar connected")
class ArConnected(ConnectionOpened):
    """An AR with cyclic data was connected; parametrisation follows."""

    controller: str
    ip: IPv4Address
    telegram: int
    cycle_ns: int
    watchdog_ns: int

    @property
    def peer(self) -> str:
        return self.controller


@event("ar established")
class ArEstablished(ConnectionEstablished):
    """ApplicationReady was confirmed and valid data arrived."""

    controller: str
    cycle_ns: int


@event("ar aborted")
class ArAborted(ConnectionLost):
    """An AR ended with an ERR-RTA, ours or the controller's; ``reason`` is the machine's text."""

    reason: str
    code1: int
    code2: int
    by_controller: bool


@event("ar released")
class ArReleased(ConnectionReleased):
    """The controller sent Release."""


@event("connect refused")
class ConnectRefused(ConnectionRefused):
    """A Connect got a negative response."""

    ip: IPv4Address
    status: PnioStatus = shown(str)
    detail: str


@event("application ready withheld", pace=BY_PEER)
class ApplicationReadyWithheld(Event):
    """An injection suppresses ApplicationReady for this connection."""


@event("submodules changed", pace=BY_PEER)
class SubmodulesChanged(Event):
    """Submodules of an AR were plugged, pulled or changed owner; ``unusable`` are those that it cannot use now."""

    unusable: frozenset[ExpectedKey] = shown(_places)


@event("alarm acknowledged")
class AlarmAcknowledged(Event):
    """The controller acknowledged an alarm."""

    alarm_type: int = shown(alarm_type_text, name="alarm")
    slot: int
    subslot: int
    status: PnioStatus = shown(describe_status)

    @property
    def level(self) -> Level:
        return "info" if self.status.ok else "warning"


@event("record written", "debug", pace=BY_PEER)
class RecordWritten(Event):
    """A record was accepted."""

    octets: int
    api: int
    slot: int
    subslot: int
    index: int


@event("isochronous operation ignored", pace=BY_PEER)
class IsochronousIgnored(Event):
    """A controller asked for it: the record was taken, and the drive runs in RT without the clock."""

    slot: int
    subslot: int
    index: int


# -- modules and diagnosis ---------------------------------------------------------------------------------------------


@event("module pulled")
class ModulePulled(Event):
    """A module, or one submodule of it, was pulled."""

    slot: int
    subslot: int | None


@event("module plugged")
class ModulePlugged(Event):
    """A module was plugged."""

    slot: int
    module_ident: int = shown("0x{:08X}".format)
    substitute: bool


@event(pace=BY_PEER)
class DiagnosisEvent(Event):
    """Base of events about a submodule's diagnosis; ``diagnosis`` is what it says."""

    entry: DiagnosisEntry = shown(_of_entry)
    diagnosis: str


@event("diagnosis appears", "warning")
class DiagnosisAppeared(DiagnosisEvent):
    """A diagnosis of a submodule appeared."""


@event("diagnosis disappears")
class DiagnosisDisappeared(DiagnosisEvent):
    """A diagnosis of a submodule disappeared."""


# -- name and address --------------------------------------------------------------------------------------------------


@event("name set")
class NameSet(StationRenamed):
    """DCP set the station's name."""

    name: str
    permanent: bool


@event("address set", pace=BY_PEER)
class AddressSet(Event):
    """DCP set the station's address, or cleared it."""

    interface: IPv4Interface | None = shown(lambda interface: str(interface or ""), name="ip")
    permanent: bool


@event("signal begins", pace=BY_PEER)
class SignalBegan(Event):
    """The drive's lamp flashes (DCP Signal)."""


@event("signal ends", pace=BY_PEER)
class SignalEnded(Event):
    """The drive's lamp stops flashing."""


@event("factory reset")
class FactoryResetDone(StationRenamed):
    """DCP ResetToFactory, with what was cleared."""

    mode: str
    clears: tuple[str, ...]


@event("hello set", pace=BY_PEER)
class HelloSet(Event):
    """The record for fast start-up enabled or disabled Hello."""

    mode: str


@event("fast start-up record not understood", "warning", pace=BY_PEER)
class FastStartUpNotUnderstood(Event):
    """The record for fast start-up was accepted but cannot be parsed."""

    reason: str


# -- neighbours and management -----------------------------------------------------------------------------------------


@event(pace=BY_PEER)
class NeighbourEvent(Event):
    """LLDP found a neighbour, or another one in its place."""

    port: str
    neighbour: Neighbour = shown(lambda neighbour: neighbour.facts())
    appeared: bool = unshown()

    @property
    def text(self) -> str:
        return "neighbour appeared" if self.appeared else "neighbour changed"


@event("neighbour gone", pace=BY_PEER)
class NeighbourLost(Event):
    """LLDP receives no frames of a neighbour any more."""

    port: str
    neighbour: Neighbour = shown(lambda neighbour: neighbour.facts())
    reason: str


@event("port check passed", pace=BY_PEER)
class PortCheckPassed(Event):
    """A port again matches what its controller expects."""

    check: CheckPassed | CheckFailed = shown(_of_check)


@event("port check failed", "warning")
class PortCheckFailed(PortCheckPassed):
    """A port does not match what its controller expects."""

    check: CheckFailed = shown(lambda check: {**_of_check(check), "detail": check.detail})


@event("system text set", pace=BY_PEER)
class SystemTextSet(Event):
    """An SNMP manager wrote one of the system's texts."""

    text_written: str = shown(name="text")
    name: str = shown("sys{}".format, name="object")
