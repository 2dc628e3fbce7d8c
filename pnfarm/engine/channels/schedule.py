"""Opening and closing rows of the channel tables, and spreading providers over their cycle."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Sequence
from typing import Any, ClassVar

from pnfarm.engine.channels.class1_plan import Class1ConsumerPlan, Class1ProviderPlan
from pnfarm.engine.channels.parts import Piece, Rider
from pnfarm.engine.channels.piece_table import PieceTable
from pnfarm.engine.channels.rtc import TRAILER
from pnfarm.engine.columns import Columns, lookup_rebuild
from pnfarm.errors import InternalError
from pnfarm.firmware.drive_clock import true_duration
from pnfarm.table.access.plain_data import copy_plain
from pnfarm.table.channel import (
    CLOSED,
    FRAME_SLOT,
    FRAMING_RTC,
    IDLE,
    IOXS_GOOD,
    MAX_IOCS,
    MAX_IOPS,
    MAX_STATUSES,
    MAX_WORDS,
    OPEN,
    RIDES,
    STATUS_GOOD,
    W_START,
)
from pnfarm.table.plain_data import NOT_TAKEN, PLAIN_OCTETS
from pnfarm.table.signals import PART_HIGH, WORD_NONE
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, ETHERTYPE_VLAN
from pnfarm.wire.rtc import SEND_CLOCK_NS
from pnfarm.wire.value import value_class

__all__ = ["ChannelTable", "ConsumerPlan", "ProviderPlan"]

#: Default tag of RT frames: priority 6, VLAN 0 (IEC 61158-6-10).
RT_TAG = 0xC000


@value_class
class ProviderPlan:
    """What a provider sends.  All offsets count from the first octet of IO data.

    ``words``: (code, offset) of each telegram word; ``iops``: own provider status octets that follow the
    process image; ``constants``: (offset, octet) of everything that never changes (IOCS, IOPS of modules without data).
    ``riders``: further axes of the station; ``pieces``: its plain data, which are in row ``plain``.
    ``iocs``: offsets of the IOCS among them.  ``tag`` is the 802.1Q tag's control information, ``drift`` that of the
    sender's clock (:mod:`pnfarm.firmware.drive_clock`).
    """

    image: int
    port: int
    destination: bytes
    source: bytes
    frame_id: int
    data_length: int
    send_clock_factor: int
    reduction_ratio: int
    words: Sequence[tuple[int, int]]
    iops: Sequence[int]
    constants: Sequence[tuple[int, int]] = ()
    iocs: Sequence[int] = ()
    phase: int = 0
    tag: int = RT_TAG
    drift: float = 0.0
    riders: Sequence[Rider] = ()
    pieces: Sequence[Piece] = ()
    plain: int = 0

    framing: ClassVar[int] = FRAMING_RTC
    trailer: ClassVar[int] = TRAILER
    run_idle: ClassVar[bool] = False

    @property
    def cycle_ns(self) -> int:
        return SEND_CLOCK_NS * self.send_clock_factor * self.reduction_ratio

    @property
    def counter_step(self) -> int:
        return self.send_clock_factor * self.reduction_ratio

    @property
    def phase_ns(self) -> int:
        return (self.phase % self.reduction_ratio) * self.send_clock_factor * SEND_CLOCK_NS

    @property
    def header(self) -> bytes:
        """Everything before the IO data."""
        tag = ETHERTYPE_VLAN.to_bytes(2, "big") + self.tag.to_bytes(2, "big")
        kind = ETHERTYPE_PROFINET.to_bytes(2, "big")
        return self.destination + self.source + tag + kind + self.frame_id.to_bytes(2, "big")


@value_class
class ConsumerPlan:
    """What a consumer takes.  Offsets count from the first octet of IO data.

    ``feeds``: the station's set points come from here; of two controllers on one drive only one provides them.
    ``zeroes``: bad data is zero in the process image (Moog MSD manual 16), which otherwise keeps the last good data.
    ``drift``: of the clock that measures the data hold time.  ``riders``, ``pieces`` and ``plain`` as in
    :class:`ProviderPlan`.
    """

    image: int
    port: int
    destination: bytes
    source: bytes
    frame_id: int
    data_length: int
    send_clock_factor: int
    reduction_ratio: int
    data_hold_factor: int
    words: Sequence[tuple[int, int]]
    iops: Sequence[int]
    feeds: bool = True
    zeroes: bool = False
    drift: float = 0.0
    riders: Sequence[Rider] = ()
    pieces: Sequence[Piece] = ()
    plain: int = 0

    framing: ClassVar[int] = FRAMING_RTC
    run_idle: ClassVar[bool] = False
    own_address: ClassVar[int] = 0
    awaits_ns: ClassVar[int] = 0

    @property
    def peer(self) -> int:
        return int.from_bytes(self.source, "big")

    @property
    def cycle_ns(self) -> int:
        return SEND_CLOCK_NS * self.send_clock_factor * self.reduction_ratio

    @property
    def hold_ns(self) -> int:
        return self.cycle_ns * self.data_hold_factor


def _check(
    words: Sequence[tuple[int, int]],
    iops: Iterable[int],
    data_length: int,
    pieces: Sequence[Piece] = (),
    riders: Sequence[Rider] = (),
) -> None:
    """The compiled code trusts these offsets, so they are checked here, once."""
    for rider in riders:
        _check(rider.words, rider.iops, data_length)
    for piece in pieces:
        ends = piece.frame + piece.length, (piece.status_frame or 0) + 1
        if min(piece.frame, piece.length, piece.status_frame or 0) < 0 or max(ends) > data_length:
            raise InternalError(f"{piece} lies outside of {data_length} octets of IO data")
        if not 0 <= piece.place <= piece.place + piece.length <= PLAIN_OCTETS > piece.status_place >= 0:
            raise InternalError(f"{piece} lies outside of {PLAIN_OCTETS} octets of plain data")
    if len(words) > MAX_WORDS:
        raise InternalError(f"a channel carries {len(words)} telegram words; the table holds {MAX_WORDS}")
    for _, offset in words:
        if not 0 <= offset <= data_length - 2:
            raise InternalError(f"a telegram word at offset {offset} lies outside of {data_length} octets of IO data")
    statuses = list(iops)
    if len(statuses) > MAX_IOPS:
        raise InternalError(f"a channel carries {len(statuses)} provider status octets; the table holds {MAX_IOPS}")
    if any(not 0 <= offset < data_length for offset in statuses):
        raise InternalError(f"a provider status lies outside of {data_length} octets of IO data")


def _data_end(provider: Any) -> int:
    """Where the data of a provider's frame end."""
    return int(provider["length"]) - (TRAILER if provider["framing"] == FRAMING_RTC else 0)


