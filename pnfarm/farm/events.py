"""Events of a farm as a whole, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pnfarm.station.events import Event, Level

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
    "RealTimeOptionRefused",
]


@dataclass(frozen=True, slots=True)
class FarmStarted(Event):
    """The drives are on the network; ``granted`` are the real-time options that the kernel allowed."""

    TEXT = "farm started"
    drives: int
    link: str
    granted: tuple[str, ...]

    def details(self) -> dict[str, Any]:
        return {"drives": self.drives, "link": self.link, "granted": list(self.granted)}


@dataclass(frozen=True, slots=True)
class FarmFileNote(Event):
    """What a user should know of the farm file though nothing is wrong in it."""

    TEXT = "note on the farm file"
    note: str


@dataclass(frozen=True, slots=True)
class LineReady(Event):
    """A serial line is there; ``where`` is what the other end connects to."""

    TEXT = "serial line ready"
    way: str
    where: str
    baud: int


@dataclass(frozen=True, slots=True)
class LineOpened(Event):
    """Somebody is at the other end of a serial line."""

    TEXT = "serial line opened"
    where: str


@dataclass(frozen=True, slots=True)
class AnswersWithheld(Event):
    """So many answers on a serial line would have begun too late; told at the first, the second, the fourth ..."""

    TEXT = "answers withheld as too late: see latest_answer"
    LEVEL = "warning"
    where: str
    count: int
    latest_seconds: float


@dataclass(frozen=True, slots=True)
class LineInterrupted(Event):
    """Nobody is at the other end of a serial line any more, or its way broke; it is tried again."""

    TEXT = "serial line interrupted"
    reason: str


@dataclass(frozen=True, slots=True)
class FarmStopped(Event):
    """The drives have left the network."""

    TEXT = "farm stopped"


@dataclass(frozen=True, slots=True)
class ApiListening(Event):
    """The API's address; its token unless the user knows it, or the file that holds it."""

    TEXT = "api listening"
    url: str
    token: str | None = None
    token_file: str | None = None

    def details(self) -> dict[str, Any]:
        given = {"url": self.url, "token": self.token, "token_file": self.token_file}
        return {key: value for key, value in given.items() if value is not None}


@dataclass(frozen=True, slots=True)
class CaptureStarted(Event):
    """Frames are written into a file from now on."""

    TEXT = "capture started"
    file: str


@dataclass(frozen=True, slots=True)
class CaptureEnded(Event):
    """The capture's file is complete; ``lost`` frames came too fast for it."""

    TEXT = "capture ended"
    file: str
    frames: int
    lost: int


@dataclass(frozen=True, slots=True)
class CaptureFailed(CaptureEnded):
    """Nothing more is written; the farm keeps running."""

    TEXT = "capture failed"
    LEVEL = "error"
    reason: str

    def details(self) -> dict[str, Any]:
        return {"reason": self.reason, "file": self.file, "frames": self.frames, "lost": self.lost}


@dataclass(frozen=True, slots=True)
class CaptureLostFrames(Event):
    """Frames came faster than the capture could write them."""

    TEXT = "capture lost frames"
    LEVEL = "warning"
    lost: int


@dataclass(frozen=True, slots=True)
class RealTimeOptionRefused(Event):
    """The kernel refused a real-time option; a warning only if the user ``asked`` for it."""

    TEXT = "real-time option refused"
    option: str
    reason: str
    asked: bool

    @property
    def level(self) -> Level:
        return "warning" if self.asked else "info"

    def details(self) -> dict[str, Any]:
        return {"option": self.option, "reason": self.reason}


@dataclass(frozen=True, slots=True)
class MemoryAway(Event):
    """The database of the drives' memory does not answer; what is asked to be saved is refused."""

    TEXT = "memory away"
    LEVEL = "warning"
    reason: str


@dataclass(frozen=True, slots=True)
class MemoryBack(Event):
    """The database answers again, and has what the drives hold."""

    TEXT = "memory back"


@dataclass(frozen=True, slots=True)
class LeaseWaiting(Event):
    """Another process runs some of these drives; the farm starts when its claims end."""

    TEXT = "waiting for drives that run elsewhere"
    LEVEL = "warning"
    host: str
    shard: str
    for_seconds: float


@dataclass(frozen=True, slots=True)
class LeaseLost(Event):
    """The lease was not renewed in time: the drives are mute."""

    TEXT = "lease lost"
    LEVEL = "error"
    reason: str


@dataclass(frozen=True, slots=True)
class LeaseTaken(Event):
    """Another process runs the drives: they are mute here."""

    TEXT = "lease taken by another"
    LEVEL = "error"
    host: str
    shard: str


@dataclass(frozen=True, slots=True)
class LeaseRegained(Event):
    """The drives speak again; ``restarted``: others ran them meanwhile, so they were switched off and on."""

    TEXT = "lease regained"
    restarted: bool


@dataclass(frozen=True, slots=True)
class EngineEventsLost(Event):
    """The ring of the engine's events overflowed."""

    TEXT = "engine events lost"
    LEVEL = "warning"
    count: int


@dataclass(frozen=True, slots=True)
class AddressNotRestored(Event):
    """An injection changed a drive's MAC address and the link refused to restore it; it is tried again."""

    TEXT = "MAC address not restored"
    LEVEL = "warning"
    reason: str


@dataclass(frozen=True, slots=True)
class CarrierNotChanged(Event):
    """An injection could not pull or plug the drive's cable."""

    TEXT = "carrier not changed"
    LEVEL = "warning"
    reason: str
