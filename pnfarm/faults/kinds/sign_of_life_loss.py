"""sign-of-life-loss: shorthand for sign-of-life-freeze."""

from __future__ import annotations

from pnfarm.faults.kind import FRAMES, InjectionKind
from pnfarm.faults.kinds.sign_of_life_freeze import REPORTS, WIRE, Freeze

__all__ = ["KIND"]

KIND = InjectionKind(
    "sign-of-life-loss",
    "liveness",
    "The sign of life freezes: sign-of-life-freeze.",
    "a cyclic frame whose count is frozen",
    Freeze,
    directions=("out", "in", "both"),
    takes=FRAMES,
    wire=WIRE,
    reports=REPORTS,
    place=30,
)
