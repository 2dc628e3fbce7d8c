"""Load of others while a benchmark measures: what all CPUs did, less what the benchmark's own processes used.

Sources: ``/proc/stat`` and ``/proc/PID/stat`` (proc(5)).  Busy is the time that was not idle, because the kernel counts
idle time exactly where it stops its tick, and samples all the rest.  Time that a hypervisor took away (steal) is load.
The kernel's workers are not: they carry the octets of a benchmark's pseudo terminals, a sixth of a core.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from collections.abc import Iterable
    from types import TracebackType

__all__ = ["LIMIT_CORES", "Load", "Mark", "Process", "cpu_times", "load_between", "process_of", "used_by_tree"]

#: Above it, in cores, a figure gives no verdict.  A process that uses a twentieth of a core also uses cache, and delays
#: a tick in twenty: as much as the margin of a goal of 0.95 x the floor.  The kernel's own work stays below it.
LIMIT_CORES = 0.05
#: The kernel counts in steps of 10 ms, several of them: a short measurement is not called disturbed for that, s.
RESOLUTION_SECONDS = 0.05


#: Parent of the kernel's own threads.
KTHREADD = 2


@dataclass(frozen=True, slots=True)
class Process:
    """``used``: seconds of CPU of it and of its children that have ended and were waited for."""

    pid: int
    parent: int
    used: float
    is_worker: bool = False


@dataclass(frozen=True, slots=True)
class Mark:
    """A moment: seconds of all CPUs together since the machine's start, and of the benchmark's own processes."""

    wall: float
    cpus: int
    idle: float
    steal: float
    own: float


def cpu_times(stat: str, ticks: int) -> tuple[int, float, float]:
    """CPUs, seconds idle (waiting for a disk as well), seconds stolen, by the text of ``/proc/stat``."""
    lines = stat.splitlines()
    fields = [int(word) for word in lines[0].split()[1:]]
    cpus = sum(1 for line in lines if line.startswith("cpu") and line[3:4].isdigit())
    return cpus, (fields[3] + fields[4]) / ticks, fields[7] / ticks


def process_of(stat: str, ticks: int) -> Process:
    """By the text of ``/proc/PID/stat``; a name may have blanks and brackets."""
    head, _, tail = stat.rpartition(")")
    fields = tail.split()
    pid, _, name = head.partition(" (")
    used = sum(int(word) for word in fields[11:15]) / ticks
    return Process(int(pid), int(fields[1]), used, int(fields[1]) == KTHREADD and name.startswith("kworker/"))


def used_by_tree(processes: Iterable[Process], root: int) -> float:
    """Seconds of CPU of ``root`` and all below it, and of the kernel's workers."""
    found = list(processes)
    children: dict[int, list[Process]] = {}
    for process in found:
        children.setdefault(process.parent, []).append(process)
    waiting = [process for process in found if process.pid == root]
    used = sum(process.used for process in found if process.is_worker)
    while waiting:
        process = waiting.pop()
        used += process.used
        waiting += children.get(process.pid, ())
    return used


def load_between(before: Mark, after: Mark) -> float:
    """Seconds of CPU that others used, at least those that were stolen."""
    took = after.wall - before.wall
    others = took * after.cpus - (after.idle - before.idle) - (after.own - before.own)
    return max(others, after.steal - before.steal, 0.0)


def _mark() -> Mark:
    ticks = os.sysconf("SC_CLK_TCK")
    wall = time.monotonic()
    cpus, idle, steal = cpu_times(Path("/proc/stat").read_text("ascii"), ticks)
    processes = []
    for folder in os.listdir("/proc"):  # noqa: PTH208 - names of hundreds of processes, of which paths are not wanted
        if folder.isdigit():
            # a process may end between the two reads
            with suppress(FileNotFoundError, ProcessLookupError):
                processes.append(process_of(Path("/proc", folder, "stat").read_text("utf-8", "replace"), ticks))
    return Mark(wall, cpus, idle, steal, used_by_tree(processes, os.getpid()))


class Load:
    """A context: what others use inside it is summed up, as often as it is entered."""

    def __init__(self) -> None:
        self.seconds = self.wall = 0.0
        self._before: Mark | None = None

    def __enter__(self) -> None:
        self._before = _mark()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        before, self._before = self._before, None
        if before is not None:
            after = _mark()
            self.add(after.wall - before.wall, load_between(before, after))

    def add(self, wall: float, seconds: float) -> None:
        """A measurement of ``wall`` seconds, beside which others used ``seconds`` of CPU."""
        self.wall += wall
        self.seconds += seconds

    @property
    def cores(self) -> float:
        if not self.wall:
            raise InternalError("a benchmark did not watch the load beside it")
        return self.seconds / self.wall

    @property
    def disturbing(self) -> float | None:
        """Cores of others if they are more than a figure tolerates, None otherwise."""
        cores = self.cores
        return cores if self.seconds > LIMIT_CORES * self.wall + RESOLUTION_SECONDS else None
