"""Calls the users' programs of a controller's axes, each once a cycle, and puts what they write into the telegrams.

No clock and no task of its own: :meth:`ProgramRunner.service` makes the calls that are due in virtual time; in real
time a thread makes those of :meth:`ProgramRunner.work` (:class:`pnfarm.user_code.thread.CodeThread`).
A program that raises, or that takes longer than the limit, is not called again; its axis gets OFF1 and no set points,
and its sign of life goes on, so that the drive stops along its ramp.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.controller.axis_program import AxisProgram, Line
from pnfarm.controller.program_file import make_program
from pnfarm.drives.telegrams.signal_view import Inputs, Outputs
from pnfarm.errors import ConfigError
from pnfarm.firmware.profidrive.axis_program import READY
from pnfarm.station.event import Event, event
from pnfarm.table.access.record_fields import field_views
from pnfarm.table.channel import IDLE, OPEN
from pnfarm.table.signals import STW2
from pnfarm.user_code.caller import Caller
from pnfarm.user_code.calling_thread import Call
from pnfarm.user_code.file import error_text, line_of, place_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.controller.group import ControlledDevice, Controllers
    from pnfarm.engine.columns import Columns
    from pnfarm.user_code.thread import Work

__all__ = ["Note", "ProgramFailed", "ProgramLate", "ProgramRunner", "with_programs"]

#: ``note(now, drive, event)``.
Note = Callable[[int, str, Event], object]
#: Has a controller do something, given the time: at once, or where the controller is.
Carry = Callable[[Callable[[int], None]], object]

#: The first cycle that is too slow is logged, and then each that multiplies their number by this.
TOLD_AGAIN = 10


@event("axis program failed", "error")
class ProgramFailed(Event):
    """A user's program raised an exception or did not return: its axis is stopped for good."""

    error: str
    file: str
    line: int


@event("axis program late", "warning")
class ProgramLate(Event):
    """A user's program takes longer than the cycle: telegrams went out with old set points."""

    duration_seconds: float
    cycle_seconds: float
    missed_cycles: int


class _Axis:
    """One axis; ``row`` is that of its image in the table of its controller."""

    def __init__(self, controlled: ControlledDevice, kind: type[AxisProgram], line: Line) -> None:
        device = controlled.device
        assert device.signals is not None
        self.columns = controlled.columns
        self.row = controlled.row
        image = self.columns.image[self.row]
        self._received, self._valid, self._sent = field_views(image, "received", "valid", "sent")
        self._frames, self._filled = field_views(image, "frames", "filled")
        self.name, self.drive = controlled.name, controlled.drive
        self.signals = device.signals
        self.cycle_ns = device.cycle_ns
        self.counts_life = (
            device.life
            and kind.counts_sign_of_life
            and any(form.slot == STW2 for form in device.signals.setpoints.values())
        )
        self.inputs = Inputs(device.signals.actuals)
        self.outputs = Outputs(device.signals.setpoints)
        self.slots = sorted({form.slot for form in device.signals.setpoints.values()})
        self.program = make_program(
            kind,
            line,
            name=controlled.name,
            model=device.model,
            cycle_ns=device.cycle_ns,
            inputs=self.inputs,
            outputs=self.outputs,
        )
        self.due_ns = 0
        #: When its last call is done, if not before the next telegram; else 0.
        self.done_ns = 0
        #: Telegrams filled when it was called last; None without a connection.
        self.filled: int | None = None
        self.life = 0
        self.calls = 0
        self.missed = 0
        self.errors = 0
        self.longest_ns = 0
        self.told = 0
        self.failure = ""

    def read(self) -> None:
        """A copy of what the drive sent, of one telegram."""
        for _ in range(8):
            frames = self._frames[0]
            values = self._received.tolist()
            valid = bool(self._valid[0])
            if self._frames[0] == frames:
                break
        self.inputs._values = values  # noqa: SLF001 - the view is this axis' own
        self.inputs.valid = valid

    def write(self) -> None:
        """What the program wrote, with the sign of life; OFF1 and no set points of an axis that is stopped."""
        stopped = bool(self.failure)
        values = self.outputs._values  # noqa: SLF001 - the view is this axis' own
        if self.counts_life:
            self.life = 1 + self.life % 15
        stw1 = self.signals.setpoints["stw1"].slot if "stw1" in self.signals.setpoints else None
        stw2 = STW2 if self.counts_life else None
        for slot in self.slots:
            value = (READY if slot == stw1 else 0) if stopped else values[slot]
            self._sent[slot] = value & 0x0FFF | self.life << 12 if slot == stw2 else value

    def telegrams_since(self) -> int:
        """How many telegrams were filled since the last call of this method; 1 after a time without a connection."""
        filled = self._filled[0]
        gone = 1 if self.filled is None else (filled - self.filled) & 0xFFFFFFFF
        self.filled = filled
        return gone

    def snapshot(self) -> dict[str, Any]:
        return {
            "calls": self.calls,
            "missed_cycles": self.missed,
            "errors": self.errors,
            "longest_seconds": self.longest_ns / 1e9,
            "failure": self.failure,
        }


