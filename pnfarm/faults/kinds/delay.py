"""delay: frames arrive late."""

from __future__ import annotations

from typing import Any, ClassVar

from pnfarm.faults.effects.shaped import MOST_NS, ShapedEffect
from pnfarm.faults.gate.frame_words import FRAMES_PARAM
from pnfarm.faults.kind import EVERY_DIRECTION, FRAMES, InjectionKind, Misfits, ParamSpec, by_values
from pnfarm.table.impairment import DELAY
from pnfarm.vocabulary.problem import Problem

__all__ = ["KIND"]


class Delay(ShapedEffect):
    """In order, or not."""

    cyclic = DELAY
    row: ClassVar = {"delay_ns": "delay", "jitter_ns": "jitter", "overtakes": "overtake"}
    shaped: ClassVar = {"delay_ns": "delay", "jitter_ns": "jitter", "overtakes": "overtake"}


@by_values
def _check(values: dict[str, Any]) -> Misfits:
    if not values["delay"] and not values["jitter"]:
        yield "params.delay", Problem("is 0, as the jitter", "a duration above 0 for one of them")


KIND = InjectionKind(
    "delay",
    "frames",
    "Frames arrive late, by a fixed time and a random one.  They keep their order unless `overtake` says "
    "otherwise; when it ends, those that wait arrive at once.",
    "a frame that is late",
    Delay,
    {
        "frames": FRAMES_PARAM,
        "delay": ParamSpec("duration", "Fixed delay.", default="5ms", high=MOST_NS),
        "jitter": ParamSpec("duration", "Random additional delay.", default="0ms", high=MOST_NS),
        "overtake": ParamSpec("yes or no", "Whether a later frame may overtake a delayed one.", default=False),
    },
    directions=EVERY_DIRECTION,
    takes=FRAMES,
    wire="Frames are later by `delay` to `delay` + `jitter`, each with the cycle counter and the data that it had.",
    reports="A constant delay: only the gap at its start, which is IO device failure when it is longer than the "
    "watchdog (S7-1500; CODESYS assumed). Jitter above the watchdog: the same. Overtaken cyclic frames are discarded.",
    misfits=_check,
    place=20,
)
