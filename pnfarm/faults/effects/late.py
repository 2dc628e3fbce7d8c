"""Effects that delay what a drive sends."""

from __future__ import annotations

from pnfarm.faults.effects.effect import POLL_NS, ChanceEffect, seed_of
from pnfarm.faults.effects.wire import MESSAGES
from pnfarm.faults.gate.gate import DelayRule
from pnfarm.faults.kind import ParamSpec
from pnfarm.station.splitmix import SplitMix64

__all__ = ["LATE_PARAMS", "LateEffect", "LateMessages"]

LATE_PARAMS = {
    "delay": ParamSpec("duration", "Minimum delay.", default="500ms"),
    "jitter": ParamSpec("duration", "Random additional delay, at most.", default="0ms"),
}


class LateEffect(ChanceEffect):
    """A :class:`~pnfarm.faults.gate.gate.LateRule`: a fixed delay and up to ``jitter`` more."""

    _held = 0

    def prepare(self) -> None:
        super().prepare()
        # a different sequence from the probability's
        self._jitter = SplitMix64(seed_of(self.spec, self.drive.name) + 1)

    def asked(self, now: int) -> int:
        if self.exhausted:
            return 0
        wait: int = self.values["delay"] + int(self._jitter.uniform() * (self.values["jitter"] + 1))
        happens = self.happens() and wait > 0
        self.tally.note(now, happened=happens)
        self._held += happens
        return wait if happens else 0

    def left(self, *, sent: bool) -> None:
        self._held -= 1
        if sent:
            self.tally.confirm()

    def check(self, now: int) -> None:
        # ending earlier would let the last one leave in time
        self.finished = self.exhausted and not self._held
        self._due = now + POLL_NS if self.exhausted and self._held else None


class LateMessages(LateEffect):
    """Acyclic messages, delayed on the way to the link."""

    messages = MESSAGES

    def classes(self) -> frozenset[str]:
        """Of the messages that are late."""
        return self.messages.messages

    def put(self) -> None:
        self._rule = DelayRule(self.classes(), self)
        self.messages.delay(self._rule)

    def take(self) -> None:
        self.messages.undelay(self._rule)
