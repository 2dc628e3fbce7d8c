"""What the controller of each drive did, from the drive's side, by the farm's events: nothing is polled.

For each fault situation the record has its fault, what was injected, and when each bit of control word 1 changed first;
for each start-up its phases.  The newest situations and start-ups are kept, and sums over all.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.drives.description.parts import fault_label
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
    from collections.abc import Mapping, Sequence

    from pnfarm.station.event_log import EventLog, LogEntry

__all__ = ["NOT_INJECTED", "ControllerRecord", "ControllerRecords", "Situation", "StartUp"]

#: What was injected when nothing was.
NOT_INJECTED = "none"
#: A fault this soon after the end of an injection is still its doing.
AFTERWARDS_NS = 100_000_000
#: Kept situations, start-ups, and injections in force.
KEPT = 16
#: The last phase of a start-up, and those before a connection is asked for.
DATA = "data"
BEFORE = ("identify", "address")
#: A controller that looks for a drive this long after it was given an address starts again.
ANEW_NS = 10_000_000_000
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
    """One way of a controller to data exchange.

    ``phases`` in the order in which they ended, with the farm's time, ns: ``identify`` (the drive answered the
    controller, which looked for it), ``address``, ``connect``, ``parameters``, ``ready`` (ApplicationReady confirmed),
    ``data``.
    """

    #: When the controller's connection before it was lost, if it was.
    lost_ns: int | None
    controller: str = ""
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
        #: Start-ups of the open connections; and the one that has no connection yet.
        self._open: dict[int, StartUp] = {}
        self._waiting: StartUp | None = None
        #: When connections were lost, by controller, oldest first, until it is back.
        self._lost: dict[str, int] = {}
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
            case _:
                self._connections(what, now)

    def _connections(self, what: object, now: int) -> None:
        """Another controller's attempts while one is connected count, and are in no start-up until they succeed."""
        match what:
            case ConnectionRefused():
                self.attempts += 1
                self.refused += 1
                if not self._open:
                    self._wait().attempts += 1
            case ConnectionOpened(connection=connection, peer=controller):
                self.attempts += 1
                self._opened(connection, controller, now)
            case StartUpPhase(phase=phase, connection=None):
                if not self._open:
                    self._before(phase, now)
            case StartUpPhase(phase=phase, connection=int() as connection):
                if (start := self._open.get(connection)) is not None and not start.complete:
                    start.phases[phase] = now
            case ConnectionEstablished(connection=connection):
                if (start := self._open.get(connection)) is not None:
                    start.phases[DATA] = now
                    self._lost.pop(start.controller, None)
            case WatchdogExpired(connection=connection):
                if (start := self._open.get(connection)) is not None and start.complete:
                    self._lose(start, now)
            case ConnectionLost(connection=connection):
                # one without cyclic data is not known here
                if (start := self._open.pop(connection, None)) is not None:
                    self._ends(start, now)
            case ConnectionReleased(connection=connection):
                if (start := self._open.pop(connection, None)) is not None:
                    self._lost.pop(start.controller, None)
            case PowerLost():
                for start in self._open.values():
                    self._ends(start, now)
                self._open.clear()
                if self._waiting is not None:
                    self._waiting.phases.clear()
                # the faults are gone without an acknowledgement
                self._active = None
            case _:
                pass

    def _wait(self) -> StartUp:
        """The start-up that has no connection yet, a new one if there is none."""
        if self._waiting is None:
            self._waiting = StartUp(max(self._lost.values(), default=None))
            self.start_ups.append(self._waiting)
        return self._waiting

    def _before(self, phase: str, now: int) -> None:
        """A controller looked for the drive, or gave it an address."""
        phases = self._wait().phases
        given = phases.get("address")
        if phase == "identify" and given is not None:
            if now - given <= ANEW_NS:
                return
            phases.clear()
        phases.pop(phase, None)
        phases[phase] = now

    def _opened(self, connection: int, controller: str, now: int) -> None:
        start = self._open.get(connection)
        if start is None:
            start, self._waiting = self._wait(), None
            # what another controller lost is not this one's, unless it takes that one's place
            start.lost_ns = self._lost.get(controller, None if self._open else start.lost_ns)
        start.attempts += 1
        start.controller = controller
        # those of an attempt that failed
        start.phases = {name: when for name, when in start.phases.items() if name in BEFORE}
        start.phases["connect"] = now
        self._open[connection] = start

    def _lose(self, start: StartUp, now: int) -> None:
        self._lost.setdefault(start.controller, now)
        if len(self._lost) > KEPT:
            del self._lost[next(iter(self._lost))]

    def _ends(self, start: StartUp, now: int) -> None:
        """A connection ended without a release: a loss, or an attempt that the next one goes on from."""
        if start.complete:
            self._lose(start, now)
        elif self._waiting is None:
            self._waiting = start

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
    """The record of each axis, by its name; ``stations`` names the axes of each station, what happens to which concerns
    all of them.
    """

    def __init__(self, log: EventLog, stations: Mapping[str, Sequence[str]]) -> None:
        self._drives = {axis: ControllerRecord() for axes in stations.values() for axis in axes}
        self._concerned = {axis: [axis] for axis in self._drives} | dict(stations)
        log.subscribe(self._take)

    def of(self, drive: str) -> ControllerRecord:
        """The record of a drive of the farm."""
        return self._drives[drive]

    def _take(self, entry: LogEntry) -> None:
        for name in self._concerned.get(entry.drive, ()):
            self._drives[name].take(entry.what, entry.now_ns)
