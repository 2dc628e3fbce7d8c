"""Opening and closing rows of the channel tables, and spreading providers over their cycle."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pnfarm.engine.channels.class1_plan import Class1ConsumerPlan, Class1ProviderPlan
from pnfarm.engine.channels.rtc import TRAILER
from pnfarm.engine.columns import Columns, lookup_rebuild
from pnfarm.errors import InternalError
from pnfarm.firmware.drive_clock import true_duration
from pnfarm.table.channel import FRAME_SLOT, FRAMING_RTC, IDLE, IOXS_GOOD, MAX_IOCS, MAX_IOPS, MAX_WORDS, STATUS_GOOD
from pnfarm.table.signals import PART_HIGH, WORD_NONE
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, ETHERTYPE_VLAN
from pnfarm.wire.rtc import SEND_CLOCK_NS

__all__ = ["ChannelTable", "ConsumerPlan", "ProviderPlan"]

#: Default tag of RT frames: priority 6, VLAN 0 (IEC 61158-6-10).
RT_TAG = 0xC000


@dataclass(frozen=True, slots=True)
class ProviderPlan:
    """What a provider sends.  All offsets count from the first octet of IO data.

    ``words``: (code, offset) of each telegram word; ``iops``: own provider status octets that follow the
    process image; ``constants``: (offset, octet) of everything that never changes (IOCS, IOPS of modules without data).
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


