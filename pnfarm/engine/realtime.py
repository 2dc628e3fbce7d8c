"""The engine in real time: its own thread, without the interpreter's lock."""

from __future__ import annotations

import ctypes
import os
import platform
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pnfarm.engine.columns import Columns
from pnfarm.engine.lateness import LATE_NS, note_late
from pnfarm.engine.sockets.libc import CLOCK_MONOTONIC, CLOCK_REALTIME, TIMER_ABSTIME, clock_nanosleep, time_ns, write
from pnfarm.engine.sockets.receive_ring import give_back, take_batch
from pnfarm.engine.sockets.rings import Ring, make_ring, send_batch
from pnfarm.engine.sockets.xdp import XdpSocket
from pnfarm.engine.tick import first_due, one_tick, receive_from
from pnfarm.errors import InternalError
from pnfarm.table.compiling.compiled import compiled
from pnfarm.table.engine_row import LATENESS_EDGES_NS

__all__ = ["RealTimeEngine", "RealTimeSettings", "run_loop"]

#: Batches taken in one tick at most, so that a flood cannot keep the engine from sending.
MAX_BATCHES = 16
#: Added to a stamp, it lies after every time of the engine.
FAR_FUTURE = 1 << 62
#: How often :meth:`RealTimeEngine.stop` waits for the thread, and for how long each time.
STOP_WAITS, STOP_SECONDS = 50, 0.1
#: More than a clock that is slewed runs ahead within a tick.
STEP_NS = 100_000
LATENESS_BUCKETS = len(LATENESS_EDGES_NS) + 1
#: An array, because indexing a tuple in compiled code copies it.
_EDGES = np.array(LATENESS_EDGES_NS, np.int64)


@compiled
def offset_of_stamps(ahead: int, before: int) -> int:
    """What is added to the kernel's stamps, which are of the wall clock, for the engine's time.

    ``ahead``: how far the engine's time is ahead of the wall clock, ``before``: the same at the tick before.  Where the
    wall clock has stepped forward since then, a frame from before the step would seem old, and its connection silent:
    this tick's frames came now.
    """
    return ahead if ahead >= before - STEP_NS else FAR_FUTURE


@compiled
def run_loop(columns: Columns, ring: Ring, wake: int, one: Any, until: int) -> None:
    """Tick until ``engine.stop`` or time ``until`` (0 = no end).

    ``wake`` is an eventfd for the event loop, ``one`` an uint64[1] that holds 1.
    """
    engine = columns.engine[0]
    told = engine.event_head
    ahead = FAR_FUTURE
    now = time_ns(CLOCK_MONOTONIC, ring.clock)
    due = first_due(columns, now)
    engine.due_ns = due
    while engine.stop == 0 and (until == 0 or now < until):
        if due > now:
            ring.target[0] = due // 1_000_000_000
            ring.target[1] = due % 1_000_000_000
            clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, ring.target.ctypes.data, 0)
        now = time_ns(CLOCK_MONOTONIC, ring.clock)
        engine.due_ns = max(now, due)
        late = max(0, now - due)
        bucket = 0
        while bucket < LATENESS_BUCKETS - 1 and late > _EDGES[bucket]:
            bucket += 1
        engine.lateness[bucket] += 1
        engine.lateness_sum_ns += late
        engine.lateness_max_ns = max(engine.lateness_max_ns, late)
        offset = FAR_FUTURE
        if ring.stamped:
            ahead, before = now - time_ns(CLOCK_REALTIME, ring.clock), ahead
            offset = offset_of_stamps(ahead, before)
        # one place that takes frames: they are inlined there
        for turn in range(2):
            source = ring.received if turn == 0 else ring.beside
            if source.words.shape[0] == 0:
                continue
            count = take_batch(columns, source, now, offset)
            if turn == 0:
                waited = now - columns.rx_ns[0] if count else 0
                if late > LATE_NS or waited > engine.tick_ns + LATE_NS:
                    note_late(engine, columns.late, due, now, waited)
            batches = 0
            while count > 0:
                receive_from(columns, source.octets, columns.rx_place, count)
                give_back(source, count)
                batches += 1
                count = take_batch(columns, source, now, offset) if batches < MAX_BATCHES else 0
        send_batch(columns, ring, one_tick(columns, now))
        if engine.event_head != told:
            told = engine.event_head
            engine.wakes += 1
            write(wake, one.ctypes.data, 8)
        due = first_due(columns, now)
        engine.due_ns = due
        after = time_ns(CLOCK_MONOTONIC, ring.clock)
        engine.busy_ns += after - now
        now = after
    engine.due_ns = 0


