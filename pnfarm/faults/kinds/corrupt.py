"""corrupt: bits of frames are inverted."""

from __future__ import annotations

from typing import ClassVar

from pnfarm.faults.effects.shaped import ShapedEffect
from pnfarm.faults.gate.frame_words import FRAMES_PARAM
from pnfarm.faults.kind import EVERY_DIRECTION, FRAMES, InjectionKind, ParamSpec
from pnfarm.table.impairment import CORRUPT

__all__ = ["KIND"]


class Corrupt(ShapedEffect):
    """Everywhere, or after the EtherType."""

    cyclic = CORRUPT
    row: ClassVar = {"amount": "bits", "whole": "whole", "mends": "mend"}
    shaped: ClassVar = {"bits": "bits", "whole": "whole"}


KIND = InjectionKind(
    "corrupt",
    "frames",
    "Bits of frames are inverted; the frame check sequence on the wire is still right.",
    "a frame that is changed",
    Corrupt,
    {
        "frames": FRAMES_PARAM,
        "bits": ParamSpec("whole number", "Bits that are inverted, spread over the frame.", default=1, low=1, high=64),
        "whole": ParamSpec("yes or no", "Whether also in the addresses and the EtherType.", default=False),
        "mend": ParamSpec(
            "yes or no",
            "Whether the checksums of IPv4 and UDP of a cyclic frame are corrected, so that its receiver takes "
            "the wrong data; no effect on a frame without such checksums.",
            default=False,
        ),
    },
    directions=EVERY_DIRECTION,
    takes=FRAMES,
    wire="Inverted bits after the EtherType, with `whole` before it as well.",
    reports="Depends on the bit: wrong data, a discarded frame, or one without a receiver. IP and UDP discard by "
    "their checksums.",
    place=50,
)