@dataclass(frozen=True, slots=True)
class ConsumerPlan:
    """What a consumer takes.  Offsets count from the first octet of IO data.

    ``feeds``: the station's set points come from here; of two controllers on one drive only one provides them.
    ``zeroes``: bad data is zero in the process image (Moog MSD manual 16), which otherwise keeps the last good data.
    ``drift``: of the clock that measures the data hold time.
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


def _check(words: Sequence[tuple[int, int]], iops: Iterable[int], data_length: int) -> None:
    """The compiled code trusts these offsets, so they are checked here, once."""
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
    return int(provider.length) - (TRAILER if provider.framing == FRAMING_RTC else 0)


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

    def _row(self, name: str) -> int:
        table: Any = getattr(self.columns, name)
        free, resting = self._free[name], self._resting[name]
        passed: list[int] = []
        found: int | None = None
        while free and found is None:
            row = heapq.heappop(free)
            if table[row].state == IDLE:
                found = row
            else:
                passed.append(row)
        for row in passed:
            heapq.heappush(free, row)
        if found is None:
            raise InternalError(f"all {table.shape[0]} rows of the {name} table are in use")
        resting.pop(found, None)
        engine = self.columns.engine[0]
        if name == "ppm":
            engine.ppm_rows = max(int(engine.ppm_rows), found + 1)
        else:
            engine.cpm_rows = max(int(engine.cpm_rows), found + 1)
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

    def open_provider(self, plan: ProviderPlan | Class1ProviderPlan) -> int:
        """A row that sends from the next tick on."""
        _check(plan.words, plan.iops, plan.data_length)
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
        # a record's items are written in a tenth of the time of its attributes
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
        row["words"] = len(plan.words)
        codes, offsets = row.word_code, row.word_offset
        for i, (code, offset) in enumerate(plan.words):
            codes[i] = code
            offsets[i] = start + offset
        row["iops_count"] = len(plan.iops)
        for i, offset in enumerate(plan.iops):
            row.iops_offset[i] = start + offset
        row["iocs_count"] = len(iocs := plan.iocs[:MAX_IOCS])
        for i, offset in enumerate(iocs):
            row.iocs_offset[i] = start + offset
        row["data_status"] = STATUS_GOOD
        row["impairment"] = 0
        row["sent"] = 0
        row["suppressed"] = 0
        row["late"] = 0
        row["last_ns"] = 0
        row["active"] = 1
        return number

    def choose_egress(self, port: int) -> None:
        """Choose anew where the frames of a port leave."""
        ppm = self.columns.ppm
        for number in range(int(self.columns.engine[0].ppm_rows)):
            row = ppm[number]
            if row.active and row.port == port:
                row.exit = self._egress_for(port, bytes(self.columns.frames[number][:6]))

    def open_consumer(self, plan: ConsumerPlan | Class1ConsumerPlan) -> int:
        """A row that receives from the next tick on."""
        _check(plan.words, plan.iops, plan.data_length)
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
        row["words"] = len(plan.words)
        codes, offsets = row.word_code, row.word_offset
        for i, (code, offset) in enumerate(plan.words):
            codes[i] = code
            offsets[i] = offset
        row["iops_count"] = len(plan.iops)
        for i, offset in enumerate(plan.iops):
            row.iops_offset[i] = offset
        row["feeds"] = int(plan.feeds)
        row["zeroes"] = int(plan.zeroes)
        row["generation"] = (int(row.generation) + 1) & 0xFFFFFFFF
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
        row["active"] = 1
        lookup_rebuild(self.columns)
        return number

    def provided(self, number: int) -> bytes:
        """The IO data of a provider as the engine filled it last."""
        row = self.columns.ppm[number]
        return bytes(self.columns.frames[number][int(row.data_offset) : _data_end(row)])

    def consumed(self, number: int) -> bytes:
        """The IO data of a consumer, rebuilt from its words and provider status; what no word carries is zero."""
        row = self.columns.cpm[number]
        image = self.columns.image[row.image]
        data = bytearray(int(row.data_length))
        for i in range(int(row.words)):
            code, offset = int(row.word_code[i]), int(row.word_offset[i])
            if code != WORD_NONE:
                value = int(image.received[code >> 2])
                word = (value >> 16 if code & 3 == PART_HIGH else value) & 0xFFFF
                data[offset : offset + 2] = word.to_bytes(2, "big" if row.framing == FRAMING_RTC else "little")
        for i in range(int(row.iops_count)):
            data[int(row.iops_offset[i])] = int(row.iops)
        return bytes(data)

    def relayout_provider(
        self,
        number: int,
        words: Sequence[tuple[int, int]],
        iops: Sequence[int],
        constants: Sequence[tuple[int, int]],
    ) -> None:
        """Lay out an open provider's frame again after a plug or pull.  Data that no word carries any more is zero."""
        row = self.columns.ppm[number]
        start = int(row.data_offset)
        end = _data_end(row)
        _check(words, iops, end - start)
        # no words and no status while the frame changes: a tick between may send half of it, its statuses changed first
        row.words = 0
        row.iops_count = 0
        frame = self.columns.frames[number]
        for offset, octet in constants:
            frame[start + offset] = octet
        kept = {start + offset for offset, _ in constants} | {start + offset for offset in iops}
        kept |= {start + offset + i for _, offset in words for i in (0, 1)}
        for place in range(start, end):
            if place not in kept:
                frame[place] = 0
        for i, (code, offset) in enumerate(words):
            row.word_code[i] = code
            row.word_offset[i] = start + offset
        for i, offset in enumerate(iops):
            row.iops_offset[i] = start + offset
        row.words = len(words)
        row.iops_count = len(iops)

    def relayout_consumer(
        self, number: int, words: Sequence[tuple[int, int]], iops: Sequence[int], *, feeds: bool
    ) -> None:
        """Change the words of an open consumer's frames; those that it no longer brings are zero at once."""
        row = self.columns.cpm[number]
        _check(words, iops, int(row.data_length))
        self._remove_words(row, words)
        row.iops_count = 0
        for i, (code, offset) in enumerate(words):
            row.word_code[i] = code
            row.word_offset[i] = offset
        for i, offset in enumerate(iops):
            row.iops_offset[i] = offset
        row.words = len(words)
        row.iops_count = len(iops)
        row.feeds = int(feeds)

    def rewrite_words(self, name: str, number: int, words: Sequence[tuple[int, int]]) -> None:
        """Change the telegram words of an open channel; offsets as in the plans."""
        row = getattr(self.columns, name)[number]
        start = int(row.data_offset) if name == "ppm" else 0
        _check(words, (), _data_end(row) - start if name == "ppm" else int(row.data_length))
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
        brought = {int(code) >> 2 for code in row.word_code[: row.words] if code != WORD_NONE} if row.fed else set()
        row.words = 0
        for slot in brought - {code >> 2 for code, _ in words}:
            self.columns.image[row.image].received[slot] = 0

    def close_provider(self, number: int) -> None:
        self._close("ppm", number)

    def close_consumer(self, number: int) -> None:
        self._close("cpm", number)
        lookup_rebuild(self.columns)

    def _close(self, name: str, number: int) -> None:
        row = getattr(self.columns, name)[number]
        row.active = 0
        self._resting[name][number] = int(row.image)
        heapq.heappush(self._free[name], number)
