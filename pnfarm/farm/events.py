"""Events of a farm as a whole, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from typing import Any

from pnfarm.station.event import Event, Level, event, shown, unshown

__all__ = [
    "AddressNotRestored",
    "AnswersWithheld",
    "ApiListening",
    "CaptureEnded",
    "CaptureFailed",
    "CaptureLostFrames",
    "CaptureStarted",
    "CarrierNotChanged",
    "EngineEventsLost",
    "FarmFileNote",
    "FarmStarted",
    "FarmStopped",
    "LeaseLost",
    "LeaseRegained",
    "LeaseTaken",
    "LeaseWaiting",
    "LineInterrupted",
    "LineOpened",
    "LineReady",
    "MemoryAway",
    "MemoryBack",
    "OpcUaFailed",
    "OpcUaListening",
    "PortsRefused",
    "RealTimeOptionRefused",
    "RealTimeOptionTakenBack",
    "StateRestored",
    "StateSaved",
]


@event("farm started")
class FarmStarted(Event):
    """The drives are on the network; ``granted`` are the real-time options that the kernel allowed."""

    drives: int
    link: str
    granted: tuple[str, ...]


@event("note on the farm file")
class FarmFileNote(Event):
    """What a user should know of the farm file though nothing is wrong in it."""

    note: str


@event("serial line ready")
class LineReady(Event):
    """A serial line is there; ``where`` is what the other end connects to."""

    way: str
    where: str
    baud: int


@event("serial line opened")
class LineOpened(Event):
    """The far end of a serial line is connected."""

    where: str


@event("answers withheld as too late: see latest_answer", "warning")
class AnswersWithheld(Event):
    """So many answers on a serial line would have begun too late; reported at the first, the second, the fourth ..."""

    where: str
    count: int
    latest_seconds: float


@event("serial line interrupted")
class LineInterrupted(Event):
    """The far end of a serial line is not connected any more, or its way broke; it is tried again."""

    reason: str


@event("farm stopped")
class FarmStopped(Event):
    """The drives have left the network."""


@event("api listening")
class ApiListening(Event):
    """The API's address; its token unless the user knows it, in the program's own log alone, or the file with it."""

    url: str
    token: str | None = unshown(default=None)
    token_file: str | None = shown(always=False, default=None)

    def logged(self) -> dict[str, Any]:
        return {**self.details(), **({"token": self.token} if self.token is not None else {})}


@event("opc ua listening")
class OpcUaListening(Event):
    """The address of the OPC UA server."""

    url: str


@event("opc ua failed", "error")
class OpcUaFailed(Event):
    """The OPC UA server has ended; the farm keeps running."""

    reason: str


@event("capture started")
class CaptureStarted(Event):
    """Frames are written into a file from now on."""

    file: str


@event("capture ended")
class CaptureEnded(Event):
    """The capture's file is complete; ``lost`` frames came too fast for it."""

    file: str
    frames: int
    lost: int


@event("capture failed", "error")
class CaptureFailed(CaptureEnded):
    """Nothing more is written; the farm keeps running."""

    reason: str


@event("capture lost frames", "warning")
class CaptureLostFrames(Event):
    """Frames came faster than the capture could write them."""

    lost: int


@event("real-time option refused")
class RealTimeOptionRefused(Event):
    """The kernel refused a real-time option; a warning only if the user ``asked`` for it."""

    option: str
    reason: str
    asked: bool = unshown()

    @property
    def level(self) -> Level:
        return "warning" if self.asked else "info"


@event("real-time option taken back", "warning")
class RealTimeOptionTakenBack(Event):
    """The engine has the ordinary scheduler from now on, so that the machine's other work is done, too."""

    option: str
    reason: str


@event("memory away", "warning")
class MemoryAway(Event):
    """The database of the drives' memory does not answer; what is asked to be saved is refused."""

    reason: str


@event("memory back")
class MemoryBack(Event):
    """The database answers again, and has what the drives hold."""


@event("waiting for drives that run elsewhere", "warning")
class LeaseWaiting(Event):
    """Another process runs some of these drives; the farm starts when its claims end."""

    host: str
    shard: str
    for_seconds: float


@event("lease lost", "error")
class LeaseLost(Event):
    """The lease was not renewed in time: the drives are mute."""

    reason: str


@event("lease taken by another", "error")
class LeaseTaken(Event):
    """Another process runs the drives: they are mute here."""

    host: str
    shard: str


@event("lease regained")
class LeaseRegained(Event):
    """The drives speak again; ``restarted``: others ran them meanwhile, so they were switched off and on."""

    restarted: bool


@event("engine events lost", "warning")
class EngineEventsLost(Event):
    """The ring of the engine's events overflowed."""

    count: int


@event("MAC address not restored", "warning")
class AddressNotRestored(Event):
    """An injection changed a drive's MAC address and the link refused to restore it; it is tried again."""

    reason: str


@event("ports not opened", "warning")
class PortsRefused(Event):
    """The machine refused a drive of a running farm its address or its ports; it is tried again each second."""

    reason: str


@event("carrier not changed", "warning")
class CarrierNotChanged(Event):
    """An injection could not pull or plug the drive's cable."""

    reason: str


@event("state saved")
class StateSaved(Event):
    """The state of the whole farm was saved under this name."""

    state: str


@event("state restored", "warning")
class StateRestored(Event):
    """The whole farm was switched off and on, and has a saved state."""

    state: str