@dataclass(frozen=True, slots=True)
class RealTimeSettings:
    """What the engine requests from the kernel; each may be refused, which is reported."""

    cpu: int | None = None
    #: Of SCHED_FIFO; 0 is the ordinary scheduler, which also serves where the kernel refuses this.  The lowest one goes
    #: before all that is not real time, and after the kernel's threads for interrupts.
    fifo_priority: int = 1
    lock_memory: bool = False
    timer_slack_ns: int | None = 1
    #: Time slice of the ordinary scheduler: a short one lets the engine's ticks interrupt a busy neighbour on its CPU.
    slice_ns: int | None = 100_000
    #: Under the ordinary scheduler.  A thread that has used more than its fair share waits for the whole slices of
    #: busy neighbours, however short its own; with a larger share it does not, and uses no more time than it needs.
    nice: int | None = -11
    timestamps: bool = True


@dataclass(slots=True)
class RealTimeReport:
    """What the kernel granted: name -> None, or the reason of the refusal."""

    granted: list[str] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)

    def note(self, name: str, error: str | None) -> bool:
        """Whether it was granted, which is without an error."""
        if error is None:
            self.granted.append(name)
        else:
            self.refused[name] = error
        return error is None


#: A thread of SCHED_FIFO that is in its ticks for this share of the time, at so many looks in turn, has too much to do.
MOST_SHARE, BUSY_LOOKS = 0.9, 4
PR_SET_TIMERSLACK = 29
MCL_CURRENT, MCL_FUTURE = 1, 2


#: sched_setattr(2) has no wrapper in common C libraries; its number by machine.
SYS_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274, "armv7l": 380, "riscv64": 274}


class _SchedAttr(ctypes.Structure):
    """struct sched_attr, first version: sched_setattr(2)."""

    _fields_ = (
        ("size", ctypes.c_uint32),
        ("policy", ctypes.c_uint32),
        ("flags", ctypes.c_uint64),
        ("nice", ctypes.c_int32),
        ("priority", ctypes.c_uint32),
        ("runtime", ctypes.c_uint64),
        ("deadline", ctypes.c_uint64),
        ("period", ctypes.c_uint64),
    )


def _asked(ask: Callable[[], Any]) -> str | None:
    """Why the kernel refused it; None if it did not."""
    try:
        ask()
    except OSError as exc:
        return exc.strerror
    return None


def _ask_slice(libc: ctypes.CDLL, thread: int, slice_ns: int) -> str | None:
    """Set the slice of the ordinary scheduler; the reason if it is refused, else None.

    Kernels before 6.12 accept the call and change nothing.
    """
    number = SYS_SCHED_SETATTR.get(platform.machine())
    if number is None:
        return f"not known on {platform.machine()}"
    nice = os.getpriority(os.PRIO_PROCESS, thread)
    attr = _SchedAttr(ctypes.sizeof(_SchedAttr), os.SCHED_OTHER, 0, nice, 0, slice_ns, 0, 0)
    failed = libc.syscall(number, thread, ctypes.byref(attr), 0)
    return os.strerror(ctypes.get_errno()) if failed else None


def _ask_ordinary(libc: ctypes.CDLL, thread: int, settings: RealTimeSettings, report: RealTimeReport) -> None:
    """What the thread shall have of the ordinary scheduler."""
    if (nice := settings.nice) is not None:
        report.note(f"nice {nice}", _asked(lambda: os.setpriority(os.PRIO_PROCESS, thread, nice)))
    if settings.slice_ns is not None:
        report.note(f"slice {settings.slice_ns} ns", _ask_slice(libc, thread, settings.slice_ns))


def ask_kernel(settings: RealTimeSettings, report: RealTimeReport) -> None:
    """Request scheduling and memory settings; runs in the engine's thread, to which they apply."""
    libc = ctypes.CDLL(None, use_errno=True)
    if (cpu := settings.cpu) is not None:
        report.note(f"cpu {cpu}", _asked(lambda: os.sched_setaffinity(0, {cpu})))
    priority = settings.fifo_priority
    if not priority or not report.note(_fifo(priority), _asked(lambda: _set_policy(0, os.SCHED_FIFO, priority))):
        _ask_ordinary(libc, threading.get_native_id(), settings, report)
    if settings.lock_memory:
        failed = libc.mlockall(MCL_CURRENT | MCL_FUTURE)
        report.note("mlockall", os.strerror(ctypes.get_errno()) if failed else None)
    if settings.timer_slack_ns is not None:
        failed = libc.prctl(PR_SET_TIMERSLACK, settings.timer_slack_ns, 0, 0, 0)
        report.note(f"timer slack {settings.timer_slack_ns} ns", os.strerror(ctypes.get_errno()) if failed else None)


