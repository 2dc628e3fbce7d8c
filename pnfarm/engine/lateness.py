"""The record of the farm's own lateness: the engine's from the table; the event loop's, serial lines' and stolen time
as reported.

Nobody reports anything in virtual time, and only the loops of real time write the ring: there the farm is never late.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

from pnfarm.station.lateness import Lateness
from pnfarm.table.compiling.compiled import compiled
from pnfarm.table.late import LATE_ROWS

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.engine.columns import Columns

__all__ = ["LATE_NS", "LOOP_LATE_NS", "Delays", "LatenessRecord", "note_late"]

#: Ticks that are less late than this are not recorded: below each budget, and above what a healthy machine has.
LATE_NS = 200_000
#: A late tick this soon after another shares its row, unless the row is this long already.
JOINED_NS = 2_000_000
LONGEST_NS = 10_000_000
#: Later callbacks of the event loop are recorded; its timers are no more exact than a millisecond.
LOOP_LATE_NS = 2_000_000
#: Kept delays of the event loop, the plant and serial lines, each; and samples of stolen time.
KEPT = SAMPLES = 4096


@compiled
def note_late(engine: Any, rows: Any, due: int, now: int, waited: int) -> None:
    """A tick that was due at ``due`` began at ``now``; its oldest frame had waited for ``waited`` ns."""
    late = max(0, now - due)
    begin = min(due, now)
    head = engine.late_head
    row = rows[(head - 1) % LATE_ROWS]
    if head > 0 and begin - row.end_ns < JOINED_NS and now - row.begin_ns < LONGEST_NS:
        row.end_ns = now
        row.late_ns += late
        row.waited_ns = max(row.waited_ns, waited)
    else:
        row = rows[head % LATE_ROWS]
        row.begin_ns = begin
        row.end_ns = now
        row.late_ns = late
        row.waited_ns = waited
        # last: who reads the ring beside the engine sees whole rows
        engine.late_head = head + 1
    engine.late_until_ns = now
    engine.late_for_ns = late


class Delays:
    """The last delays of one kind that were longer than ``least_ns``."""

    def __init__(self, least_ns: int) -> None:
        self._least_ns = least_ns
        self._kept: deque[tuple[int, int]] = deque(maxlen=KEPT)
        #: When the next thing of this kind is due; 0: not known.  What is overdue is a delay already.
        self.due_ns = 0

    def note(self, now: int, late_ns: int) -> None:
        """What had been due ``late_ns`` before was done at ``now``."""
        if late_ns > self._least_ns:
            self._kept.append((now, late_ns))

    def longest(self, begin: int, end: int) -> int:
        """The longest delay of which some lies in this time, up to its end, ns."""
        overdue = end - self.due_ns if self.due_ns else 0
        longest = overdue if overdue > self._least_ns else 0
        # from the newest on: a storm asks for each of its connections; a copy: another thread may note one
        for now, late in reversed(self._kept.copy()):
            if now <= begin:
                break
            longest = max(longest, min(late, end - (now - late)))
        return longest


class LatenessRecord:
    """See the module's docstring.  ``sample`` is called before stolen time is read, to bring it up to date.

    ``loop``: what the event loop did late; ``plant``: models of the plant that were ready late, noted by their thread;
    ``lines``: octets of serial lines that the kernel carried late.
    """

    def __init__(self, columns: Columns) -> None:
        self._columns = columns
        self.loop = Delays(LOOP_LATE_NS)
        self.plant = Delays(LATE_NS)
        self.lines = Delays(LOOP_LATE_NS)
        self._stolen: deque[tuple[int, int]] = deque(maxlen=SAMPLES)
        self.sample: Callable[[], None] | None = None

    def stolen(self, now: int, total_ns: int) -> None:
        """Stolen time so far, as read at ``now``."""
        self._stolen.append((now, total_ns))

    def between(
        self,
        begin: int,
        end: int,
        budget_ns: int,
        *,
        by_loop: bool = False,
        by_lines: bool = False,
        loop_ns: int = 0,
        together_ns: int = 0,
    ) -> Lateness:
        """How late the farm was from ``begin`` to ``end``; ``loop_ns`` is a delay of the event loop known besides.

        ``by_loop``: the event loop's delay counts; ``by_lines``: that of serial lines in the kernel does.
        ``together_ns``: late ticks within so long count together, as they do in the silence of one connection; 0: all.
        """
        if self.sample is not None:
            self.sample()
        engine_ns, receive_ns = self._engine(begin, end, together_ns)
        loop = self.loop.longest(begin, end)
        stolen = self._stolen_between(begin, end)
        lines = self.lines.longest(begin, end) if by_lines else 0
        return Lateness(
            budget_ns, engine_ns, receive_ns, max(loop, loop_ns, 0), stolen, lines_ns=lines, by_loop=by_loop
        )

    def of_silence(
        self, begin: int, end: int, budget_ns: int, hold_ns: int, cycle_ns: int, *, loop_ns: int
    ) -> Lateness:
        """How late the farm was in a silence of its controller, or before it.

        A farm that was itself late by the controller's data hold time, ``hold_ns`` (0: none), less a cycle has lost the
        connection before the controller was silent.
        """
        own = self.between(begin, end, budget_ns, loop_ns=loop_ns)
        if own.late or not hold_ns:
            return own
        expires_ns = max(cycle_ns, hold_ns - cycle_ns)
        before = self.between(begin - hold_ns - cycle_ns, end, expires_ns, loop_ns=loop_ns)
        return before if before.late else own

    def _engine(self, begin: int, end: int, together_ns: int) -> tuple[int, int]:
        """Lateness of ticks, and the longest wait of a frame beyond a tick."""
        engine = self._columns.engine[0]
        worst = total = waited = 0
        due, head = int(engine.due_ns), int(engine.late_head)
        #: End and lateness of those that count together with the present one, newest first.
        counted: deque[tuple[int, int]] = deque()
        rows = []
        for place in range(head - 1, max(-1, head - 1 - LATE_ROWS), -1):
            row = self._columns.late[place % LATE_ROWS]
            first, last = int(row.begin_ns), int(row.end_ns)
            if last < begin:
                break
            if first < end:
                late = min(int(row.late_ns), min(last, end) - max(first, begin))
                rows.append((first, last, late))
                waited = max(waited, int(row.waited_ns) - int(engine.tick_ns))
        # a tick that is overdue, or that began and has not ended, stands in no row yet
        seen = max(due, begin, rows[0][1] if rows else 0)
        if due and end - seen > LATE_NS:
            rows.insert(0, (seen, end, end - seen))
        for first, last, late in rows:
            # ticks that are late by less than half of the time between them are on time in the long run
            part = late if 2 * late >= last - first else 0
            counted.append((last, part))
            total += part
            while together_ns and counted[0][0] - first > together_ns and len(counted) > 1:
                total -= counted.popleft()[1]
            worst = max(worst, total, late)
        return worst, max(0, waited)

    def _stolen_between(self, begin: int, end: int) -> int:
        """From the last sample before ``begin`` to the first one after ``end``: at least what was stolen."""
        first = last = None
        for when, total in reversed(self._stolen):
            if when >= end or last is None:
                last = total
            first = total
            if when <= begin:
                break
        return last - first if first is not None and last is not None else 0
