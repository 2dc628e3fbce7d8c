"""timeout: the drive is mute until its controller's watchdog has expired."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import POLL_NS, Chance, Effect, Window
from pnfarm.faults.effects.frames import Frames
from pnfarm.faults.effects.wire import WIRE
from pnfarm.faults.kind import EACH, InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]

#: Cycles of silence beyond the watchdog time: the controller checks once a cycle, and its frame takes time.
MARGIN_CYCLES = 2


class Timeout(Effect):
    """Mute until the controller's watchdog has expired and the connection is gone; then repeated as ``count`` says."""

    needs = (WIRE, CONNECTION)
    ends_by_itself = True

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._wire = drive.part(WIRE)
        self._connection = drive.part(CONNECTION)
        self._chance = Chance(spec, drive, spec.count if spec.count or spec.for_ns else 1)
        self._frames: Frames | None = None
        self._keys: frozenset[int] = frozenset()
        self._passed: frozenset[int] = frozenset()
        self._earliest = 0
        self._due: int | None = None

    def begin(self, window: Window, now: int) -> None:
        del window
        self.check(now)

    def check(self, now: int) -> None:
        connection = self._connection.now()
        standing = connection.keys if connection else frozenset()
        if self._frames is not None:
            if now < self._earliest or standing & self._keys:
                self._due = self._earliest if now < self._earliest else now + POLL_NS
                return
            self._speak()
            self._chance.tally.confirm()
            self.finished = self._chance.exhausted
        if self._frames is None and connection and connection.established and not standing & self._passed:
            self._passed = standing
            happens = self._chance.happens()
            self._chance.tally.note(now, happened=happens)
            if happens:
                spec = self.spec.without("probability", "count")
                frames = Frames(spec, self.drive.name, self._wire, ("out",))
                frames.begin(Window())
                self._frames, self._keys = frames, standing
                margin = self.values["margin"]
                if margin is None:
                    margin = MARGIN_CYCLES * connection.cycle_ns
                self._earliest = self._due = now + connection.watchdog_ns + margin

    def _speak(self) -> None:
        if self._frames is not None:
            self._frames.end()
            self._frames = None
        self._due = None

    def end(self, now: int) -> None:
        del now
        self._speak()

    def evidence(self) -> Evidence:
        return self._chance.tally.seen

    def next_deadline(self) -> int | None:
        return self._due


KINDS = (
    InjectionKind(
        "timeout",
        "link",
        "The drive is mute until the controller's watchdog has expired and the connection broke, then it sends again.",
        "one broken connection; without `count` and `for` it happens once",
        Timeout,
        {
            "margin": ParamSpec(
                "duration", "Silence beyond the watchdog time; left out, two cycles of the connection.", default=None
            )
        },
        takes=EACH,
        place=20,
        wire=("No frame of the drive for a little more than the watchdog time, then it is found and connected again."),
        reports=(
            "Once IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running (assumed)). The "
            "device comes back."
        ),
    ),
)
