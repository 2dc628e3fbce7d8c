"""sign-of-life-freeze: the sign of life does not change."""

from __future__ import annotations

from pnfarm.faults.effects.sign_of_life import SignOfLifeEffect
from pnfarm.faults.kind import FRAMES, InjectionKind
from pnfarm.table.impairment import COUNT_FREEZE

__all__ = ["KIND", "REPORTS"]

_WIRE = (
    "Bits 12 to 15 of ZSW2 (`out`) keep the count of the first frame that is hit; all else continues. Afterwards "
    "the drive's own count is sent again. With `in`, the drive gets such an STW2."
)
REPORTS = (
    "PROFINET does not evaluate it, so the connection stays. S7-1500: a technology object that monitors the drive's "
    "sign of life stops the axis with an alarm (assumed: only with isochronous operation); a speed axis on telegram 1 "
    "sees nothing. CODESYS: nothing by itself; SoftMotion or the program has to compare the count (assumed)."
)


class Freeze(SignOfLifeEffect):
    """A frozen count."""

    cyclic = COUNT_FREEZE


KIND = InjectionKind(
    "sign-of-life-freeze",
    "liveness",
    "The sign of life freezes: of the drive in ZSW2, or with direction `in` the controller's in STW2, which the "
    "drive monitors.  When it ends, the true count follows.",
    "a cyclic frame whose count is frozen",
    Freeze,
    directions=("out", "in", "both"),
    takes=FRAMES,
    wire=_WIRE,
    reports=REPORTS,
    place=10,
)
