"""line-noise: octets on the line that are no telegram."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from pnfarm.buses.profibus.faults.slave import SLAVE
from pnfarm.faults.effects.effect import Chance, Effect, Window, seed_of
from pnfarm.faults.kind import EACH, InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class LineNoise(Effect):
    """Seeded octets, again and again."""

    needs = (SLAVE,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._slave = drive.part(SLAVE)
        self._chance = Chance(spec, drive, spec.count)
        self._due: int | None = None
        self._number = 0

    def begin(self, window: Window, now: int) -> None:
        del window
        self._due = now
        self.check(now)

    def check(self, now: int) -> None:
        if self._due is None or now < self._due:
            return
        self._due = now + self.values["every"]
        happens = self._chance.happens()
        self._chance.tally.note(now, happened=happens, confirmed=happens)
        if happens:
            self._number += 1
            seed = f"{seed_of(self.spec, self.drive.name)}/{self._number}".encode()
            self._slave.noise(hashlib.shake_128(seed).digest(self.values["octets"]), now)
        self.finished = self._chance.exhausted
        if self.finished:
            self._due = None

    def end(self, now: int) -> None:
        del now
        self._due = None

    def evidence(self) -> Evidence:
        return self._chance.tally.seen

    def next_deadline(self) -> int | None:
        return self._due


KINDS = (
    InjectionKind(
        "line-noise",
        "frames",
        "Octets that are no telegram are on the line, as from a bad shield or a second transmitter.",
        "one burst of octets",
        LineNoise,
        {
            "every": ParamSpec(
                "duration", "Time between two bursts.", default="20ms", low=100_000, high=60_000_000_000
            ),
            "octets": ParamSpec("whole number", "Length of a burst.", default=5, low=1, high=200),
        },
        takes=EACH,
        place=50,
        wire="Garbage between the telegrams, or in them where a burst meets one: wrong FCS, wrong delimiters.",
        reports="Nothing while repetitions are answered, but more of them; then station failure (OB86).",
    ),
)
