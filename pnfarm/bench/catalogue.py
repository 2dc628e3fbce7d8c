"""The benchmarks by name, and what each of them measures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.bench.cyclic.dense import dense
from pnfarm.bench.cyclic.frames import WAYS, akd_1024, flat, frame_cost, full_port, memory, ways
from pnfarm.bench.cyclic.multi_axis import multi_axis
from pnfarm.bench.devices import devices
from pnfarm.bench.enip import enip_64
from pnfarm.bench.first_start import first_start
from pnfarm.bench.in_memory.start import start_cpu
from pnfarm.bench.in_memory.virtual import firmware, scrape, trace, virtual_time
from pnfarm.bench.latency import fault_latency
from pnfarm.bench.load import Load
from pnfarm.bench.page import page_1000
from pnfarm.bench.plant import plant
from pnfarm.bench.profibus import profibus_32
from pnfarm.bench.result import Result, judged
from pnfarm.bench.start import start_64, start_1024
from pnfarm.bench.storm import storm
from pnfarm.errors import ConfigError, InternalError
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["BENCHMARKS", "Benchmark", "chosen", "measured"]


@dataclass(frozen=True, slots=True)
class Benchmark:
    """``seconds`` is the usual length of one measurement, ``figures`` are the names that ``run`` measures."""

    run: Callable[[float, Load], list[Result]]
    seconds: float
    figures: tuple[str, ...]


def _figures(head: str, *rest: str) -> tuple[str, ...]:
    return tuple(f"{head}-{word}" for word in rest)


#: By name on the command line; each figure can be named there as well.
BENCHMARKS: dict[str, Benchmark] = {
    "frame-cost": Benchmark(
        frame_cost, 10.0, ("frame-cost-192", *_figures("frame-cost-192", "xdp", "floor", "controller"))
    ),
    "ways": Benchmark(ways, 10.0, _figures("ways", *WAYS)),
    "full-port": Benchmark(
        full_port, 60.0, _figures("full-port", "expirations", "lateness-p50", "lateness-p99", "cpu")
    ),
    "dense": Benchmark(dense, 60.0, _figures("dense", "drives", "lateness-p99", "cpu", "next-expirations")),
    "memory": Benchmark(memory, 0.0, ("memory-per-drive",)),
    "flat": Benchmark(
        flat,
        10.0,
        ("cpu-16-drives", "cpu-512-drives", *_figures("added-drive", "16-to-256", "256-to-512", "ratio")),
    ),
    "first-start": Benchmark(first_start, 0.0, ("first-start", *_figures("first-start", "again", "interpreter"))),
    "start": Benchmark(start_64, 0.0, ("start-64", "start-64-interpreter")),
    "start-1024": Benchmark(
        start_1024,
        0.0,
        ("start-1024", *_figures("start-1024", "farm", "farm-64", "ratio", "frames", "frames-64", "interpreter")),
    ),
    "start-cpu": Benchmark(
        start_cpu,
        0.0,
        _figures("start-cpu", "process", "made", "connected", "system-made", "system-connected", "interpreter"),
    ),
    "connect-storm": Benchmark(
        storm,
        5.0,
        _figures(
            "connect-storm",
            *("256", "farm", "controller", "lateness-p99", "lateness-ratio"),
            *("ordinary-p99", "ordinary-floor", "expirations", "interpreter"),
        ),
    ),
    "akd-1024": Benchmark(akd_1024, 10.0, _figures("akd-1024", "cpu", "floor", "expirations")),
    "enip-64": Benchmark(
        enip_64,
        20.0,
        _figures("enip-64", *("cpu", "floor", "ratio", "interval", "drift", "skipped", "expirations", "memory")),
    ),
    "profibus-32": Benchmark(
        profibus_32,
        10.0,
        _figures(
            "profibus-32",
            *("cpu", "reply-p50", "reply-p99", "cycle", "missed", "repeated", "floor-p50", "floor-p99", "floor-cpu"),
        ),
    ),
    "devices": Benchmark(
        devices,
        20.0,
        (
            *("devices-256", *_figures("devices-256", "drives", "floor", "ratio"), "devices-memory"),
            *_figures("devices-signal", "p50", "p99", "floor-p50", "floor-p99"),
        ),
    ),
    "multi-axis": Benchmark(
        multi_axis,
        20.0,
        (
            "multi-axis-128",
            *_figures("multi-axis-128", "single", "ratio"),
            *_figures("multi-axis", "start", "interpreter"),
        ),
    ),
    "plant": Benchmark(
        plant,
        20.0,
        (
            "plant-64-alone",
            "plant-64",
            *_figures("plant-64", "ratio", "lateness"),
            "plant-python",
            "plant-python-floor",
        ),
    ),
    "page-1000": Benchmark(
        page_1000,
        10.0,
        _figures("page-1000", *("cpu", "cpu-8", "memory", "stalled", "lateness", "rate", "flow", "interpreter")),
    ),
    "fault-latency": Benchmark(fault_latency, 30.0, _figures("fault-latency", "p50", "p99", "floor-p50", "floor-p99")),
    "virtual": Benchmark(virtual_time, 0.0, ("virtual-64", "virtual-64-floor", "virtual-hour", "virtual-interpreter")),
    "scrape": Benchmark(scrape, 0.0, ("scrape-256", "scrape-256-interpreter")),
    "trace": Benchmark(trace, 0.0, ("trace-64x8", "trace-64x8-floor")),
    "firmware": Benchmark(firmware, 0.0, _figures("firmware", "speed", "position", "position-16-khz", "loop")),
}


def chosen(names: Sequence[str]) -> dict[str, frozenset[str]]:
    """Benchmarks to run, in the usual order, and which of their figures were asked for.

    A name is a benchmark's or a figure's; none means all.  Raises :class:`ConfigError`.
    """
    for name in names:
        if not any(name == known or name in benchmark.figures for known, benchmark in BENCHMARKS.items()):
            near = did_you_mean(name, [*BENCHMARKS, *(f for b in BENCHMARKS.values() for f in b.figures)])
            known_names = ", ".join(BENCHMARKS)
            raise ConfigError(f"unknown benchmark {name!r}{near}; allowed are {known_names}, and their figures")
    wanted: dict[str, frozenset[str]] = {}
    for known, benchmark in BENCHMARKS.items():
        whole = not names or known in names
        figures = frozenset(figure for figure in benchmark.figures if whole or figure in names)
        if figures:
            wanted[known] = figures
    return wanted


def measured(name: str, wanted: frozenset[str], seconds: float | None) -> list[Result]:
    """Run one benchmark; those of its figures that were asked for, and whether the machine let them be judged."""
    benchmark = BENCHMARKS[name]
    load = Load()
    results = benchmark.run(benchmark.seconds if seconds is None else seconds, load)
    if tuple(result.name for result in results) != benchmark.figures:
        raise InternalError(f"benchmark {name} measured {[result.name for result in results]}")
    return judged([result for result in results if result.name in wanted], load.disturbing)