class _Providers:
    """Which provider fills the image of an axis, in one table."""

    def __init__(self, columns: Columns) -> None:
        ppm = columns.ppm.view(np.ndarray)
        self.state, self.next_ns = ppm["state"], ppm["next_ns"]
        self._active, self._image, self._rider = ppm["active"], ppm["image"], ppm["rider"]
        #: By the image's row, the provider's row, for those that are open.
        self.rows: dict[int, int] = {}
        self._seen: tuple[bytes, ...] = ()

    def look(self) -> None:
        """Find them again, if they changed."""
        seen = (self._active.tobytes(), self._image.tobytes(), self._rider.tobytes())
        if seen == self._seen:
            return
        self._seen = seen
        self.rows = {}
        for row in np.flatnonzero(self._active == OPEN).tolist():
            one = row
            self.rows[int(self._image[one])] = row
            while rider := int(self._rider[one]):
                one = rider - 1
                self.rows[int(self._image[one])] = row


class ProgramRunner:
    """The axes of all ``controllers`` without a built-in program have one of ``kind``, and are called in their order.

    ``in_real_time``: whether a call that takes longer than its cycle is late; in virtual time none is, unless a call is
    said to take ``call_ns``: the axes' calls follow each other then, and what one writes is sent when it is done.
    ``carry``: needed where the controllers are in another thread; None: what the programs ask of them is done at once.
    Raises :class:`ConfigError` where a program's ``__init__`` fails.
    """

    def __init__(
        self,
        controllers: Controllers,
        kind: type[AxisProgram],
        note: Note,
        *,
        limit_ns: int,
        in_real_time: bool,
        call_ns: int = 0,
        carry: Carry | None = None,
    ) -> None:
        self._note = note
        self._controllers = controllers
        self._carry = carry
        self.limit_ns = limit_ns
        self._in_real_time = in_real_time
        self._call_ns = call_ns
        #: When the processor that all axes with a connection share is free again; only with ``call_ns``.
        self._busy_until_ns = 0
        #: End of the cycle that is missed.
        self._missing_until_ns = 0
        self._caller = Caller()
        self.line = Line(controllers.line_devices())
        self._axes = [
            _Axis(each, kind, self.line) for each in controllers.programmed() if each.device.signals is not None
        ]
        tables = {id(axis.columns): axis.columns for axis in self._axes}
        self._providers = {key: _Providers(columns) for key, columns in tables.items()}
        self._by_name = {axis.name: axis for axis in self._axes}
        #: Of a drive with several axes its first, until another one of them fails.
        self._by_drive = {axis.drive: axis for axis in reversed(self._axes)}

    def program(self, name: str) -> AxisProgram:
        """The object of an axis; raises :class:`KeyError`."""
        return self.line[name]

    def next_deadline(self) -> int | None:
        return min((axis.due_ns for axis in self._axes), default=None)

    def service(self, now: int) -> None:
        """Make the calls that are due."""
        for call in self.work(now):
            self._caller.run(call, self.limit_ns)

    def work(self, now: int) -> Work:
        """The calls that are due."""
        due = [axis for axis in self._axes if axis.due_ns <= now]
        if not due:
            return
        for providers in self._providers.values():
            providers.look()
        called = [axis for axis in due if self._is_due(axis, self._providers[id(axis.columns)], now)]
        # one whose last call is not done waits for its next cycle
        if overrun := [axis.cycle_ns for axis in called if axis.done_ns > now]:
            # a task that is not done when its next cycle begins misses that cycle, for all of its axes
            self._missing_until_ns = max(self._missing_until_ns, now + max(overrun))
        called = [axis for axis in called if not self._misses(axis, now)]
        waiting = [axis for axis in called if not axis.failure]
        for axis in waiting:
            axis.read()
            axis.program.now_ns = now
            axis.program.began_ns = axis.program.began_ns or now
        self.line.take()
        yield from self._call(waiting, now)
        self.line.give()
        self._begin_records(waiting, now)
        for axis in called:
            if self._call_ns and axis.filled is not None and not axis.failure:
                self._busy_until_ns = max(now, self._busy_until_ns) + self._call_ns
                axis.done_ns = self._busy_until_ns
            if axis.done_ns <= axis.due_ns:
                axis.done_ns = 0
                axis.write()

    def _begin_records(self, axes: Sequence[_Axis], now: int) -> None:
        """Hand to the controllers what the programs asked for."""
        asked = [(axis.name, record) for axis in axes for record in axis.program.asked_records]
        if not asked:
            return
        for axis in axes:
            axis.program.asked_records = []

        def begin(now: int) -> None:
            for name, record in asked:
                try:
                    record.begin(self._controllers.access_record(name, record.index, record.written, now))
                except ConfigError as exc:
                    record.refuse(str(exc))

        if self._carry is None:
            begin(now)
        else:
            self._carry(begin)

    def _misses(self, axis: _Axis, now: int) -> bool:
        """Whether an axis is not called in this cycle, because calls of an earlier one took too long."""
        if now >= self._missing_until_ns:
            axis.done_ns = 0
            return False
        axis.missed += 1
        axis.longest_ns = max(axis.longest_ns, self._call_ns)
        self._tell_late(axis, now)
        if 0 < axis.done_ns <= axis.due_ns:
            # done before the next telegram, which is the first to show it
            axis.write()
        return True

    def _is_due(self, axis: _Axis, providers: _Providers, now: int) -> bool:
        """Whether a telegram went out since the last call; without a connection, a cycle passed. Sets the next time."""
        row = providers.rows.get(axis.row)
        if row is None or providers.state[row] == IDLE:
            axis.filled = None
            axis.due_ns = now + axis.cycle_ns
            return True
        next_ns = int(providers.next_ns[row])
        axis.due_ns = next_ns if next_ns > now else now + max(20_000, axis.cycle_ns // 16)
        gone = axis.telegrams_since()
        if gone > 1:
            axis.missed += gone - 1
            self._tell_late(axis, now)
        return gone > 0

    def _tell_late(self, axis: _Axis, now: int) -> None:
        if not (self._in_real_time or self._call_ns) or axis.failure or axis.missed < max(1, axis.told * TOLD_AGAIN):
            return
        axis.told = axis.missed
        self._note(now, axis.name, ProgramLate(axis.longest_ns / 1e9, axis.cycle_ns / 1e9, axis.missed))

    def _call(self, axes: Sequence[_Axis], now: int) -> Work:
        for axis in axes:
            yield (call := Call(partial(axis.program.cycle, axis.inputs, axis.outputs, now)))
            if call.duration_ns is None:
                text = f"cycle() did not return within {self.limit_ns / 1e9:g} s"
                self._fail(axis, text, _file(axis.program), line_of(type(axis.program).cycle), now)
                continue
            axis.calls += 1
            axis.longest_ns = max(axis.longest_ns, call.duration_ns)
            if call.error is not None:
                file, line = place_of(call.error, _file(axis.program))
                self._fail(axis, error_text(call.error), file, line, now)

    def _fail(self, axis: _Axis, text: str, file: str, line: int, now: int) -> None:
        axis.errors += 1
        axis.failure = f"{file}:{line}: {text}"
        if not self._by_drive[axis.drive].failure:
            self._by_drive[axis.drive] = axis
        self._note(now, axis.name, ProgramFailed(text, file, line))

    def snapshot(self, name: str) -> dict[str, Any] | None:
        """Counts of an axis, and why it is stopped, also by its drive's name; None for one without a program."""
        axis = self._by_name.get(name) or self._by_drive.get(name)
        return None if axis is None else axis.snapshot()

    def close(self) -> None:
        """End the threads; one that waits in the kernel ends with the process."""
        self._caller.close()


def with_programs(rows: Sequence[dict[str, Any]], programs: ProgramRunner | None) -> list[dict[str, Any]]:
    """Rows of the controllers' drives; ``program``: counts of a user's program, None without one."""
    return [row | {"program": None if programs is None else programs.snapshot(row["name"])} for row in rows]


def _file(program: AxisProgram) -> str:
    return getattr(sys.modules.get(type(program).__module__), "__file__", None) or ""
