"""The cyclic data of one drive: outputs of the master into the process image, inputs out of it.

A polled bus needs no row that the engine schedules: the answer to a Data_Exchange is read from the image when it is
asked for.  What the engine's rows count for other buses is counted here.
"""

from __future__ import annotations

import struct
from bisect import bisect_left
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.buses.profibus.device import fast_path
from pnfarm.engine.channels.closed_channels import ClosedChannels
from pnfarm.table.access.record_fields import field_views, row_number
from pnfarm.table.channel import INTERVAL_EDGES_NS
from pnfarm.table.image import LOST_NOT, LOST_STOP
from pnfarm.table.signals import PART_HIGH, PART_LOW, PKW_HEAD, PKW_VALUE, STW1, WORD_NONE

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.buses.profibus.device.fast_path import FastPath

__all__ = ["CyclicImage"]


#: Intervals between outputs of which the mean is reported.
AVERAGED = 32


class _Words:
    """The words of one direction: their places in the telegram, and the slots of the image that they fill or show."""

    __slots__ = ("channel", "coding", "doubles", "octets", "whole")

    def __init__(self, codes: Sequence[int]) -> None:
        self.octets = 2 * len(codes)
        self.coding = struct.Struct(f">{len(codes)}H")
        #: (place, slot) of single words.
        self.whole: list[tuple[int, int]] = []
        high: dict[int, int] = {}
        low: dict[int, int] = {}
        for place, code in enumerate(codes):
            if code == WORD_NONE:
                continue
            slot, part = code >> 2, code & 3
            if part == PART_HIGH:
                high[slot] = place
            elif part == PART_LOW:
                low[slot] = place
            else:
                self.whole.append((place, slot))
        #: (place of the high half, of the low half or -1, slot) of double words.
        self.doubles = [(place, low.get(slot, -1), slot) for slot, place in high.items()]
        #: Those of them that are a task of the parameter channel.
        self.channel: list[tuple[int, int, int]] = []

    def taken(self) -> _Words:
        """In the order in which they are written, as the engine may read between any two of them.

        STW1 comes last, so that its edges come with what belongs to them, the parameter channel's identifier after its
        value.
        """
        self.whole.sort(key=lambda pair: pair[1] == STW1)
        self.doubles.sort(key=lambda double: double[2] == PKW_HEAD)
        self.channel = [double for double in self.doubles if double[2] in {PKW_HEAD, PKW_VALUE}]
        return self

    def as_compiled(self) -> fast_path.Words:
        """As the fast path has them, in the order in which they are written."""
        doubles = [(slot, place, low if low >= 0 else fast_path.LOW_NONE) for place, low, slot in self.doubles]
        return doubles + [(slot, place, fast_path.LOW_SINGLE) for place, slot in self.whole]


def _double(words: Sequence[int], high: int, low: int) -> int:
    """The signed double word of these places; without a low half it is zero."""
    value = words[high] << 16 | (words[low] if low >= 0 else 0)
    return value - (value >> 31 << 32)


