"""When an injection begins on a drive, and from when to when it is in force."""

from __future__ import annotations

import math
import secrets
from typing import TYPE_CHECKING

from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import Window, seed_of
from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from pnfarm.faults.effects.connection import Connection
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.injection import DriveRun
    from pnfarm.faults.plan import InjectionSpec

__all__ = ["again", "cycles_of", "first_random", "pause_of", "seeded", "wait_until", "window_of"]

#: Longest interval between two checks of an injection that waits for a connection or for healthy cycles.
WAIT_NS = 50_000_000


def window_of(spec: InjectionSpec, run: DriveRun, now: int) -> Window | None:
    """When the injection is in force, or None as long as its start is not known."""
    if now < run.not_before:
        return None
    connection = _connection(run.injected)
    window = Window()
    if spec.after_cycles:
        if run.effect.counts_frames:
            window.after = spec.after_cycles
        elif connection is None or cycles_of(run.injected) - run.cycles_before < spec.after_cycles:
            return None
    first = now
    if spec.cycles is not None or (window.after and spec.for_ns is not None):
        if connection is None or not connection.established:
            return None
        first = max(now, connection.next_ns) + window.after * connection.cycle_ns
    stops = [first + spec.for_ns] if spec.for_ns is not None else []
    if spec.cycles is not None and connection is not None:
        # half a cycle before the first frame that is healthy again
        stops.append(first + spec.cycles * connection.cycle_ns - connection.cycle_ns // 2)
    window.stop_ns = min(stops, default=0)
    return window


def wait_until(spec: InjectionSpec, run: DriveRun, now: int) -> int:
    """When the healthy cycles may be over, or the connection there."""
    connection = _connection(run.injected)
    if connection is None or not spec.after_cycles:
        return now + WAIT_NS
    missing = spec.after_cycles - (cycles_of(run.injected) - run.cycles_before)
    return now + max(1, missing) * connection.cycle_ns


def _connection(drive: InjectedDrive) -> Connection | None:
    part = drive.find(CONNECTION)
    return None if part is None else part.now()


def cycles_of(drive: InjectedDrive) -> int:
    """Cycles of the drive's connection so far; 0 for a drive without one."""
    part = drive.find(CONNECTION)
    return 0 if part is None else part.cycles()


def seeded(spec: InjectionSpec) -> InjectionSpec:
    """With a seed where one counts; it is kept in the spec, so that the run can be repeated."""
    if spec.seed is None and ("seed" in spec.kind.takes or spec.chooses):
        return spec.model_copy(update={"seed": secrets.randbits(53)})
    return spec


def first_random(spec: InjectionSpec, drive: str) -> SplitMix64 | None:
    """The random numbers of a rate on one drive."""
    return None if spec.rate is None else SplitMix64(seed_of(spec, f"rate of {drive}"))


def pause_of(spec: InjectionSpec, run: DriveRun) -> int:
    """Time to the next occurrence of a rate, ns: exponential."""
    if spec.rate is None or run.random is None:
        return 0
    return int(-math.log(1.0 - run.random.uniform()) / spec.rate[0] * 1e9)


def again(spec: InjectionSpec, starts: int) -> InjectionSpec:
    """For the next occurrence of a rate: with another seed, or each would lose the same frames."""
    return spec.model_copy(update={"seed": ((spec.seed or 0) + starts * 0x9E3779B97F4A7C15) % (1 << 64)})
