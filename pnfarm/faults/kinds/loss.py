"""loss: frames are lost at random."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.frames import FramesEffect
from pnfarm.faults.kind import EVERY_DIRECTION, FRAMES, InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.gate import FrameClasses

__all__ = ["KINDS"]


class Loss(FramesEffect):
    """All frames, or those of one class."""

    def acts_on(self) -> tuple[int | None, FrameClasses | None]:
        frames = self.values["frames"]
        return None if frames == "acyclic" else self.cyclic, None if frames == "cyclic" else self.acyclic


KINDS = (
    InjectionKind(
        "loss",
        "frames",
        "Frames are lost at random, independently.",
        "a frame that is lost; `count` holds for each direction",
        Loss,
        {
            "frames": ParamSpec(
                "word",
                "Which frames: cyclic data, acyclic ones (DCP, ARP, RPC, alarms), or all.",
                default="all",
                words={"all": 0, "cyclic": 1, "acyclic": 2},
            )
        },
        directions=EVERY_DIRECTION,
        takes=FRAMES,
    ),
)
