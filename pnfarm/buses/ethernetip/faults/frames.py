"""Frames and messages that only EtherNet/IP has."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.frames import FramesEffect
from pnfarm.faults.parts import Part

if TYPE_CHECKING:
    from pnfarm.faults.effect import Needs
    from pnfarm.faults.gate import FrameClasses
    from pnfarm.faults.wire import Wire

__all__ = ["CIP_FRAMES", "CipFramesEffect"]

#: A wire whose cyclic frames are CIP's class 1, with messages of the classes of :mod:`.messages`.
CIP_FRAMES: Part[Wire] = Part("packets of EtherNet/IP")


class CipFramesEffect(FramesEffect):
    """Every cyclic packet is changed, or messages are."""

    needs: ClassVar[Needs] = (*FramesEffect.needs, CIP_FRAMES)
    cyclic: ClassVar[int | None] = None
    acyclic: ClassVar[FrameClasses | None] = None
