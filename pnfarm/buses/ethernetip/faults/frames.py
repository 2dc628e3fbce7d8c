"""Frames and messages that only EtherNet/IP has."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.frames import ChosenFramesEffect
from pnfarm.faults.effects.parts import Part

if TYPE_CHECKING:
    from pnfarm.faults.effects.wire import Wire

__all__ = ["CIP_FRAMES", "CipFramesEffect"]

#: A wire whose cyclic frames are CIP's class 1, with messages of the classes of :mod:`.messages`.
CIP_FRAMES: Part[Wire] = Part("packets of EtherNet/IP")


class CipFramesEffect(ChosenFramesEffect):
    """Every cyclic packet is changed, or messages are."""

    frames = CIP_FRAMES
