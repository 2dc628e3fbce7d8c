"""What the controller of each drive did, from the drive's side, by the farm's events: nothing is polled.

For each fault situation the record has its fault, what was injected, and when each bit of control word 1 changed first;
for each start-up its phases.  The newest situations and start-ups are kept, and sums over all.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.drives.model_parts import fault_label
from pnfarm.faults.events import InjectionBegan, InjectionEnded
from pnfarm.station.events import (
    ConnectionEstablished,
    ConnectionLost,
    ConnectionOpened,
    ConnectionRefused,
    ConnectionReleased,
    ControlBitChanged,
    FaultRaised,
    FaultReacted,
    FaultsCleared,
    PowerLost,
    StartUpPhase,
    WatchdogExpired,
)

if TYPE_CHECKING:
    from pnfarm.station.event_log import EventLog, LogEntry

__all__ = ["NOT_INJECTED", "ControllerRecord", "ControllerRecords", "Situation", "StartUp"]

#: What was injected when nothing was.
NOT_INJECTED = "none"
#: A fault this soon after the end of an injection is still its doing.
AFTERWARDS_NS = 100_000_000
#: Kept situations, start-ups, and injections in force.
KEPT = 16
#: The last phase of a start-up.
DATA = "data"
INJECTIONS = 64


@dataclass(slots=True)
class Situation:
    """The faults of a drive from the first one to their acknowledgement; times in ns after ``begin_ns``."""

    begin_ns: int
    code: str
    kind: str
    reaction_ns: int | None = None
    acknowledged_ns: int | None = None
    #: Bit of STW1 -> (its new value, when it changed first).
    bits: dict[int, tuple[int, int]] = field(default_factory=dict)


@dataclass(slots=True)
class StartUp:
    """One way to data exchange.

    ``phases`` in the order in which they ended, with the farm's time, ns: ``identify`` (the controller looked for the
    drive by name), ``address``, ``connect``, ``parameters``, ``ready`` (ApplicationReady confirmed), ``data``.
    """

    #: When the connection before it was lost, if it was.
    lost_ns: int | None
    phases: dict[str, int] = field(default_factory=dict)
    attempts: int = 0

    @property
    def complete(self) -> bool:
        """Whether data are exchanged."""
        return DATA in self.phases

    def seconds(self) -> dict[str, float]:
        """Duration of each phase, from the end of the one before or from the loss; the first one may have none."""
        before = self.lost_ns
        found = {}
        for name, when in self.phases.items():
            if before is not None:
                found[name] = (when - before) / 1e9
            before = when
        return found


class ControllerRecord:
    """What is known of one drive's controller."""

    def __init__(self) -> None:
        self.situations: deque[Situation] = deque(maxlen=KEPT)
        self.start_ups: deque[StartUp] = deque(maxlen=KEPT)
        #: Connects that the drive accepted or refused, and those refused.
        self.attempts = 0
        self.refused = 0
        self._active: Situation | None = None
        self._starting: StartUp | None = None
        self._lost_ns: int | None = None
        self._injected: dict[str, str] = {}
        self._ended: tuple[str, int] | None = None

    def take(self, what: object, now: int) -> None:
        """Something happened to the drive."""
        match what:
            case InjectionBegan(id=number, kind=kind):
                if len(self._injected) < INJECTIONS:
                    self._injected[number] = kind
            case InjectionEnded(id=number, kind=kind):
                self._injected.pop(number, None)
                self._ended = kind, now
            case FaultRaised(number=code):
                if self._active is None:
                    self._active = Situation(now, fault_label(code), self._kind(now))
                    self.situations.append(self._active)
            case FaultReacted(after_ns=after):
                if self._active is not None:
                    self._active.reaction_ns = after
            case ControlBitChanged(bit=bit, value=value, after_ns=after):
                if self._active is not None:
                    self._active.bits.setdefault(bit, (value, after))
            case FaultsCleared(after_ns=after):
                if self._active is not None:
                    self._active.acknowledged_ns = after
                    self._active = None
            case ConnectionRefused():
                self.attempts += 1
                self.refused += 1
                self._start().attempts += 1
            case ConnectionOpened():
                self.attempts += 1
                starting = self._start()
                starting.attempts += 1
                # an attempt that failed later began anew
                for phase in ("connect", "parameters", "ready"):
                    starting.phases.pop(phase, None)
                starting.phases["connect"] = now
            case StartUpPhase(phase=phase):
                if phase in ("identify", "address") or self._starting is not None:
                    self._start().phases.setdefault(phase, now)
            case ConnectionEstablished():
                if self._starting is not None:
                    self._starting.phases[DATA] = now
                self._starting = self._lost_ns = None
            case WatchdogExpired() | ConnectionLost() | PowerLost():
                if self._lost_ns is None and self._starting is None:
                    self._lost_ns = now
            case ConnectionReleased():
                self._starting = self._lost_ns = None
            case _:
                pass

    def _start(self) -> StartUp:
        """The start-up at work, a new one if there is none."""
        if self._starting is None:
            self._starting = StartUp(self._lost_ns)
            self.start_ups.append(self._starting)
        return self._starting

    def _kind(self, now: int) -> str:
        """What is injected now, or was just now; the newest of several."""
        if self._injected:
            return next(reversed(self._injected.values()))
        if self._ended is not None and now - self._ended[1] <= AFTERWARDS_NS:
            return self._ended[0]
        return NOT_INJECTED

    @property
    def situation(self) -> Situation | None:
        """The newest fault situation."""
        return self.situations[-1] if self.situations else None


class ControllerRecords:
    """The record of each drive, by its name in the farm file."""

    def __init__(self, log: EventLog, drives: list[str]) -> None:
        self._drives = {name: ControllerRecord() for name in drives}
        log.subscribe(self._take)

    def of(self, drive: str) -> ControllerRecord:
        """The record of a drive of the farm."""
        return self._drives[drive]

    def _take(self, entry: LogEntry) -> None:
        record: Any = self._drives.get(entry.drive)
        if record is not None:
            record.take(entry.what, entry.now_ns)
