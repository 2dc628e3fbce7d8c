"""What each controller did with one station on its way to data exchange: found, configured, refused.

The devices of all buses write it, views read it.  It is bounded whatever comes from outside, and starts again when the
station's supply goes; a refusal stays until the same controller's next attempt has got further.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Literal, NamedTuple

from pnfarm.station.events import (
    ConnectionEstablished,
    ConnectionLost,
    ConnectionReleased,
    PowerLost,
    StartUpPhase,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from pnfarm.station.event import Event

__all__ = ["Caller", "Refusal", "Step", "Visit", "VisitState", "Visits"]

#: Controllers and tools kept for one station; refusals kept for one of them.
MOST_CALLERS = 8
MOST_REFUSALS = 32

Step = Literal["searched", "named", "addressed", "connected", "parameters", "ready", "data"]
#: Steps that a station keeps when a connection ends.
_FINDING = frozenset({"searched", "named", "addressed"})


class Caller(NamedTuple):
    """A controller as a station sees it: what its bus or its request does not say is empty.

    ``address`` is its IPv4 address, or that on a line.
    """

    address: str = ""
    mac: bytes = b""
    name: str = ""

    def may_be(self, other: Caller) -> bool:
        """Whether both may be one: something that both say is the same, and nothing else."""
        pairs = [(one, two) for one, two in ((self.address, other.address), (self.mac, other.mac)) if one and two]
        return bool(pairs) and all(one == two for one, two in pairs)

    def joined(self, other: Caller) -> Caller:
        """With what the newer one says, too."""
        return Caller(other.address or self.address, other.mac or self.mac, other.name or self.name)


@dataclass(frozen=True, slots=True)
class Refusal:
    """Something of a controller's configuration that the station does not have so.

    ``key`` is the path in the station's group of the farm file at which it can be changed, empty where nothing in the
    file helps; ``place`` where it is, as slot.subslot.  ``works``: it was accepted nevertheless.
    """

    text: str
    key: tuple[str | int, ...] = ()
    place: str = ""
    works: bool = False


class VisitState(Enum):
    """How far a controller has got."""

    FOUND = "found"
    REFUSED = "refused"
    STARTING = "starting"
    DATA = "data"
    ENDED = "ended"


@dataclass(slots=True)
class _Noted:
    count: int
    attempt: int


@dataclass(slots=True)
class Visit:
    """One controller at one station; ``steps`` are those that hold now, and when each was made, ns."""

    caller: Caller
    steps: dict[Step, int] = field(default_factory=dict)
    cycle_ns: int = 0
    watchdog_ns: int = 0
    #: How its last connection ended, empty before one did and while one exists.
    ended: str = ""
    #: Refusals beyond those that are kept.
    left_out: int = 0
    _noted: dict[Refusal, _Noted] = field(default_factory=dict)
    _attempt: int = 0
    #: The open connections, and whether each exchanges data.
    connections: dict[int, bool] = field(default_factory=dict)

    @property
    def refusals(self) -> list[tuple[Refusal, int]]:
        """What is refused now, and how often it was."""
        return [(refusal, noted.count) for refusal, noted in self._noted.items()]

    @property
    def state(self) -> VisitState:
        if self.connections:
            return VisitState.DATA if any(self.connections.values()) else VisitState.STARTING
        if any(not refusal.works for refusal in self._noted):
            return VisitState.REFUSED
        return VisitState.ENDED if self.ended else VisitState.FOUND

    @property
    def worth(self) -> int:
        """How much would be lost with it: the least goes first."""
        return 2 * bool(self.connections) + bool(self._noted)

    def opened(self, connection: int, cycle_ns: int, watchdog_ns: int, now: int) -> None:
        self._attempt += 1
        self.connections[connection] = False
        self.cycle_ns, self.watchdog_ns, self.ended = cycle_ns, watchdog_ns, ""
        if not any(self.connections.values()):
            self._forget_steps()
        self.steps.setdefault("connected", now)

    def refused(self, refusals: Iterable[Refusal], *, attempt: bool, final: bool) -> None:
        self._attempt += attempt
        for refusal in refusals:
            noted = self._noted.get(refusal)
            if noted is not None:
                noted.count, noted.attempt = noted.count + 1, self._attempt
            elif len(self._noted) < MOST_REFUSALS:
                self._noted[refusal] = _Noted(1, self._attempt)
            else:
                self.left_out += 1
        if final:
            self._drop_older()

    def _drop_older(self) -> None:
        self._noted = {one: noted for one, noted in self._noted.items() if noted.attempt == self._attempt}
        self.left_out *= len(self._noted) == MOST_REFUSALS

    def established(self, connection: int, now: int) -> bool:
        if connection not in self.connections:
            return False
        self.connections[connection] = True
        self.steps.setdefault("data", now)
        self._drop_older()
        return True

    def closed(self, connection: int, why: str) -> bool:
        if self.connections.pop(connection, None) is None:
            return False
        if not self.connections:
            self.ended = why
            self._forget_steps()
        return True

    def _forget_steps(self) -> None:
        self.steps = {step: when for step, when in self.steps.items() if step in _FINDING}


class Visits:
    """See the module's docstring.  ``revision`` counts what changed."""

    def __init__(self) -> None:
        self.revision = 0
        self._visits: list[Visit] = []

    def __iter__(self) -> Iterator[Visit]:
        return iter(self._visits)

    def step(self, caller: Caller, step: Step, now: int) -> None:
        """A controller made a step before there is a connection; repetitions are not reported."""
        visit = self._of(caller)
        if step not in visit.steps:
            visit.steps[step] = now
            self.revision += 1

    def opened(self, caller: Caller, connection: int, cycle_ns: int, watchdog_ns: int, now: int) -> None:
        """A controller got a connection; times are 0 where they are not known."""
        self._of(caller).opened(connection, cycle_ns, watchdog_ns, now)
        self.revision += 1

    def refused(
        self, caller: Caller, refusals: Iterable[Refusal], *, attempt: bool = False, final: bool = True
    ) -> None:
        """Something was refused.

        ``attempt``: it was an attempt of its own, which failed; ``final``: what earlier attempts were refused, and this
        one was not, is over.
        """
        self._of(caller).refused(refusals, attempt=attempt, final=final)
        self.revision += 1

    def closed(self, connection: int, why: str) -> None:
        """A connection ended."""
        if any(visit.closed(connection, why) for visit in self._visits):
            self.revision += 1

    def of_connection(self, connection: int) -> Visit | None:
        """Whose an open connection is."""
        return next((visit for visit in self._visits if connection in visit.connections), None)

    def take(self, event: Event, now: int) -> None:
        """What goes into the station's log, whatever the bus."""
        match event:
            case StartUpPhase(phase="parameters" | "ready" as phase, connection=int() as connection):
                visit = self.of_connection(connection)
                if visit is not None and phase not in visit.steps:
                    visit.steps[phase] = now
                    self.revision += 1
            case ConnectionEstablished(connection=connection):
                visit = self.of_connection(connection)
                if visit is not None and visit.established(connection, now):
                    self.revision += 1
            case ConnectionLost(connection=connection):
                self.closed(connection, str(event.details().get("reason", "lost")))
            case ConnectionReleased(connection=connection):
                self.closed(connection, "released")
            case PowerLost():
                self._visits.clear()
                self.revision += 1
            case _:
                pass

    def _of(self, caller: Caller) -> Visit:
        found = next((visit for visit in self._visits if visit.caller.may_be(caller)), None)
        if found is None:
            if len(self._visits) >= MOST_CALLERS:
                # the oldest of those with the fewest entries
                self._visits.remove(min(self._visits, key=lambda visit: visit.worth))
            found = Visit(caller)
            self._visits.append(found)
            self.revision += 1
        elif (whole := found.caller.joined(caller)) != found.caller:
            found.caller = whole
            self.revision += 1
        return found
