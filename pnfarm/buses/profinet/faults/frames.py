"""Frames that only PROFINET has: their data status, their classes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.frames import ChosenFramesEffect
from pnfarm.faults.effects.parts import Part

if TYPE_CHECKING:
    from pnfarm.faults.effects.wire import Wire

__all__ = ["PROFINET_FRAMES", "ProfinetFramesEffect"]

#: A wire on which cyclic frames carry data status and IOPS, and acyclic ones are of the classes of ``frame_class``.
PROFINET_FRAMES: Part[Wire] = Part("frames of PROFINET")


class ProfinetFramesEffect(ChosenFramesEffect):
    """Frames of one of these classes are lost, or the status of every cyclic frame is changed."""

    frames = PROFINET_FRAMES