class CyclicImage:
    """``image``: the drive's record of the process image.  The counters survive connections and power cycles.

    ``on_cycle`` is called with the mean interval between outputs, ns, of every :data:`AVERAGED` of them.
    """

    def __init__(self, image: Any, on_cycle: Callable[[int], None] | None = None) -> None:
        (
            self._received, self._sent, self._frames, self._filled, self._frame_ns, self._interval_ns, self._valid,
            self._lost,
        ) = field_views(
            image, "received", "sent", "frames", "filled", "frame_ns", "interval_ns", "valid", "lost"
        )  # fmt: skip
        self._row = row_number(image)
        self._counts = ClosedChannels()
        #: Of NumPy, whose own way to one element takes three times as long.
        self._counts.intervals = np.zeros_like(self._counts.intervals)
        self._intervals = memoryview(self._counts.intervals)
        #: What the fast path works on as well (:mod:`pnfarm.buses.profibus.device.fast_path`).
        self.cells: Any = [0] * fast_path.CELLS
        self.cells[fast_path.LEFT] = AVERAGED
        self._fast_path: tuple[FastPath, int] | None = None
        self._on_cycle = on_cycle
        self._has_words = True
        self.layout((), ())

    def join(self, path: FastPath, row: int) -> None:
        """Polls of this drive may be answered there, in this row, from now on."""
        path.place(row, self._row)
        cells = path.cells(row)
        for place in range(fast_path.CELLS):
            cells[place] = self.cells[place]
        self.cells, self._fast_path = cells, (path, row)
        path.layout(row, self._outputs.as_compiled(), self._inputs.as_compiled())

    @property
    def counts(self) -> ClosedChannels:
        """Counters, as of the engine's channels; there is no agreed cycle, so jitter stays empty."""
        counts, cells = self._counts, self.cells
        if cells[fast_path.RECEIVED]:
            counts.received += cells[fast_path.RECEIVED]
            counts.sent += cells[fast_path.SENT]
            counts.interval_sum_ns += cells[fast_path.INTERVAL_SUM]
            for place in range(len(self._intervals)):
                self._intervals[place] += cells[fast_path.FIRST_INTERVAL + place]
            for place in range(fast_path.RECEIVED, fast_path.CELLS):
                cells[place] = 0
        return counts

    @property
    def sent_ns(self) -> int:
        """When inputs were last sent."""
        return int(self.cells[fast_path.SENT_NS])

    def repeat(self, master: int, fcb: int, body: int) -> None:
        """The next poll of this master is as the last one was, whose answer's DA was at ``body``.

        The fast path may answer it.
        """
        cells = self.cells
        cells[fast_path.MASTER], cells[fast_path.FCB_CELL], cells[fast_path.BODY] = master, fcb, body
        cells[fast_path.OUTPUTS], cells[fast_path.INPUTS] = self.output_octets, self.input_octets
        # what is compiled knows words only
        cells[fast_path.READY] = int(self._has_words)

    def repeated(self) -> tuple[int, int, bytes, bytes, int] | None:
        """Master, FCB, outputs, inputs and time of the last poll that the fast path answered since the last call."""
        if self._fast_path is None or not self.cells[fast_path.CHANGED]:
            return None
        self.cells[fast_path.CHANGED] = 0
        path, row = self._fast_path
        cells = self.cells
        return (
            int(cells[fast_path.MASTER]),
            int(cells[fast_path.FCB_CELL]),
            *path.last(row),
            int(cells[fast_path.SENT_NS]),
        )

    def layout(self, output_codes: Sequence[int], input_codes: Sequence[int]) -> None:
        """Another telegram is in force: codes of its words (:mod:`pnfarm.table.signals`)."""
        self._outputs, self._inputs = _Words(output_codes).taken(), _Words(input_codes)
        self.output_octets, self.input_octets = self._outputs.octets, self._inputs.octets
        self.cells[fast_path.READY] = 0
        if self._fast_path is not None:
            path, row = self._fast_path
            path.layout(row, self._outputs.as_compiled(), self._inputs.as_compiled())

    def without_words(self, outputs: int, inputs: int) -> None:
        """The cyclic data are so many octets of a row of plain data: here they are counted only."""
        self.layout((), ())
        self.output_octets, self.input_octets = outputs, inputs
        self._has_words = False

    def begin(self) -> None:
        """A connection begins: the first interval counts from its first data."""
        self.cells[fast_path.LAST] = 0
        self.cells[fast_path.LEFT] = AVERAGED

    def exchanged(self, now: int) -> None:
        """A Data_Exchange was answered, whatever became of its outputs and wherever its inputs are from."""
        self.count(now)
        self._note_sent()
        self.cells[fast_path.SENT_NS] = now

    def take(self, data: bytes, now: int) -> None:
        """Outputs of the length of the telegram."""
        outputs, received = self._outputs, self._received
        words = outputs.coding.unpack(data)
        if outputs.channel and any(received[slot] != _double(words, high, low) for high, low, slot in outputs.channel):
            # no task meanwhile: the engine must not see a value with the identifier of another task
            received[PKW_HEAD] = 0
        for high, low, slot in outputs.doubles:
            # a double word at once: the engine never sees half of a new one
            received[slot] = _double(words, high, low)
        for place, slot in outputs.whole:
            received[slot] = words[place]
        self.note(now)

    def note(self, now: int) -> None:
        """Valid data are in force, whatever they are."""
        last = self.cells[fast_path.LAST]
        self._interval_ns[0] = now - last if last else 0
        self._valid[0] = 1
        self._lost[0] = LOST_NOT
        self._arrived(now)

    def clear(self, now: int) -> None:
        """The master is in Clear: set points are zero, and none of them is valid (EN 50170 part 2, Clear_Data)."""
        self._end(LOST_STOP)
        self._arrived(now)

    def stop(self, why: int) -> None:
        """No set points come any more; ``why`` is one of ``LOST_*`` (:mod:`pnfarm.table.image`)."""
        self._end(why)
        self.cells[fast_path.LAST] = 0

    def fill(self) -> bytes:
        """What a master sends now, counted."""
        self._note_sent()
        return self.shown()

    def shown(self) -> bytes:
        """Inputs as they are now."""
        inputs, sent = self._inputs, self._sent
        words = [0] * (inputs.octets // 2)
        for place, slot in inputs.whole:
            words[place] = sent[slot] & 0xFFFF
        for high, low, slot in inputs.doubles:
            value = sent[slot]
            words[high] = value >> 16 & 0xFFFF
            if low >= 0:
                words[low] = value & 0xFFFF
        return inputs.coding.pack(*words)

    def _end(self, why: int) -> None:
        """In this order, as the engine may step between any two of these: it takes no zero for a control word, and
        finds the reason with the end.
        """
        self._lost[0] = why
        self._valid[0] = 0
        for slot in range(len(self._received)):
            self._received[slot] = 0

    def _arrived(self, now: int) -> None:
        """Other data are in force."""
        self._frame_ns[0] = now
        self._frames[0] = (self._frames[0] + 1) & 0xFFFFFFFF

    def _note_sent(self) -> None:
        self._filled[0] = (self._filled[0] + 1) & 0xFFFFFFFF
        self._counts.sent += 1

    def count(self, now: int) -> None:
        """A telegram with data came, after :meth:`note`."""
        counts, cells = self._counts, self.cells
        counts.received += 1
        last = cells[fast_path.LAST]
        if last:
            interval = now - last
            counts.interval_sum_ns += interval
            self._intervals[bisect_left(INTERVAL_EDGES_NS, interval)] += 1
            cells[fast_path.LEFT] -= 1
            if cells[fast_path.LEFT] <= 0:
                self._averaged(now)
        else:
            cells[fast_path.SINCE] = now
        cells[fast_path.LAST] = now

    def _averaged(self, now: int) -> None:
        mean = (now - self.cells[fast_path.SINCE]) // AVERAGED
        self.cells[fast_path.SINCE], self.cells[fast_path.LEFT] = now, AVERAGED
        if self._on_cycle is not None:
            self._on_cycle(mean)
