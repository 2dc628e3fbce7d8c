"""The cyclic data of one drive: outputs of the master into the process image, inputs out of it.

A polled bus needs no row that the engine schedules: the answer to a Data_Exchange is read from the image when it is
asked for.  What the engine's rows count for other buses is counted here.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.engine.closed_channels import ClosedChannels
from pnfarm.table.channel import INTERVAL_EDGES_NS
from pnfarm.table.image import LOST_NOT, LOST_STOP
from pnfarm.table.signals import PART_HIGH, PART_LOW, STW1, WORD_NONE

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["CyclicImage"]

_WORD = np.dtype(">u2")


class _Part:
    """Words of one kind in a telegram: their places, and the slots that they fill or show."""

    __slots__ = ("places", "slots")

    def __init__(self, pairs: Sequence[tuple[int, int]]) -> None:
        self.places = np.array([place for place, _ in pairs], np.intp)
        self.slots = np.array([slot for _, slot in pairs], np.intp)


def _parts(codes: Sequence[int]) -> tuple[_Part, _Part, _Part]:
    """Whole words, high halves and low halves; STW1 last, so that its edges come with what belongs to them."""
    found: tuple[list[tuple[int, int]], ...] = ([], [], [])
    for place, code in enumerate(codes):
        if code != WORD_NONE:
            part = {PART_HIGH: 1, PART_LOW: 2}.get(code & 3, 0)
            found[part].append((place, code >> 2))
    found[0].sort(key=lambda pair: pair[1] == STW1)
    whole, high, low = (_Part(pairs) for pairs in found)
    return whole, high, low


class CyclicImage:
    """``image``: the drive's record of the process image.  The counters survive connections and power cycles."""

    def __init__(self, image: Any) -> None:
        self._image = image
        self._received = image.received
        self._sent = image.sent
        #: Counters, as of the engine's channels; there is no agreed cycle, so jitter stays empty.
        self.counts = ClosedChannels()
        self._last_ns = 0
        #: When inputs were last sent.
        self.sent_ns = 0
        self.layout((), ())

    def layout(self, output_codes: Sequence[int], input_codes: Sequence[int]) -> None:
        """Another telegram is in force: codes of its words (:mod:`pnfarm.table.signals`)."""
        self.output_octets, self.input_octets = 2 * len(output_codes), 2 * len(input_codes)
        self._outputs, self._inputs = _parts(output_codes), _parts(input_codes)

    def begin(self) -> None:
        """A connection begins: the first interval counts from its first data."""
        self._last_ns = 0

    def take(self, data: bytes, now: int) -> None:
        """Outputs of the length of the telegram."""
        words = np.frombuffer(data, _WORD).astype(np.int32)
        whole, high, low = self._outputs
        received = self._received
        if high.slots.size:
            # a double word at once: the engine never sees half of a new one
            double = np.zeros(len(received), np.int32)
            double[high.slots] = words[high.places] << 16
            double[low.slots] |= words[low.places]
            received[high.slots] = double[high.slots]
        received[whole.slots] = words[whole.places]
        image = self._image
        image.interval_ns = now - self._last_ns if self._last_ns else 0
        image.frame_ns = now
        image.frames = (int(image.frames) + 1) & 0xFFFFFFFF
        image.valid = 1
        image.lost = LOST_NOT
        self._count(now)

    def clear(self, now: int) -> None:
        """The master is in Clear: set points are zero, and none of them is valid (EN 50170 part 2, Clear_Data)."""
        self._received[:] = 0
        image = self._image
        image.frame_ns = now
        image.frames = (int(image.frames) + 1) & 0xFFFFFFFF
        image.valid = 0
        image.lost = LOST_STOP
        self._count(now)

    def stop(self, why: int) -> None:
        """No set points come any more; ``why`` is one of ``LOST_*`` (:mod:`pnfarm.table.image`)."""
        image = self._image
        image.valid = 0
        self._received[:] = 0
        image.lost = why
        self._last_ns = 0

    def fill(self) -> bytes:
        """Inputs as they are now."""
        words = np.zeros(self.input_octets // 2, _WORD)
        whole, high, low = self._inputs
        sent = self._sent
        words[whole.places] = sent[whole.slots] & 0xFFFF
        if high.slots.size or low.slots.size:
            now = sent.copy()
            words[high.places] = now[high.slots] >> 16 & 0xFFFF
            words[low.places] = now[low.slots] & 0xFFFF
        image = self._image
        image.filled = (int(image.filled) + 1) & 0xFFFFFFFF
        self.counts.sent += 1
        self.sent_ns = int(image.frame_ns)
        return words.tobytes()

    def _count(self, now: int) -> None:
        counts = self.counts
        counts.received += 1
        if self._last_ns:
            interval = now - self._last_ns
            counts.interval_sum_ns += interval
            counts.intervals[bisect_left(INTERVAL_EDGES_NS, interval)] += 1
        self._last_ns = now