def _write_words(row: Any, words: Sequence[tuple[int, int]], iops: Sequence[int], start: int) -> None:
    """Telegram words and provider statuses of one axis; their number last."""
    # a record's items are read and written in a tenth of the time of its attributes
    codes, offsets, statuses = row["word_code"], row["word_offset"], row["iops_offset"]
    for i, (code, offset) in enumerate(words):
        codes[i] = code
        offsets[i] = start + offset
    for i, offset in enumerate(iops):
        statuses[i] = start + offset
    row["words"], row["iops_count"] = len(words), len(iops)


def _write_statuses(
    row: Any, iops: Sequence[int], riders: Sequence[Rider], pieces: Sequence[Piece], start: int
) -> None:
    """Where an impairment finds the provider statuses of a whole frame."""
    places = [*iops, *(offset for rider in riders for offset in rider.iops)]
    places += [piece.status_frame for piece in pieces if piece.status_frame is not None]
    row["statuses"] = len(places := places[:MAX_STATUSES])
    offsets = row["status_offset"]
    for i, offset in enumerate(places):
        offsets[i] = start + offset


def _own_port(_port: int, _destination: bytes) -> int:
    return 0


class ChannelTable:
    """Allocates rows of ``columns.ppm`` and ``columns.cpm``.

    A closed row is allocated again only after the engine has seen it closed (its state is IDLE), so that
    no tick works on a row that is being rewritten.  The lowest free row is taken, so that the engine has to scan
    few of them.
    """

    def __init__(self, columns: Columns, egress_for: Callable[[int, bytes], int] = _own_port) -> None:
        """``egress_for(port, destination)``: the interface through which a port's frames leave, 0: its own."""
        self.columns = columns
        self._egress_for = egress_for
        # a range is a heap already
        self._free: dict[str, list[int]] = {
            "ppm": list(range(columns.ppm.shape[0])),
            "cpm": list(range(columns.cpm.shape[0])),
        }
        #: Rows that the engine may still have to see closed, and whose image they filled.
        self._resting: dict[str, dict[int, int]] = {"ppm": {}, "cpm": {}}
        self._pieces = PieceTable(columns)

    def _row(self, name: str) -> int:
        table: Any = getattr(self.columns, name)
        free, resting = self._free[name], self._resting[name]
        passed: list[int] = []
        found: int | None = None
        while free and found is None:
            row = heapq.heappop(free)
            if table[row]["state"] == IDLE:
                found = row
            else:
                passed.append(row)
        for row in passed:
            heapq.heappush(free, row)
        if found is None:
            raise InternalError(f"all {table.shape[0]} rows of the {name} table are in use")
        resting.pop(found, None)
        table[found]["pieces"] = 0
        engine = self.columns.engine[0]
        rows = f"{name}_rows"
        engine[rows] = max(int(engine[rows]), found + 1)
        return found

    def resting(self, image: int) -> int:
        """Closed rows of this image that cannot be allocated yet: of providers or of consumers, whichever are more.

        The engine sees a row closed at its next tick.
        """
        counts = []
        for name, rows in self._resting.items():
            table: Any = getattr(self.columns, name)
            for row in [row for row in rows if table[row].state == IDLE]:
                del rows[row]
            counts.append(sum(owner == image for owner in rows.values()))
        return max(counts)

    def _riders(self, name: str, row: Any) -> list[int]:
        """Rows of the further axes in the frames of an open row."""
        found: list[int] = []
        while (following := int(row["rider"])) > 0:
            found.append(following - 1)
            row = getattr(self.columns, name)[following - 1]
        return found

    def _open_riders(self, name: str, row: Any, riders: Sequence[Rider], start: int) -> None:
        """Open a row for each further axis, after ``row``; ``start``: of the IO data, as its words count."""
        following = 0
        table = getattr(self.columns, name)
        for rider in reversed(riders):
            number = self._row(name)
            one = table[number]
            one["image"], one["framing"], one["port"], one["frame_id"] = rider.image, row["framing"], -1, 0
            one["rider"], one["pieces"], one["words"] = following, 0, 0
            one["impairment"] = 0
            _write_words(one, rider.words, rider.iops, start)
            if name == "cpm":
                one["feeds"], one["zeroes"] = int(rider.feeds), row["zeroes"]
                one["hold_ns"] = one["first_hold_ns"] = one["received"] = 0
            else:
                one["state"] = W_START
            one["active"] = RIDES
            following = number + 1
        row["rider"] = following

    def open_provider(self, plan: ProviderPlan | Class1ProviderPlan) -> int:
        """A row that sends from the next tick on."""
        _check(plan.words, plan.iops, plan.data_length, plan.pieces, plan.riders)
        if any(not 0 <= offset < plan.data_length for offset in plan.iocs):
            raise InternalError(f"a consumer status lies outside of {plan.data_length} octets of IO data")
        header = plan.header
        start = len(header)
        length = start + plan.data_length + plan.trailer
        if length > FRAME_SLOT:
            raise InternalError(f"a frame of {length} octets does not fit into {FRAME_SLOT}")
        number = self._row("ppm")
        columns = self.columns
        frame = columns.frames[number]
        frame[:] = 0
        frame[:start] = list(header)
        for offset, octet in plan.constants:
            frame[start + offset] = octet
        for offset in plan.iops:
            frame[start + offset] = IOXS_GOOD
        row = columns.ppm[number]
        row["image"] = plan.image
        row["framing"] = plan.framing
        row["run_idle"] = int(plan.run_idle)
        row["port"] = plan.port
        row["exit"] = self._egress_for(plan.port, plan.destination)
        row["frame_id"] = plan.frame_id
        row["length"] = length
        row["data_offset"] = start
        row["cycle_ns"] = plan.cycle_ns
        row["counter_step"] = plan.counter_step
        row["slipped_ns"] = 0.0
        row["slip_ns"] = plan.cycle_ns - true_duration(plan.cycle_ns, plan.drift) if plan.drift else 0.0
        row["phase_ns"] = plan.phase_ns
        _write_words(row, plan.words, plan.iops, start)
        self._open_riders("ppm", row, plan.riders, start)
        self._pieces.put(row, plan.pieces, plan.plain, start)
        _write_statuses(row, plan.iops, plan.riders, plan.pieces, start)
        row["iocs_count"] = len(iocs := plan.iocs[:MAX_IOCS])
        places = row["iocs_offset"]
        for i, offset in enumerate(iocs):
            places[i] = start + offset
        row["data_status"] = STATUS_GOOD
        row["impairment"] = 0
        row["sent"] = 0
        row["suppressed"] = 0
        row["late"] = 0
        row["last_ns"] = 0
        row["active"] = OPEN
        return number

    def choose_egress(self, port: int) -> None:
        """Choose anew where the frames of a port leave."""
        ppm = self.columns.ppm
        for number in range(int(self.columns.engine[0].ppm_rows)):
            row = ppm[number]
            if row.active == OPEN and row.port == port:
                row.exit = self._egress_for(port, bytes(self.columns.frames[number][:6]))

    def open_consumer(self, plan: ConsumerPlan | Class1ConsumerPlan) -> int:
        """A row that receives from the next tick on."""
        _check(plan.words, plan.iops, plan.data_length, plan.pieces, plan.riders)
        number = self._row("cpm")
        row = self.columns.cpm[number]
        row["image"] = plan.image
        row["framing"] = plan.framing
        row["port"] = plan.port
        row["frame_id"] = plan.frame_id
        row["run_idle"] = int(plan.run_idle)
        row["source"] = plan.peer
        row["address"] = plan.own_address
        row["destination"] = int.from_bytes(plan.destination, "big")
        row["data_length"] = plan.data_length
        _write_words(row, plan.words, plan.iops, 0)
        row["feeds"] = int(plan.feeds)
        row["zeroes"] = int(plan.zeroes)
        self._open_riders("cpm", row, plan.riders, 0)
        self._pieces.put(row, plan.pieces, plan.plain, 0)
        row["generation"] = (int(row["generation"]) + 1) & 0xFFFFFFFF
        row["cycle_ns"] = plan.cycle_ns
        row["hold_ns"] = round(true_duration(plan.hold_ns, plan.drift))
        row["first_hold_ns"] = round(true_duration(plan.awaits_ns, plan.drift))
        row["impairment"] = 0
        row["received"] = 0
        row["discarded"] = 0
        row["expirations"] = 0
        row["intervals"] = 0
        row["interval_sum_ns"] = 0
        row["jitters"] = 0
        row["jitter_sum_ns"] = 0
        row["missed"] = 0
        row["repeated"] = 0
        row["impaired"] = 0
        row["late"] = 0
        row["late_own"] = 0
        row["late_at_ns"] = 0
        row["active"] = OPEN
        lookup_rebuild(self.columns)
        return number

    def provided(self, number: int) -> bytes:
        """The IO data of a provider as the engine filled it last."""
        row = self.columns.ppm[number]
        return bytes(self.columns.frames[number][int(row.data_offset) : _data_end(row)])

    def consumed(self, number: int) -> bytes:
        """The IO data of a consumer, rebuilt from words, plain data and provider status; what none carries is zero."""
        main = self.columns.cpm[number]
        data = bytearray(int(main.data_length))
        for row in (main, *(self.columns.cpm[rider] for rider in self._riders("cpm", main))):
            image = self.columns.image[row.image]
            for i in range(int(row.words)):
                code, offset = int(row.word_code[i]), int(row.word_offset[i])
                if code != WORD_NONE:
                    value = int(image.received[code >> 2])
                    word = (value >> 16 if code & 3 == PART_HIGH else value) & 0xFFFF
                    data[offset : offset + 2] = word.to_bytes(2, "big" if row.framing == FRAMING_RTC else "little")
            for i in range(int(row.iops_count)):
                data[int(row.iops_offset[i])] = int(row.iops)
        if main.pieces:
            octets = copy_plain(self.columns.consumed, int(main.plain))
            for piece in self.columns.piece[int(main.piece) : int(main.piece) + int(main.pieces)]:
                frame, place, length = int(piece.frame), int(piece.place), int(piece.length)
                data[frame : frame + length] = octets[place : place + length]
                if piece.status_frame < NOT_TAKEN:
                    data[int(piece.status_frame)] = octets[int(piece.status_place)]
        return bytes(data)

    def relayout_provider(
        self,
        number: int,
        words: Sequence[tuple[int, int]],
        iops: Sequence[int],
        constants: Sequence[tuple[int, int]],
        *,
        riders: Sequence[Rider] = (),
        pieces: Sequence[Piece] = (),
    ) -> None:
        """Lay out an open provider's frame again after a plug or pull.  Data that nothing carries any more is zero.

        ``riders`` are as many as before.
        """
        row = self.columns.ppm[number]
        start = int(row["data_offset"])
        end = _data_end(row)
        _check(words, iops, end - start, pieces, riders)
        # no words and no status while the frame changes: a tick between may send half of it, its statuses changed first
        further = list(zip([self.columns.ppm[one] for one in self._riders("ppm", row)], riders, strict=True))
        for one in (row, *(one for one, _ in further)):
            one["words"] = one["iops_count"] = 0
        self._pieces.put(row, (), int(row["plain"]), start)
        frame = self.columns.frames[number]
        for offset, octet in constants:
            frame[start + offset] = octet
        kept = {start + offset for offset, _ in constants}
        for part in (Rider(0, words, iops), *riders):
            kept |= {start + offset for offset in part.iops}
            kept |= {start + offset + i for _, offset in part.words for i in (0, 1)}
        for piece in pieces:
            kept |= set(range(start + piece.frame, start + piece.frame + piece.length))
            if piece.status_frame is not None:
                kept.add(start + piece.status_frame)
        for place in range(start, end):
            if place not in kept:
                frame[place] = 0
        _write_words(row, words, iops, start)
        for one, rider in further:
            _write_words(one, rider.words, rider.iops, start)
        self._pieces.put(row, pieces, int(row["plain"]), start)
        _write_statuses(row, iops, riders, pieces, start)

    def relayout_consumer(
        self,
        number: int,
        words: Sequence[tuple[int, int]],
        iops: Sequence[int],
        *,
        feeds: bool,
        riders: Sequence[Rider] = (),
        pieces: Sequence[Piece] = (),
    ) -> None:
        """Change the words of an open consumer's frames; those that it no longer brings are zero at once."""
        row = self.columns.cpm[number]
        _check(words, iops, int(row["data_length"]), pieces, riders)
        further = zip([self.columns.cpm[one] for one in self._riders("cpm", row)], riders, strict=True)
        for one, part in ((row, Rider(0, words, iops, feeds)), *further):
            self._remove_words(one, part.words)
            one["iops_count"] = 0
            _write_words(one, part.words, part.iops, 0)
            one["feeds"] = int(part.feeds)
        self._pieces.put(row, pieces, int(row["plain"]), 0)

    def rewrite_words(self, name: str, number: int, words: Sequence[tuple[int, int]], axis: int = 0) -> None:
        """Change the telegram words of an axis of an open channel; offsets as in the plans."""
        row = getattr(self.columns, name)[number]
        main = row
        start = int(row.data_offset) if name == "ppm" else 0
        _check(words, (), _data_end(row) - start if name == "ppm" else int(row.data_length))
        if axis:
            row = getattr(self.columns, name)[self._riders(name, main)[axis - 1]]
        # no words while the codes change, so that no tick mixes two mappings
        if name == "cpm":
            self._remove_words(row, words)
        row.words = 0
        for i, (code, offset) in enumerate(words):
            row.word_code[i] = code
            row.word_offset[i] = start + offset
        row.words = len(words)

    def _remove_words(self, row: Any, words: Sequence[tuple[int, int]]) -> None:
        """Remove the words of an open consumer: those that ``words`` does not bring are zero from now on."""
        codes = row["word_code"][: row["words"]] if row["fed"] else ()
        brought = {int(code) >> 2 for code in codes if code != WORD_NONE}
        row["words"] = 0
        for slot in brought - {code >> 2 for code, _ in words}:
            self.columns.image[row["image"]]["received"][slot] = 0

    def close_provider(self, number: int) -> None:
        self._close("ppm", number)

    def close_consumer(self, number: int) -> None:
        self._close("cpm", number)
        lookup_rebuild(self.columns)

    def _close(self, name: str, number: int) -> None:
        table = getattr(self.columns, name)
        for one in (number, *self._riders(name, table[number])):
            row = table[one]
            row.active = CLOSED
            self._pieces.leave(row)
            self._resting[name][one] = int(row.image)
            heapq.heappush(self._free[name], one)
