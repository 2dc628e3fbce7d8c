"""sign-of-life-skip: the sign of life leaves counts out."""

from __future__ import annotations

from pnfarm.faults.effects.sign_of_life import SignOfLifeEffect
from pnfarm.faults.kind import FRAMES, InjectionKind, ParamSpec
from pnfarm.faults.kinds.sign_of_life_freeze import REPORTS
from pnfarm.table.impairment import COUNT_SKIP

__all__ = ["KIND"]


class Skip(SignOfLifeEffect):
    """A count that is ahead by what was skipped so far."""

    cyclic = COUNT_SKIP


KIND = InjectionKind(
    "sign-of-life-skip",
    "liveness",
    "The sign of life skips counts, and continues from there: each skip is one failed sign of life. The end is a "
    "further one, when the true count follows.",
    "a cyclic frame in front of which counts were skipped",
    Skip,
    {"by": ParamSpec("whole number", "Counts that are left out.", default=1, low=1, high=14)},
    directions=("out", "in", "both"),
    takes=FRAMES,
    wire="Bits 12 to 15 of ZSW2 (`out`) or STW2 (`in`) run ahead by `by` more with each skip, modulo 15.",
    reports=REPORTS,
    place=20,
)
