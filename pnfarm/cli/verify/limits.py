"""The limits of this machine: the shortest cycle that it holds, and an estimate of the drives that fit into 1 ms."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.bench.line import DRIVES, expirations, farm_and_plc, lateness, measure, settled_floor
from pnfarm.bench.load import Load
from pnfarm.cli.file_doctor import ROOMY, measured_costs
from pnfarm.cli.verify.report import CycleFigures, Limits
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["cycle_figures", "holds", "limits"]

#: Cycles that are tried, ns: first that of START, then shorter ones while they are held, else longer ones.
CYCLES_NS = (250_000, 500_000, 1_000_000, 2_000_000, 4_000_000)
START = 2
#: Drives, seconds of a measurement and of the floor's, windows of both.
COUNT, SECONDS, FLOOR_SECONDS, WINDOWS = 16, 4.0, 2.0, 2
#: A drive gives up after so many cycles without a frame.
WATCHDOG = 64
#: No further cycle is begun after this time: all of `pnfarm verify` takes about two minutes.
ENOUGH_SECONDS = 60.0


def holds(p99_seconds: float, cycle_seconds: float, lost: int) -> bool:
    """Whether a cycle is held: no connection was lost, and 99 of 100 ticks begin at most half a cycle late."""
    return lost == 0 and p99_seconds <= cycle_seconds / 2


def cycle_figures(
    clock: Callable[[], float], measured: Callable[[int], CycleFigures] | None = None
) -> tuple[list[CycleFigures], list[str]]:
    """The cycles that were measured, in the order in which they were, and why there are no more."""
    measured = measured or _measured
    begin, place = clock(), START
    found = [measured(CYCLES_NS[place])]
    step = -1 if found[0].held else 1
    while 0 <= (place := place + step) < len(CYCLES_NS):
        if clock() - begin > ENOUGH_SECONDS:
            return found, [f"cycle of {format_duration(CYCLES_NS[place])}: the measurements took long enough"]
        found.append(measured(CYCLES_NS[place]))
        # the first one that is not held, or the first that is
        if found[-1].held is (step > 0):
            break
    return found, []


def _measured(cycle_ns: int) -> CycleFigures:
    load = Load()
    floor = settled_floor(COUNT, 1, cycle_ns, FLOOR_SECONDS, load, windows=WINDOWS)
    with farm_and_plc(COUNT, format_duration(cycle_ns), WATCHDOG, stations=DRIVES) as (farm, plc):
        before = expirations(farm, plc)
        ours, _ = measure(farm, plc, SECONDS, load, WINDOWS)
        lost = expirations(farm, plc) - before
    p50, p99 = (lateness(ours, share).median / 1e6 for share in (0.5, 0.99))
    return CycleFigures(
        cycle_seconds=cycle_ns / 1e9,
        drives=COUNT,
        seconds=SECONDS,
        lateness_p50_seconds=p50,
        lateness_p99_seconds=p99,
        lateness_max_seconds=max(lateness(ours, 1.0).values) / 1e6,
        floor_p99_seconds=lateness(floor, 0.99).median / 1e6,
        stalls=sum(int(answer["overruns"]) for answer in ours),
        lost_connections=lost,
        others_cores=load.cores,
        held=holds(p99, cycle_ns / 1e9, lost),
    )


def limits(cycles: Sequence[CycleFigures]) -> tuple[Limits, list[str]]:
    """With the cost of a frame and of a step, which are measured now; and why one is missing."""
    frame_ns, step_ns, why = measured_costs()
    fit = None
    if frame_ns is not None and step_ns is not None:
        # in each cycle of 1 ms a frame in each direction and a step of the firmware
        fit = int(ROOMY * 1e6 / (2 * frame_ns + step_ns))
    held = [one.cycle_seconds for one in cycles if one.held]
    found = Limits(
        shortest_cycle_seconds=min(held, default=None),
        cycles=list(cycles),
        frame_seconds=None if frame_ns is None else frame_ns / 1e9,
        step_seconds=None if step_ns is None else step_ns / 1e9,
        drives_at_1_ms=fit,
    )
    return found, [f"drives at 1 ms: {why}"] if fit is None else []
