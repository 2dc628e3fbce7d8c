"""Where a frame goes, as the drive sees it: ``in`` comes from its controller, ``out`` goes there."""

from __future__ import annotations

from typing import Literal

__all__ = ["Direction", "Directions"]

Direction = Literal["in", "out"]
#: What a user chooses.
Directions = Literal["in", "out", "both"]
