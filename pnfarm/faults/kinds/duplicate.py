"""duplicate: frames arrive more than once."""

from __future__ import annotations

from typing import ClassVar

from pnfarm.faults.effects.shaped import ShapedEffect
from pnfarm.faults.gate.frame_words import FRAMES_PARAM
from pnfarm.faults.kind import EVERY_DIRECTION, FRAMES, InjectionKind, ParamSpec
from pnfarm.table.impairment import DUPLICATE

__all__ = ["KIND"]


class Duplicate(ShapedEffect):
    """So many copies."""

    cyclic = DUPLICATE
    no_streams = "a stream never delivers an octet twice: TCP discards repeated ones"
    row: ClassVar = {"amount": "copies"}
    shaped: ClassVar = {"copies": "copies"}


KIND = InjectionKind(
    "duplicate",
    "frames",
    "Frames arrive more than once, one after the other.",
    "a frame that is repeated",
    Duplicate,
    {
        "frames": FRAMES_PARAM,
        "copies": ParamSpec("whole number", "Copies after the frame.", default=1, low=1, high=8),
    },
    directions=EVERY_DIRECTION,
    takes=FRAMES,
    wire="The same octets again at once, with the same cycle counter.",
    reports=("Nothing: a cyclic copy is discarded for its cycle counter, a repeated request of RPC is answered again."),
    place=30,
)
