"""The fast path of a poll: a Data_Exchange that is like the one before, from its octets to the answer's, compiled.

Interpreted, a poll takes 50 us, most of them for fetching code into the cache of a processor that has slept since the
last one.  The slave's own way (:meth:`~pnfarm.protocols.profibus.slave.Slave.receive`) answers everything else, and
the first poll of a row; what it does then is repeated here until anything but a poll concerns the slave.

What is compiled takes arrays of numbers, not rows of the table: describing those at each call takes longer than all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.errors import InternalError
from pnfarm.protocols.profibus.wire.telegram import ED, EXTENDED, FCB, FCV, REQUEST, SD2, SD3, Answer, Request
from pnfarm.table.channel import INTERVAL_BUCKETS, INTERVAL_EDGES_NS, MAX_WORDS
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.image import IMAGE, LOST_NOT
from pnfarm.table.signals import PKW_HEAD, PKW_VALUE

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = [
    "BODY", "CELLS", "CHANGED", "FCB_CELL", "FIRST_INTERVAL", "INPUTS", "INTERVAL_SUM", "LAST", "LEFT", "LOW_NONE",
    "LOW_SINGLE", "MASTER", "OUTPUTS", "READY", "RECEIVED", "SENT", "SENT_NS", "SINCE", "FastPath", "Words",
]  # fmt: skip

# Cells of a slave, one number each.
#: 1: the next poll may be answered here.  Set after a poll that the slave answered, cleared by all else.
READY = 0
#: The slave's master, the FCB of the poll before, octets of outputs and inputs, the place of DA in the answer (1 of an
#: SD3, 4 of an SD2).
MASTER, FCB_CELL, OUTPUTS, INPUTS, BODY = 1, 2, 3, 4, 5
#: 1: polls were answered here that the slave does not know of yet.
CHANGED = 6
#: Time of the last outputs, ns; begin of the intervals that are averaged, and how many are left; time of the last
#: inputs.
LAST, SINCE, LEFT, SENT_NS = 7, 8, 9, 10
#: What was counted here and not yet added to the drive's counters.
RECEIVED, SENT, INTERVAL_SUM, FIRST_INTERVAL = 11, 12, 13, 14
CELLS = FIRST_INTERVAL + INTERVAL_BUCKETS
#: The row in the process image, and how many words of each direction there are.
_IMAGE, _TAKEN, _GIVEN = CELLS, CELLS + 1, CELLS + 2
_WIDTH = CELLS + 3

#: In place of the low half's place: a double word without one; a single word.
LOW_NONE, LOW_SINGLE = -1, -2
#: (slot, place, place of the low half) of each word, in the order in which they are written.
Words = list[tuple[int, int, int]]

_NO_ROW = 255
_LONGEST = 256
_EDGES = np.array(INTERVAL_EDGES_NS, np.int64)
_BITS = REQUEST | 0x0F
_LOW, _HIGH = REQUEST | int(Request.SRD_LOW), REQUEST | int(Request.SRD_HIGH)
_DL = int(Answer.DL)
_NEXT = 0xFFFFFFFF


def _place(field: str, octets: int) -> int:
    """Where a field of the image begins, in numbers of so many octets."""
    fields: Any = IMAGE.dtype.fields
    offset = fields[field][1]
    if offset % octets:
        raise InternalError(f"image.{field} is not at a multiple of {octets} octets")
    return int(offset) // octets


#: Places of fields in a row of the images, as octets and as numbers of 32 and of 64 bits.
_VALID, _LOST = _place("valid", 1), _place("lost", 1)
_TAKEN_FROM, _GIVEN_FROM = _place("received", 4), _place("sent", 4)
_FRAMES, _FILLED = _place("frames", 4), _place("filled", 4)
_FRAME_NS, _INTERVAL_NS = _place("frame_ns", 8), _place("interval_ns", 8)


@inlined
def _sum(octets: Any, begin: int, end: int) -> int:
    total = 0
    for place in range(begin, end):
        total += int(octets[place])
    return total & 0xFF


@inlined
def _value(octets: Any, begin: int, words: Any, k: int) -> int:
    """What the k-th of the words has in a telegram."""
    place, low = begin + 2 * words[k, 1], words[k, 2]
    value = np.int64(octets[place]) << 8 | np.int64(octets[place + 1])
    if low != LOW_SINGLE:
        value <<= 16
        if low >= 0:
            at = begin + 2 * low
            value |= np.int64(octets[at]) << 8 | np.int64(octets[at + 1])
        if value >= 0x8000_0000:
            value -= 0x1_0000_0000
    return int(value)


@inlined
def _brings_task(octets: Any, begin: int, words: Any, count: int, image: Any) -> bool:
    """Whether the parameter channel has another task: it is written with care, for the engine reads at any time."""
    for k in range(count):
        slot = words[k, 0]
        if slot in (PKW_HEAD, PKW_VALUE) and _value(octets, begin, words, k) != image[_TAKEN_FROM + slot]:
            return True
    return False


@compiled
def _take(octets: Any, begin: int, words: Any, count: int, image: Any) -> None:
    """Outputs into the image; a double word at once."""
    for k in range(count):
        image[_TAKEN_FROM + words[k, 0]] = _value(octets, begin, words, k)


@inlined
def _give(answer: Any, begin: int, words: Any, count: int, image: Any) -> None:
    """Inputs out of the image."""
    for k in range(count):
        place, low = begin + 2 * words[k, 1], words[k, 2]
        value = np.int64(image[_GIVEN_FROM + words[k, 0]])
        if low >= 0:
            at = begin + 2 * low
            answer[at] = value >> 8 & 0xFF
            answer[at + 1] = value & 0xFF
        if low != LOW_SINGLE:
            value >>= 16
        answer[place] = value >> 8 & 0xFF
        answer[place + 1] = value & 0xFF


@compiled
def _next(count: int) -> int:
    """After an unsigned number of 32 bits, as the signed one that the array has."""
    following = (np.int64(count) + 1) & _NEXT
    return int(following) - 0x1_0000_0000 if following >= 0x8000_0000 else int(following)


@compiled
def _count(cells: Any, now: int) -> None:
    cells[RECEIVED] += 1
    interval = now - cells[LAST]
    cells[INTERVAL_SUM] += interval
    bucket = 0
    while bucket < len(_EDGES) and _EDGES[bucket] < interval:
        bucket += 1
    cells[FIRST_INTERVAL + bucket] += 1
    cells[LEFT] -= 1
    cells[LAST] = now


@compiled
def answer_poll(
    octets: Any,
    length: int,
    now: int,
    rows: Any,
    table: Any,
    words: Any,
    kept: Any,
    answer: Any,
    image_octets: Any,
    image_words: Any,
    image_longs: Any,
) -> int:
    """Octets of the answer, 0 where nothing was done; the slave's row is in ``answer``'s last octet."""
    if length < 10 or octets[length - 1] != ED:
        return 0
    begin = 1
    if octets[0] == SD2:
        begin = 4
        if octets[1] != length - 6 or octets[2] != length - 6 or octets[3] != SD2:
            return 0
    elif octets[0] != SD3 or length != 14:
        return 0
    destination, source, function = octets[begin], octets[begin + 1], octets[begin + 2]
    if (destination | source) & EXTENDED or _sum(octets, begin, length - 2) != octets[length - 2]:
        return 0
    row = rows[destination]
    if row == _NO_ROW:
        return 0
    cells = table[row]
    begin += 3
    if (
        cells[READY] == 0
        or source != cells[MASTER]
        or length - 2 - begin != cells[OUTPUTS]
        or (function & _BITS != _LOW and function & _BITS != _HIGH)
        or (function & FCV and function & FCB == cells[FCB_CELL])
        # a mean is reported, or a first interval has no beginning
        or cells[LEFT] <= 1
        or cells[LAST] == 0
    ):
        return 0
    image = cells[_IMAGE]
    if _brings_task(octets, begin, words[row, 0], cells[_TAKEN], image_words[image]):
        return 0
    _take(octets, begin, words[row, 0], cells[_TAKEN], image_words[image])
    image_longs[image, _INTERVAL_NS] = now - cells[LAST]
    image_octets[image, _VALID] = 1
    image_octets[image, _LOST] = LOST_NOT
    image_longs[image, _FRAME_NS] = now
    image_words[image, _FRAMES] = _next(image_words[image, _FRAMES])
    _count(cells, now)
    for k in range(cells[OUTPUTS]):
        kept[row, 0, k] = octets[begin + k]
    inputs = cells[INPUTS]
    first = cells[BODY]
    for k in range(inputs):
        answer[first + 3 + k] = 0
    _give(answer, first + 3, words[row, 1], cells[_GIVEN], image_words[image])
    for k in range(inputs):
        kept[row, 1, k] = answer[first + 3 + k]
    image_words[image, _FILLED] = _next(image_words[image, _FILLED])
    answer[0] = SD3
    if first == 4:
        answer[0] = answer[3] = SD2
        answer[1] = answer[2] = inputs + 3
    answer[first] = source
    answer[first + 1] = destination
    answer[first + 2] = _DL
    end = first + 3 + inputs
    answer[end] = _sum(answer, first, end)
    answer[end + 1] = ED
    cells[FCB_CELL] = function & FCB
    cells[SENT] += 1
    cells[SENT_NS] = now
    cells[CHANGED] = 1
    answer[len(answer) - 1] = row
    return int(end + 2)


class FastPath:
    """Of the slaves of one line; ``images``: the table of their process images."""

    def __init__(self, slaves: int, images: Any) -> None:
        self._rows: Any = np.full(_LONGEST, _NO_ROW, np.uint8)
        self._table: Any = np.zeros((slaves, _WIDTH), np.int64)
        self._words: Any = np.zeros((slaves, 2, MAX_WORDS, 3), np.int32)
        #: Outputs and inputs of the last poll.
        self._kept: Any = np.zeros((slaves, 2, _LONGEST), np.uint8)
        answer: Any = np.zeros(_LONGEST, np.uint8)
        self._answer, self._view = answer, memoryview(answer)
        # the same memory thrice, each of a kind that is the same for one row and for many: else there would be two
        # specialisations of the code, of which an image of a container has one
        shape = (images.shape[0], -1)
        whole = images.view(np.ndarray)
        self._fields = tuple(whole.view(kind).reshape(shape) for kind in (np.uint8, np.int32, np.int64))
        # compiled, or loaded, before there is a master that waits
        self.answer(self._answer, 0, 0)

    def cells(self, row: int) -> memoryview:
        """The numbers of a slave."""
        cells: Any = self._table[row]
        return memoryview(cells)

    def place(self, row: int, image: int) -> None:
        """Which row of the images is the slave's."""
        self._table[row, _IMAGE] = image

    def layout(self, row: int, outputs: Words, inputs: Words) -> None:
        """The words of the telegram in force."""
        for direction, (words, cell) in enumerate(((outputs, _TAKEN), (inputs, _GIVEN))):
            if words:
                self._words[row, direction, : len(words)] = words
            self._table[row, cell] = len(words)

    def addresses(self, rows: Sequence[tuple[int, int]]) -> None:
        """(address, row) of the slaves that one telegram can concern alone."""
        self._rows[:] = _NO_ROW
        for address, row in rows:
            self._rows[address] = row

    def last(self, row: int) -> tuple[bytes, bytes]:
        """Outputs and inputs of the slave's last poll that was answered here."""
        cells, kept = self._table[row], self._kept[row]
        return kept[0, : cells[OUTPUTS]].tobytes(), kept[1, : cells[INPUTS]].tobytes()

    def answer(self, octets: Any, length: int, now: int) -> tuple[int, memoryview] | None:
        """The slave's row and its answer, which the next call overwrites; None, and nothing done, for all else."""
        size = answer_poll(
            octets, length, now, self._rows, self._table, self._words, self._kept, self._answer, *self._fields
        )
        return (int(self._answer[-1]), self._view[:size]) if size else None
