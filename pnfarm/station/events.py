"""What happens to a drive, as types: subscribers of the log select events by class.

An event holds facts, not sentences (:mod:`pnfarm.station.event`).  Events of one bus are declared in that bus's room,
as subclasses of what they are on any bus: an AR that was established is a :class:`ConnectionEstablished`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from pnfarm.station.event import ATTEMPT, BY_PEER, Event, event, shown, unshown

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from pnfarm.station.lateness import Lateness

__all__ = [
    "AcknowledgeRefused",
    "AddressConflict",
    "AddressConflictOver",
    "AddressNotUsed",
    "Booted",
    "ConnectionEstablished",
    "ConnectionLost",
    "ConnectionOpened",
    "ConnectionRefused",
    "ConnectionReleased",
    "ControlBitChanged",
    "ControllerModeChanged",
    "FaultRaised",
    "FaultReacted",
    "FaultsCleared",
    "MemoryNotTaken",
    "MemoryNotWritten",
    "OutputsChanged",
    "ParametersSaved",
    "PowerLost",
    "PowerReturned",
    "StartUpPhase",
    "StateChanged",
    "StationRenamed",
    "TelegramChanged",
    "WarningChanged",
    "WatchdogExpired",
]


def _of_lateness(lateness: Lateness | None) -> dict[str, Any]:
    return {} if lateness is None else lateness.as_dict()


def _in_profile_words(state: int) -> str:
    return f"S{state}"


# -- power -------------------------------------------------------------------------------------------------------------


@event("power off")
class PowerLost(Event):
    """The control supply was switched off."""


@event("power on")
class PowerReturned(Event):
    """The control supply was switched on."""


@event("booted")
class Booted(Event):
    """The drive receives and sends; ``after_ns`` from power-on."""

    after_ns: int


# -- the connection to a controller ------------------------------------------------------------------------------------


@event("connection opened", pace=ATTEMPT)
class ConnectionOpened(Event):
    """A controller requested a connection and got it; data may flow.

    ``connection`` is the same in all events of one connection, and of no other one of the drive at that time.
    """

    connection: int = unshown(default=0, kw_only=True)

    @property
    def peer(self) -> str:
        """The controller's name, where its bus has one."""
        return ""


@event("connection refused", "warning", pace=ATTEMPT)
class ConnectionRefused(Event):
    """A controller requested a connection that the drive refused."""


@event("start-up phase", "debug", pace=ATTEMPT)
class StartUpPhase(Event):
    """A controller finished a step on its way to data exchange, for which its bus has no event of its own."""

    phase: Literal["identify", "address", "parameters", "ready"]
    #: See :class:`ConnectionOpened`; None before there is one.
    connection: int | None = unshown(default=None)


@event("connection established", pace=BY_PEER)
class ConnectionEstablished(Event):
    """Valid data flow both ways."""

    connection: int = unshown(default=0, kw_only=True)


@event("connection lost", "warning", pace=ATTEMPT)
class ConnectionLost(Event):
    """A connection ended without being released; ``lateness`` is the farm's own before it."""

    lateness: Lateness | None = shown(_of_lateness, default=None, kw_only=True)
    connection: int = unshown(default=0, kw_only=True)


@event("connection released", pace=ATTEMPT)
class ConnectionReleased(Event):
    """The controller ended the connection in order."""

    connection: int = unshown(default=0, kw_only=True)


@event("watchdog expired", "warning", pace=ATTEMPT)
class WatchdogExpired(Event):
    """No valid data came from the controller for too long; ``lateness`` is the farm's own in that time."""

    silent_ns: int
    lateness: Lateness | None = shown(_of_lateness, default=None)
    connection: int = unshown(default=0, kw_only=True)


@event(pace=BY_PEER)
class ControllerModeChanged(Event):
    """The controller's program runs, or stopped."""

    run: bool = unshown()

    @property
    def text(self) -> str:
        return "controller in run" if self.run else "controller in stop"


@event(pace=BY_PEER)
class OutputsChanged(Event):
    """The received set points became valid, or invalid."""

    good: bool = unshown()

    @property
    def text(self) -> str:
        return "outputs good" if self.good else "outputs bad"


# -- its name ----------------------------------------------------------------------------------------------------------


@event(pace=BY_PEER)
class StationRenamed(Event):
    """The station may have another name on its bus."""


# -- its address, on buses with IP ------------------------------------------------------------------------------------


@event("address conflict", "warning", pace=BY_PEER)
class AddressConflict(Event):
    """Another station has the drive's address."""

    ip: IPv4Address
    mac: bytes


@event("address not used", pace=BY_PEER)
class AddressNotUsed(AddressConflict):
    """Another station had the address before the drive did."""


@event("address conflict over", pace=BY_PEER)
class AddressConflictOver(Event):
    """No other station uses the drive's address any more."""

    ip: IPv4Address


# -- the drive ---------------------------------------------------------------------------------------------------------


@event("state changed")
class StateChanged(Event):
    """The drive's state machine moved: numbers of states, S1 to S5."""

    before: int = shown(_in_profile_words)
    after: int = shown(_in_profile_words)


@event("fault", "warning")
class FaultRaised(Event):
    """The drive raised a fault; ``number`` is its model's."""

    number: int


@event("controller reacted to fault")
class FaultReacted(Event):
    """The controller withdrew the enable; ``after_ns`` from the fault."""

    after_ns: int


@event("control word changed after fault", "debug")
class ControlBitChanged(Event):
    """A bit of control word 1 changed for the first time since the fault; ``after_ns`` from the fault."""

    bit: int
    value: int
    after_ns: int


@event("fault acknowledged")
class FaultsCleared(Event):
    """Every fault was acknowledged; ``after_ns`` from the first fault."""

    after_ns: int


@event("acknowledgement ignored", "warning", pace=BY_PEER)
class AcknowledgeRefused(Event):
    """An injection had the drive ignore a request to acknowledge; ``number`` of them since the farm started."""

    number: int


@event("warning")
class WarningChanged(Event):
    """The drive shows another warning; 0 for none."""

    number: int


# -- memory ------------------------------------------------------------------------------------------------------------


@event("memory not written", "warning", pace=BY_PEER)
class MemoryNotWritten(Event):
    """Non-volatile memory could not be written; ``refused``: what was asked for was refused, else it is held."""

    reason: str
    refused: bool


@event("parameters saved", pace=BY_PEER)
class ParametersSaved(Event):
    """The parameters went into non-volatile memory."""


@event("memory not taken", "warning")
class MemoryNotTaken(Event):
    """Contents of non-volatile memory do not fit the drive any more; ``first`` of ``count`` entries."""

    count: int
    first: str


@event("telegram changed", pace=BY_PEER)
class TelegramChanged(Event):
    """Another telegram is in force."""

    telegram: int
