"""line-noise: octets on the line that are no telegram."""

from __future__ import annotations

import hashlib

from pnfarm.buses.profibus.faults.slave import SLAVE
from pnfarm.faults.effects.effect import ChanceEffect, seed_of
from pnfarm.faults.kind import EACH, InjectionKind, ParamSpec

__all__ = ["KIND"]


class LineNoise(ChanceEffect):
    """Seeded octets, again and again."""

    slave = SLAVE
    _number = 0

    def begin(self, now: int) -> None:
        self._due = now
        self.check(now)

    def check(self, now: int) -> None:
        if self._due is None or now < self._due:
            return
        self._due = now + self.values["every"]
        # one without supply sends nothing
        if self.slave.is_on_line and self.occurs(now):
            self._number += 1
            seed = f"{seed_of(self.spec, self.drive.name)}/{self._number}".encode()
            self.slave.noise(hashlib.shake_128(seed).digest(self.values["octets"]), now)
        if self.finished:
            self._due = None

    def take(self) -> None:
        self._due = None


KIND = InjectionKind(
    "line-noise",
    "frames",
    "Octets that are no telegram are on the line, as from a bad shield or a second transmitter.",
    "one burst of octets",
    LineNoise,
    {
        "every": ParamSpec("duration", "Time between two bursts.", default="20ms", low=100_000, high=60_000_000_000),
        "octets": ParamSpec("whole number", "Length of a burst.", default=5, low=1, high=200),
    },
    takes=EACH,
    place=50,
    wire="Garbage between the telegrams, or in them where a burst meets one: wrong FCS, wrong delimiters.",
    reports="Only more repetitions, as long as one is answered; then station failure (OB86).",
)
