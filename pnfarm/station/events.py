"""What happens to a drive, as types: subscribers of the log select events by class.

An event holds facts, not sentences.  ``text`` is its name in the log and the API's event stream, a few lower-case
words that rigs may search for; :meth:`Event.details` are the plain values beside it.  Events of one bus are declared
in that bus's room, as subclasses of what they are on any bus: an AR that was established is a
:class:`ConnectionEstablished`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, ClassVar, Literal

if TYPE_CHECKING:
    from pnfarm.station.lateness import Lateness

__all__ = [
    "AcknowledgeRefused",
    "Booted",
    "ConnectionEstablished",
    "ConnectionLost",
    "ConnectionOpened",
    "ConnectionRefused",
    "ConnectionReleased",
    "ControlBitChanged",
    "ControllerModeChanged",
    "Event",
    "FaultRaised",
    "FaultReacted",
    "FaultsCleared",
    "Level",
    "MemoryNotTaken",
    "MemoryNotWritten",
    "OutputsChanged",
    "ParametersSaved",
    "PowerLost",
    "PowerReturned",
    "StartUpPhase",
    "StateChanged",
    "TelegramChanged",
    "WarningChanged",
    "WatchdogExpired",
    "seconds",
]

Level = Literal["debug", "info", "warning", "error"]


def seconds(ns: int) -> float:
    """Times leave the program in seconds."""
    return ns / 1e9


@dataclass(frozen=True, slots=True)
class Event:
    """Base of all events; see the module's docstring."""

    TEXT: ClassVar[str] = ""
    LEVEL: ClassVar[Level] = "info"

    @property
    def text(self) -> str:
        """Its text in the log."""
        return self.TEXT

    @property
    def level(self) -> Level:
        """Severity in the log."""
        return self.LEVEL

    def details(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {one.name: getattr(self, one.name) for one in fields(self)}


# -- power -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class PowerLost(Event):
    """The control supply was switched off."""

    TEXT = "power off"


@dataclass(frozen=True, slots=True)
class PowerReturned(Event):
    """The control supply was switched on."""

    TEXT = "power on"


@dataclass(frozen=True, slots=True)
class Booted(Event):
    """The drive receives and sends; ``after_ns`` from power-on."""

    TEXT = "booted"
    after_ns: int

    def details(self) -> dict[str, Any]:
        return {"after_seconds": seconds(self.after_ns)}


# -- the connection to a controller ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ConnectionOpened(Event):
    """A controller requested a connection and got it; data may flow.

    ``connection`` is the same in all events of one connection, and of no other one of the drive at that time.
    """

    TEXT = "connection opened"
    connection: int = field(default=0, kw_only=True)

    @property
    def peer(self) -> str:
        """The controller's name, where its bus has one."""
        return ""

    def details(self) -> dict[str, Any]:
        return {}


@dataclass(frozen=True, slots=True)
class ConnectionRefused(Event):
    """A controller requested a connection that the drive refused."""

    TEXT = "connection refused"
    LEVEL = "warning"


@dataclass(frozen=True, slots=True)
class StartUpPhase(Event):
    """A controller finished a step on its way to data exchange, for which its bus has no event of its own."""

    TEXT = "start-up phase"
    LEVEL = "debug"
    phase: Literal["identify", "address", "parameters", "ready"]
    #: See :class:`ConnectionOpened`; None before there is one.
    connection: int | None = None

    def details(self) -> dict[str, Any]:
        return {"phase": self.phase}


@dataclass(frozen=True, slots=True)
class ConnectionEstablished(Event):
    """Valid data flow both ways."""

    TEXT = "connection established"
    connection: int = field(default=0, kw_only=True)

    def details(self) -> dict[str, Any]:
        return {}


@dataclass(frozen=True, slots=True)
class ConnectionLost(Event):
    """A connection ended without being released; ``lateness`` is the farm's own before it."""

    TEXT = "connection lost"
    LEVEL = "warning"
    lateness: Lateness | None = field(default=None, kw_only=True)
    connection: int = field(default=0, kw_only=True)

    def details(self) -> dict[str, Any]:
        others = {"lateness", "connection"}
        values = {one.name: getattr(self, one.name) for one in fields(self) if one.name not in others}
        return values if self.lateness is None else {**values, **self.lateness.as_dict()}


@dataclass(frozen=True, slots=True)
class ConnectionReleased(Event):
    """The controller ended the connection in order."""

    TEXT = "connection released"
    connection: int = field(default=0, kw_only=True)

    def details(self) -> dict[str, Any]:
        return {}


@dataclass(frozen=True, slots=True)
class WatchdogExpired(Event):
    """No valid data came from the controller for too long; ``lateness`` is the farm's own in that time."""

    TEXT = "watchdog expired"
    LEVEL = "warning"
    silent_ns: int
    lateness: Lateness | None = None
    connection: int = field(default=0, kw_only=True)

    def details(self) -> dict[str, Any]:
        own = {} if self.lateness is None else self.lateness.as_dict()
        return {"silent_seconds": seconds(self.silent_ns), **own}


@dataclass(frozen=True, slots=True)
class ControllerModeChanged(Event):
    """The controller's program runs, or stopped."""

    run: bool

    @property
    def text(self) -> str:
        return "controller in run" if self.run else "controller in stop"

    def details(self) -> dict[str, Any]:
        return {}


@dataclass(frozen=True, slots=True)
class OutputsChanged(Event):
    """The received set points became valid, or invalid."""

    good: bool

    @property
    def text(self) -> str:
        return "outputs good" if self.good else "outputs bad"

    def details(self) -> dict[str, Any]:
        return {}


# -- the drive ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class StateChanged(Event):
    """The drive's state machine moved: numbers of states, S1 to S5."""

    TEXT = "state changed"
    before: int
    after: int

    def details(self) -> dict[str, Any]:
        return {"before": f"S{self.before}", "after": f"S{self.after}"}


@dataclass(frozen=True, slots=True)
class FaultRaised(Event):
    """The drive raised a fault; ``number`` is its model's."""

    TEXT = "fault"
    LEVEL = "warning"
    number: int


@dataclass(frozen=True, slots=True)
class FaultReacted(Event):
    """The controller withdrew the enable; ``after_ns`` from the fault."""

    TEXT = "controller reacted to fault"
    after_ns: int

    def details(self) -> dict[str, Any]:
        return {"after_seconds": seconds(self.after_ns)}


@dataclass(frozen=True, slots=True)
class ControlBitChanged(Event):
    """A bit of control word 1 changed for the first time since the fault; ``after_ns`` from the fault."""

    TEXT = "control word changed after fault"
    LEVEL = "debug"
    bit: int
    value: int
    after_ns: int

    def details(self) -> dict[str, Any]:
        return {"bit": self.bit, "value": self.value, "after_seconds": seconds(self.after_ns)}


@dataclass(frozen=True, slots=True)
class FaultsCleared(Event):
    """Every fault was acknowledged; ``after_ns`` from the first fault."""

    TEXT = "fault acknowledged"
    after_ns: int

    def details(self) -> dict[str, Any]:
        return {"after_seconds": seconds(self.after_ns)}


@dataclass(frozen=True, slots=True)
class AcknowledgeRefused(Event):
    """An injection had the drive ignore a request to acknowledge; ``number`` of them since the farm started."""

    TEXT = "acknowledgement ignored"
    LEVEL = "warning"
    number: int


@dataclass(frozen=True, slots=True)
class WarningChanged(Event):
    """The drive shows another warning; 0 for none."""

    TEXT = "warning"
    number: int


# -- memory ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class MemoryNotWritten(Event):
    """Non-volatile memory could not be written; ``refused``: what was asked for was refused, else it is held."""

    TEXT = "memory not written"
    LEVEL = "warning"
    reason: str
    refused: bool


@dataclass(frozen=True, slots=True)
class ParametersSaved(Event):
    """The parameters went into non-volatile memory."""

    TEXT = "parameters saved"


@dataclass(frozen=True, slots=True)
class MemoryNotTaken(Event):
    """Contents of non-volatile memory do not fit the drive any more; ``first`` of ``count`` entries."""

    TEXT = "memory not taken"
    LEVEL = "warning"
    count: int
    first: str


@dataclass(frozen=True, slots=True)
class TelegramChanged(Event):
    """Another telegram is in force."""

    TEXT = "telegram changed"
    telegram: int
