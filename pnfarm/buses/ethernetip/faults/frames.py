"""Frames and messages that only EtherNet/IP has."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.effects.parts import Part

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Needs
    from pnfarm.faults.effects.wire import Wire
    from pnfarm.faults.gate.gate import FrameClasses

__all__ = ["CIP_FRAMES", "CipFramesEffect"]

#: A wire whose cyclic frames are CIP's class 1, with messages of the classes of :mod:`.messages`.
CIP_FRAMES: Part[Wire] = Part("packets of EtherNet/IP")


class CipFramesEffect(FramesEffect):
    """Every cyclic packet is changed, or messages are."""

    needs: ClassVar[Needs] = (*FramesEffect.needs, CIP_FRAMES)
    cyclic: ClassVar[int | None] = None
    acyclic: ClassVar[FrameClasses | None] = None
