"""Parts of a channel's frames beside the first axis's words: further axes, and plain data.

All offsets count from the first octet of IO data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pnfarm.wire.value import value_class

__all__ = ["Piece", "Rider"]


@value_class
class Rider:
    """The part of a further axis in a channel's frames: words and statuses as in the plans, its own process image."""

    image: int
    words: Sequence[tuple[int, int]]
    iops: Sequence[int]
    feeds: bool = True


@dataclass(frozen=True, slots=True)
class Piece:
    """Plain data of one submodule: their place in the frame and in the station's row, and those of their status.

    ``taken`` False: a consumer leaves the data as they are, with status BAD.
    """

    frame: int
    place: int
    length: int
    status_frame: int | None
    status_place: int
    taken: bool = True
