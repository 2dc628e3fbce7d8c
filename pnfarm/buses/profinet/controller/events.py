"""What happens to a controller and its drives, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.buses.axis_program import PHASES
from pnfarm.station.events import Event, Level, seconds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.protocols.profinet.lldp import Neighbour

__all__ = [
    "AlarmReceived",
    "ConnectFailed",
    "Connected",
    "ConnectionBroken",
    "FileRemarked",
    "IdentificationDiffers",
    "IdentificationUnread",
    "ModuleDiffers",
    "NameGivenTwice",
    "NeighbourAppeared",
    "NeighbourChanged",
    "NeighbourGone",
    "ParametersWritten",
    "PhaseChanged",
    "Released",
    "SubmodulesChanged",
]


@dataclass(frozen=True, slots=True)
class FileRemarked(Event):
    """A device's GSDML file lacks what its schema version asks for; it was read nevertheless."""

    TEXT = "remark on the GSDML file"
    remark: str


@dataclass(frozen=True, slots=True)
class Connected(Event):
    """The connection to a drive is established, so long after the search for the drive began."""

    TEXT = "connected"
    after_ns: int
    mac: bytes

    def details(self) -> dict[str, Any]:
        return {"connect_seconds": seconds(self.after_ns), "mac": self.mac.hex(":")}


@dataclass(frozen=True, slots=True)
class ConnectFailed(Event):
    """A drive could not be connected."""

    TEXT = "connect failed"
    LEVEL = "warning"
    reason: str


@dataclass(frozen=True, slots=True)
class ConnectionBroken(Event):
    """An established connection to a drive ended without a release."""

    TEXT = "connection lost"
    LEVEL = "warning"
    reason: str


@dataclass(frozen=True, slots=True)
class Released(Event):
    """The controller ended the connection to a drive in order."""

    TEXT = "released"


@dataclass(frozen=True, slots=True)
class PhaseChanged(Event):
    """An axis program goes on: numbers of :mod:`pnfarm.table.program`."""

    before: int
    after: int

    @property
    def text(self) -> str:
        return f"axis {PHASES[self.after]}"

    def details(self) -> dict[str, Any]:
        return {"before": PHASES[self.before]}


@dataclass(frozen=True, slots=True)
class AlarmReceived(Event):
    """An alarm of a drive; ``gone`` when it reports an end."""

    TEXT = "alarm"
    detail: str
    high: bool
    gone: bool

    @property
    def level(self) -> Level:
        return "info" if self.gone else "warning"

    def details(self) -> dict[str, Any]:
        return {"detail": self.detail, "priority": "high" if self.high else "low"}


@dataclass(frozen=True, slots=True)
class ModuleDiffers(Event):
    """A drive has other modules than planned."""

    TEXT = "module differs"
    LEVEL = "warning"
    detail: str


@dataclass(frozen=True, slots=True)
class SubmodulesChanged(Event):
    """Submodules of a drive can be used again, or not any more, each with its reason."""

    TEXT = "submodules changed"
    unusable: Sequence[str]

    @property
    def level(self) -> Level:
        return "warning" if self.unusable else "info"

    def details(self) -> dict[str, Any]:
        return {"unusable": list(self.unusable)}


@dataclass(frozen=True, slots=True)
class ParametersWritten(Event):
    """The start-up records of a connected drive were written again; ``reason`` says why that failed."""

    TEXT = "parameters written anew"
    reason: str

    @property
    def level(self) -> Level:
        return "warning" if self.reason else "info"


@dataclass(frozen=True, slots=True)
class NameGivenTwice(Event):
    """Two stations answer to a drive's name."""

    TEXT = "name given twice"
    LEVEL = "warning"
    reason: str


@dataclass(frozen=True, slots=True)
class IdentificationUnread(Event):
    """A drive's I&M data could not be read."""

    TEXT = "identification unread"
    LEVEL = "warning"
    detail: str


@dataclass(frozen=True, slots=True)
class IdentificationDiffers(Event):
    """A drive's I&M data are not as planned; it may be an equivalent spare part."""

    TEXT = "identification differs"
    LEVEL = "warning"
    what: str
    found: str
    planned: str


@dataclass(frozen=True, slots=True)
class NeighbourAppeared(Event):
    """The controller's port has a neighbour."""

    TEXT = "neighbour appeared"
    neighbour: Neighbour

    def details(self) -> dict[str, Any]:
        neighbour = self.neighbour
        return {
            "neighbour": neighbour.station_name,
            "neighbour_port": neighbour.port_name,
            "mac": neighbour.mac.hex(":"),
        }


@dataclass(frozen=True, slots=True)
class NeighbourChanged(NeighbourAppeared):
    """The controller's port has another neighbour."""

    TEXT = "neighbour changed"


@dataclass(frozen=True, slots=True)
class NeighbourGone(NeighbourAppeared):
    """The controller's port no longer has a neighbour."""

    TEXT = "neighbour gone"
