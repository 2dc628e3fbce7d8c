"""Direction of a frame, seen from the drive: ``in`` comes from the controller, ``out`` goes to it."""

from __future__ import annotations

from typing import Literal

__all__ = ["Direction", "Directions"]

Direction = Literal["in", "out"]
#: The directions that a user chooses from.
Directions = Literal["in", "out", "both"]
