"""Frames that only PROFINET has: their data status, their classes."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.effects.parts import Part

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Needs
    from pnfarm.faults.effects.wire import Wire
    from pnfarm.faults.gate.gate import FrameClasses

__all__ = ["PROFINET_FRAMES", "ProfinetFramesEffect"]

#: A wire on which cyclic frames carry data status and IOPS, and acyclic ones are of the classes of ``frame_class``.
PROFINET_FRAMES: Part[Wire] = Part("frames of PROFINET")


class ProfinetFramesEffect(FramesEffect):
    """Frames of one of these classes are lost, or the status of every cyclic frame is changed."""

    needs: ClassVar[Needs] = (*FramesEffect.needs, PROFINET_FRAMES)
    cyclic: ClassVar[int | None] = None
    acyclic: ClassVar[FrameClasses | None] = None
