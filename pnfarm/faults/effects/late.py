"""Effects that delay what a drive sends."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.effect import POLL_NS, Chance, Effect, seed_of
from pnfarm.faults.kind import ParamSpec
from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["LATE_PARAMS", "LateEffect"]

LATE_PARAMS = {
    "delay": ParamSpec("duration", "Minimum delay.", default="500ms"),
    "jitter": ParamSpec("duration", "Random additional delay, at most.", default="0ms"),
}


class LateEffect(Effect):
    """A :class:`~pnfarm.faults.gate.gate.LateRule`: a fixed delay and up to ``jitter`` more."""

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._chance = Chance(spec, drive, spec.count)
        self._delay: int = self.values["delay"]
        self._jitter: int = self.values["jitter"]
        # a different sequence from the probability's
        self._random = SplitMix64(seed_of(spec, drive.name) + 1)
        self._held = 0
        self._due: int | None = None

    def asked(self, now: int) -> int:
        if self._chance.exhausted:
            return 0
        wait = self._delay + int(self._random.uniform() * (self._jitter + 1))
        happens = self._chance.happens() and wait > 0
        self._chance.tally.note(now, happened=happens)
        self._held += happens
        return wait if happens else 0

    def left(self, *, sent: bool) -> None:
        self._held -= 1
        if sent:
            self._chance.tally.confirm()

    def check(self, now: int) -> None:
        # ending earlier would let the last one leave in time
        self.finished = self._chance.exhausted and not self._held
        self._due = now + POLL_NS if self._chance.exhausted and self._held else None

    def evidence(self) -> Evidence:
        return self._chance.tally.seen

    def next_deadline(self) -> int | None:
        return self._due
