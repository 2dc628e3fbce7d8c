"""Frames that only PROFINET has: their data status, their classes."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.frames import FramesEffect
from pnfarm.faults.parts import Part

if TYPE_CHECKING:
    from pnfarm.faults.effect import Needs
    from pnfarm.faults.gate import FrameClasses
    from pnfarm.faults.wire import Wire

__all__ = ["PROFINET_FRAMES", "ProfinetFramesEffect"]

#: A wire on which cyclic frames carry data status and IOPS, and acyclic ones are of the classes of ``frame_class``.
PROFINET_FRAMES: Part[Wire] = Part("frames of PROFINET")


class ProfinetFramesEffect(FramesEffect):
    """Frames of one of these classes are lost, or the status of every cyclic frame is changed."""

    needs: ClassVar[Needs] = (*FramesEffect.needs, PROFINET_FRAMES)
    cyclic: ClassVar[int | None] = None
    acyclic: ClassVar[FrameClasses | None] = None
