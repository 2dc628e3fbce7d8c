"""Event types of a PROFINET device (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.protocols.profinet.errors import describe_status
from pnfarm.protocols.profinet.wire.alarms import alarm_type_text
from pnfarm.protocols.profinet.wire.diagnosis_texts import describe_error_type
from pnfarm.station.events import (
    ConnectionEstablished,
    ConnectionLost,
    ConnectionOpened,
    ConnectionRefused,
    ConnectionReleased,
    Event,
    Level,
    seconds,
)

if TYPE_CHECKING:
    from ipaddress import IPv4Address, IPv4Interface

    from pnfarm.protocols.profinet.ar import ExpectedKey
    from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
    from pnfarm.protocols.profinet.errors import PnioStatus
    from pnfarm.protocols.profinet.lldp import Neighbour
    from pnfarm.protocols.profinet.pdev_checks import CheckFailed, CheckPassed

__all__ = [
    "AddressConflict",
    "AddressConflictOver",
    "AddressNotUsed",
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


# -- connections -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ArConnected(ConnectionOpened):
    """An AR with cyclic data was connected; parametrisation follows."""

    TEXT = "ar connected"
    controller: str
    ip: IPv4Address
    telegram: int
    cycle_ns: int
    watchdog_ns: int

    @property
    def peer(self) -> str:
        return self.controller

    def details(self) -> dict[str, Any]:
        return {
            "controller": self.controller,
            "ip": str(self.ip),
            "telegram": self.telegram,
            "cycle_seconds": seconds(self.cycle_ns),
            "watchdog_seconds": seconds(self.watchdog_ns),
        }


@dataclass(frozen=True, slots=True)
class ArEstablished(ConnectionEstablished):
    """ApplicationReady was confirmed and valid data arrived."""

    TEXT = "ar established"
    controller: str
    cycle_ns: int

    def details(self) -> dict[str, Any]:
        return {"controller": self.controller, "cycle_seconds": seconds(self.cycle_ns)}


@dataclass(frozen=True, slots=True)
class ArAborted(ConnectionLost):
    """An AR ended with an ERR-RTA, ours or the controller's; ``reason`` is the machine's text."""

    TEXT = "ar aborted"
    reason: str
    code1: int
    code2: int
    by_controller: bool


@dataclass(frozen=True, slots=True)
class ArReleased(ConnectionReleased):
    """The controller sent Release."""

    TEXT = "ar released"


@dataclass(frozen=True, slots=True)
class ConnectRefused(ConnectionRefused):
    """A Connect got a negative response."""

    TEXT = "connect refused"
    ip: IPv4Address
    status: PnioStatus
    detail: str

    def details(self) -> dict[str, Any]:
        return {"ip": str(self.ip), "status": str(self.status), "detail": self.detail}


@dataclass(frozen=True, slots=True)
class ApplicationReadyWithheld(Event):
    """An injection suppresses ApplicationReady for this connection."""

    TEXT = "application ready withheld"


@dataclass(frozen=True, slots=True)
class SubmodulesChanged(Event):
    """Submodules of an AR were plugged, pulled or changed owner; ``unusable`` are those that it cannot use now."""

    TEXT = "submodules changed"
    unusable: frozenset[ExpectedKey]

    def details(self) -> dict[str, Any]:
        return {"unusable": [f"{slot}.0x{subslot:04X}" for _, slot, subslot in sorted(self.unusable)]}


@dataclass(frozen=True, slots=True)
class AlarmAcknowledged(Event):
    """The controller acknowledged an alarm."""

    TEXT = "alarm acknowledged"
    alarm_type: int
    slot: int
    subslot: int
    status: PnioStatus

    @property
    def level(self) -> Level:
        return "info" if self.status.ok else "warning"

    def details(self) -> dict[str, Any]:
        return {
            "alarm": alarm_type_text(self.alarm_type),
            "slot": self.slot,
            "subslot": self.subslot,
            "status": describe_status(self.status),
        }


@dataclass(frozen=True, slots=True)
class RecordWritten(Event):
    """A record was accepted."""

    TEXT = "record written"
    LEVEL = "debug"
    octets: int
    api: int
    slot: int
    subslot: int
    index: int


# -- modules and diagnosis ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ModulePulled(Event):
    """A module, or one submodule of it, was pulled."""

    TEXT = "module pulled"
    slot: int
    subslot: int | None


@dataclass(frozen=True, slots=True)
class ModulePlugged(Event):
    """A module was plugged."""

    TEXT = "module plugged"
    slot: int
    module_ident: int
    substitute: bool

    def details(self) -> dict[str, Any]:
        return {"slot": self.slot, "module_ident": f"0x{self.module_ident:08X}", "substitute": self.substitute}


@dataclass(frozen=True, slots=True)
class DiagnosisEvent(Event):
    """Base of events about a submodule's diagnosis."""

    entry: DiagnosisEntry

    def details(self) -> dict[str, Any]:
        entry = self.entry
        return {
            "slot": entry.slot,
            "subslot": entry.subslot,
            "channel": entry.channel,
            "diagnosis": describe_error_type(entry.error_type, entry.ext_error_type, entry.api)
            if entry.channel_coded
            else f"USI 0x{entry.usi:04X} {entry.data.hex(' ', 2).upper()}".rstrip(),
        }


