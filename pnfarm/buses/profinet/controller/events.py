"""What happens to a controller and its drives, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.controllers import events as session_events
from pnfarm.buses.controllers.events import ConnectFailed, ConnectionBroken, PhaseChanged, Released
from pnfarm.station.event import Event, Level, event, shown, unshown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.protocols.profinet.lldp.agent import Neighbour

__all__ = [
    "AlarmReceived", "ConnectFailed", "Connected", "ConnectionBroken", "FileRemarked", "IdentificationDiffers",
    "IdentificationUnread", "ModuleDiffers", "NameGivenTwice", "NeighbourAppeared", "NeighbourChanged", "NeighbourGone",
    "ParametersWritten", "PhaseChanged", "Released", "SubmodulesChanged",
]  # fmt: skip


@event()
class Connected(session_events.Connected):
    """See :class:`pnfarm.buses.controllers.events.Connected`; ``mac`` is the drive's."""

    mac: bytes


@event("remark on the GSDML file")
class FileRemarked(Event):
    """A device's GSDML file lacks what its schema version asks for; it was read nevertheless."""

    remark: str


@event("alarm")
class AlarmReceived(Event):
    """An alarm of a drive; ``gone`` when it reports an end."""

    detail: str
    high: bool = shown(lambda high: "high" if high else "low", name="priority")
    gone: bool = unshown()

    @property
    def level(self) -> Level:
        return "info" if self.gone else "warning"


@event("module differs", "warning")
class ModuleDiffers(Event):
    """A drive has other modules than planned."""

    detail: str


@event("submodules changed")
class SubmodulesChanged(Event):
    """Submodules of a drive can be used again, or not any more, each with its reason."""

    unusable: Sequence[str]

    @property
    def level(self) -> Level:
        return "warning" if self.unusable else "info"


@event("parameters written anew")
class ParametersWritten(Event):
    """The start-up records of a connected drive were written again; ``reason`` says why that failed."""

    reason: str

    @property
    def level(self) -> Level:
        return "warning" if self.reason else "info"


@event("name given twice", "warning")
class NameGivenTwice(Event):
    """Two stations answer to a drive's name."""

    reason: str


@event("identification unread", "warning")
class IdentificationUnread(Event):
    """A drive's I&M data could not be read."""

    detail: str


@event("identification differs", "warning")
class IdentificationDiffers(Event):
    """A drive's I&M data are not as planned; it may be an equivalent spare part."""

    what: str
    found: str
    planned: str


@event("neighbour appeared")
class NeighbourAppeared(Event):
    """The controller's port has a neighbour."""

    neighbour: Neighbour = shown(lambda neighbour: neighbour.facts())


@event("neighbour changed")
class NeighbourChanged(NeighbourAppeared):
    """The controller's port has another neighbour."""


@event("neighbour gone")
class NeighbourGone(NeighbourAppeared):
    """The controller's port no longer has a neighbour."""