def _fifo(priority: int) -> str:
    return f"SCHED_FIFO {priority}"


def _set_policy(thread: int, policy: int, priority: int) -> None:
    os.sched_setscheduler(thread, policy, os.sched_param(priority))


class RealTimeEngine:
    """Runs :func:`run_loop` in a thread between :meth:`start` and :meth:`stop`.

    ``beside`` is a second socket to receive from: frames of another EtherType.  ``xdp``: how frames leave through
    one interface, where that has a way of its own.
    ``wake_fd`` becomes readable whenever the engine has written events; the reader drains it with
    ``os.eventfd_read``.
    """

    def __init__(
        self,
        columns: Columns,
        channel_socket: socket.socket,
        settings: RealTimeSettings | None = None,
        *,
        beside: socket.socket | None = None,
        xdp: XdpSocket | None = None,
    ) -> None:
        self.columns = columns
        self.settings = settings or RealTimeSettings()
        self.report = RealTimeReport()
        self.wake_fd = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._socket = channel_socket
        self._ring = make_ring(columns, channel_socket, beside, xdp=xdp, timestamps=self.settings.timestamps)
        self._one = np.ones(1, np.uint64)
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        #: The kernel's number of the engine's thread, 0 before it runs.
        self.thread_id = 0
        self._ready = threading.Event()
        #: Of the last look at the load: when, and ``busy_ns`` then; and how many in turn found it busy.
        self._looked = (0, 0)
        self._busy = 0

    @property
    def running(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def start(self) -> None:
        """Start the thread; returns once its scheduling is settled.

        The loop's machine code is compiled (or loaded) here, in the caller's thread, so that the first
        tick is on time.
        """
        if self._thread is not None:
            raise InternalError("the engine was started twice")
        self.warm_up()
        self.columns.engine[0].stop = 0
        self._thread = threading.Thread(target=self._run, name="pnfarm-engine", daemon=True)
        self._thread.start()
        self._ready.wait()

    def warm_up(self) -> None:
        """Compile or load the loop without ticking."""
        run_loop(self.columns, self._ring, self.wake_fd, self._one, 1)

    def _run(self) -> None:
        self.thread_id = threading.get_native_id()
        try:
            ask_kernel(self.settings, self.report)
            self._ready.set()
            run_loop(self.columns, self._ring, self.wake_fd, self._one, 0)
        except BaseException as exc:  # noqa: BLE001 - carried to the event loop by stop() and check()
            self._failure = exc
            self._ready.set()

    def check(self) -> None:
        """Raise :class:`InternalError` if the thread ended by an exception."""
        if self._failure is not None:
            raise InternalError(f"the engine's thread ended: {self._failure!r}") from self._failure

    def demote_if_overloaded(self) -> tuple[str, str] | None:
        """Give the thread back to the ordinary scheduler if it keeps its CPU for itself; then what it lost, and why.

        To be called at intervals.  Threads of the kernel that belong to this CPU would wait for it.
        """
        name = _fifo(self.settings.fifo_priority)
        now, busy = time.monotonic_ns(), int(self.columns.engine[0].busy_ns)
        (then, before), self._looked = self._looked, (now, busy)
        share = (busy - before) / max(1, now - then)
        self._busy = self._busy + 1 if share >= MOST_SHARE else 0
        if self._busy < BUSY_LOOKS or name not in self.report.granted:
            return None
        _set_policy(self.thread_id, os.SCHED_OTHER, 0)
        self.report.granted.remove(name)
        _ask_ordinary(ctypes.CDLL(None, use_errno=True), self.thread_id, self.settings, self.report)
        return name, f"the engine needs {share:.0%} of its CPU"

    def stop(self) -> None:
        """Ask the thread to return and wait for it (at most one tick, 5 s for a machine under load)."""
        if self._thread is None:
            return
        self.columns.engine[0].stop = 1
        # a machine that stands for seconds takes one of the waits, whatever its length
        for _ in range(STOP_WAITS):
            self._thread.join(STOP_SECONDS)
            if not self._thread.is_alive():
                self._thread = None
                return
        raise InternalError(f"the engine's thread did not return within {STOP_WAITS * STOP_SECONDS:g} s")

    def close(self) -> None:
        self.stop()
        os.close(self.wake_fd)