@dataclass(frozen=True, slots=True)
class DiagnosisAppeared(DiagnosisEvent):
    """A diagnosis of a submodule appeared."""

    TEXT = "diagnosis appears"
    LEVEL = "warning"


@dataclass(frozen=True, slots=True)
class DiagnosisDisappeared(DiagnosisEvent):
    """A diagnosis of a submodule disappeared."""

    TEXT = "diagnosis disappears"


# -- name and address --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class NameSet(Event):
    """DCP set the station's name."""

    TEXT = "name set"
    name: str
    permanent: bool


@dataclass(frozen=True, slots=True)
class AddressSet(Event):
    """DCP set the station's address, or cleared it."""

    TEXT = "address set"
    interface: IPv4Interface | None
    permanent: bool

    def details(self) -> dict[str, Any]:
        return {"ip": str(self.interface or ""), "permanent": self.permanent}


@dataclass(frozen=True, slots=True)
class SignalBegan(Event):
    """The drive's lamp flashes (DCP Signal)."""

    TEXT = "signal begins"


@dataclass(frozen=True, slots=True)
class SignalEnded(Event):
    """The drive's lamp stops flashing."""

    TEXT = "signal ends"


@dataclass(frozen=True, slots=True)
class FactoryResetDone(Event):
    """DCP ResetToFactory, with what was cleared."""

    TEXT = "factory reset"
    mode: str
    clears: tuple[str, ...]

    def details(self) -> dict[str, Any]:
        return {"mode": self.mode, "clears": list(self.clears)}


@dataclass(frozen=True, slots=True)
class HelloSet(Event):
    """The record for fast start-up enabled or disabled Hello."""

    TEXT = "hello set"
    mode: str


@dataclass(frozen=True, slots=True)
class FastStartUpNotUnderstood(Event):
    """The record for fast start-up was accepted but cannot be parsed."""

    TEXT = "fast start-up record not understood"
    LEVEL = "warning"
    reason: str


@dataclass(frozen=True, slots=True)
class AddressConflict(Event):
    """Another station has the drive's address."""

    TEXT = "address conflict"
    LEVEL = "warning"
    ip: IPv4Address
    mac: bytes

    def details(self) -> dict[str, Any]:
        return {"ip": str(self.ip), "mac": self.mac.hex(":")}


@dataclass(frozen=True, slots=True)
class AddressNotUsed(AddressConflict):
    """Another station had the address before the drive did."""

    TEXT = "address not used"


@dataclass(frozen=True, slots=True)
class AddressConflictOver(Event):
    """No other station uses the drive's address any more."""

    TEXT = "address conflict over"
    ip: IPv4Address

    def details(self) -> dict[str, Any]:
        return {"ip": str(self.ip)}


# -- neighbours and management -----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class NeighbourEvent(Event):
    """LLDP found a neighbour, or another one in its place."""

    port: str
    neighbour: Neighbour
    appeared: bool

    @property
    def text(self) -> str:
        return "neighbour appeared" if self.appeared else "neighbour changed"

    def details(self) -> dict[str, Any]:
        return _neighbour(self.port, self.neighbour)


@dataclass(frozen=True, slots=True)
class NeighbourLost(Event):
    """LLDP receives no frames of a neighbour any more."""

    TEXT = "neighbour gone"
    port: str
    neighbour: Neighbour
    reason: str

    def details(self) -> dict[str, Any]:
        return {**_neighbour(self.port, self.neighbour), "reason": self.reason}


def _neighbour(port: str, neighbour: Neighbour) -> dict[str, Any]:
    return {
        "port": port,
        "neighbour": neighbour.station_name,
        "neighbour_port": neighbour.port_name,
        "mac": neighbour.mac.hex(":"),
    }


@dataclass(frozen=True, slots=True)
class PortCheckPassed(Event):
    """A port again matches what its controller expects."""

    TEXT = "port check passed"
    check: CheckPassed | CheckFailed

    def details(self) -> dict[str, Any]:
        return {
            "port": f"0x{self.check.subslot:04X}",
            "error_type": f"0x{self.check.error_type:04X}",
            "ext_error_type": f"0x{self.check.ext_error_type:04X}",
        }


@dataclass(frozen=True, slots=True)
class PortCheckFailed(PortCheckPassed):
    """A port does not match what its controller expects."""

    TEXT = "port check failed"
    LEVEL = "warning"
    check: CheckFailed

    def details(self) -> dict[str, Any]:
        return {**PortCheckPassed.details(self), "detail": self.check.detail}


@dataclass(frozen=True, slots=True)
class SystemTextSet(Event):
    """An SNMP manager wrote one of the system's texts."""

    TEXT = "system text set"
    text_written: str
    name: str

    def details(self) -> dict[str, Any]:
        return {"text": self.text_written, "object": f"sys{self.name}"}
