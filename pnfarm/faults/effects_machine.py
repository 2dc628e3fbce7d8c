"""Faults of the machine that hangs on the drive: its load."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects import Effect, Tally, Window

if TYPE_CHECKING:
    from pnfarm.faults.plan import FaultSpec
    from pnfarm.faults.target import Evidence, FaultTarget

__all__ = ["LoadEffect"]

#: How often the frames are looked at until one left, when no connection tells its cycle.
LOOK_NS = 50_000_000


class LoadEffect(Effect):
    """load, stuck-axis: more on the shaft, until it ends; confirmed once a frame with actual values left."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._tally = Tally()
        self._since: int | None = None
        self._due: int | None = None

    def begin(self, window: Window, now: int) -> None:
        del window
        self._put(1.0)
        self._since = now
        self._tally.note(now)
        self.check(now)

    def _put(self, sign: float) -> None:
        self.target.load(*(sign * float(self.values[name]) for name in ("torque", "inertia", "friction")))

    def check(self, now: int) -> None:
        self._due = None
        if self._since is None or self._tally.seen.confirmed:
            return
        # a frame of the very instant was filled before the load came
        if self.target.sent_data(self._since + 1):
            self._tally.confirm()
            return
        connection = self.target.connection()
        self._due = now + (LOOK_NS if connection is None else max(connection.cycle_ns, 1_000_000))

    def end(self, now: int) -> None:
        self.check(now)
        self._due = None
        if self._since is not None:
            self._since = None
            self._put(-1.0)

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due
