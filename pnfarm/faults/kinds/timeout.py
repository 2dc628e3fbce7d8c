"""timeout: the drive is mute until its controller's watchdog has expired."""

from __future__ import annotations

from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import POLL_NS, ChanceEffect, Window
from pnfarm.faults.effects.frames import Frames
from pnfarm.faults.effects.wire import WIRE
from pnfarm.faults.kind import EACH, InjectionKind, ParamSpec

__all__ = ["KIND"]

#: Cycles of silence beyond the watchdog time: the controller checks once a cycle, and its frame takes time.
MARGIN_CYCLES = 2


class Timeout(ChanceEffect):
    """Mute until the controller's watchdog has expired and the connection is gone; then repeated as ``count`` says."""

    wire = WIRE
    connection = CONNECTION
    once = ends_by_itself = True
    _frames: Frames | None = None
    _keys: frozenset[int] = frozenset()
    _passed: frozenset[int] = frozenset()
    _earliest = 0

    def begin(self, now: int) -> None:
        self.check(now)

    def check(self, now: int) -> None:
        connection = self.connection.now()
        standing = connection.keys if connection else frozenset()
        if self._frames is not None:
            if now < self._earliest or standing & self._keys:
                self._due = self._earliest if now < self._earliest else now + POLL_NS
                return
            self.take()
            self.tally.confirm()
            self.finished = self.exhausted
        if self._frames is None and connection and connection.established and not standing & self._passed:
            self._passed = standing
            happens = self.happens()
            self.tally.note(now, happened=happens)
            if happens:
                frames = Frames(self.spec.without("probability", "count"), self.drive.name, self.wire, ("out",))
                frames.begin(Window())
                self._frames, self._keys = frames, standing
                margin = self.values["margin"]
                if margin is None:
                    margin = MARGIN_CYCLES * connection.cycle_ns
                self._earliest = self._due = now + connection.watchdog_ns + margin

    def take(self) -> None:
        if self._frames is not None:
            self._frames.end()
            self._frames = None
        self._due = None


KIND = InjectionKind(
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
    reports="Once IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running (assumed)). The device "
    "comes back.",
)
