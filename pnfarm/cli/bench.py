"""``pnfarm bench``: measures the cost of the farm and compares it with the floor of this machine, in one run."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from pnfarm.cli.bench_line import (
    cores,
    expirations,
    farm_and_plc,
    lateness,
    measure,
    per_frame,
    settled_floor,
)
from pnfarm.cli.bench_load import Load
from pnfarm.cli.bench_report import markdown, print_table
from pnfarm.cli.bench_result import WINDOWS, Result, exit_code, judged
from pnfarm.cli.completion import complete_benchmark
from pnfarm.errors import ConfigError, InternalError
from pnfarm.farm.address_space import ENGINE, require_address_space
from pnfarm.vocabulary.quoting import did_you_mean

__all__ = ["BENCHMARKS", "Benchmark", "chosen", "command", "measured"]

#: How often floor and farm take turns where a goal is near to the floor.
TURNS = 2


def frame_cost(seconds: float, load: Load) -> list[Result]:
    """CPU of one cyclic frame at 192 drives and 1 ms; floor, farm and a farm that sends by AF_XDP in turn, twice."""
    turn = seconds / TURNS
    low = settled_floor(192, 1, 1_000_000, turn, load)
    ours, theirs, express = [], [], []
    for _ in range(TURNS):
        with farm_and_plc(192, "1ms", 64) as (farm, plc):
            answers = measure(farm, plc, turn, load, WINDOWS // TURNS)
        ours += answers[0]
        theirs += answers[1]
        low += settled_floor(192, 1, 1_000_000, turn, load)
        with farm_and_plc(192, "1ms", 64, send="xdp") as (farm, plc):
            express += measure(farm, plc, turn, load, WINDOWS // TURNS)[0]
    value, floor = per_frame(ours), per_frame(low)
    ratio, unit = value.over(floor), "us of CPU per frame"
    return [
        value.row("frame-cost-192", unit, ratio, "ratio <= 0.95", ratio <= 0.95),
        per_frame(express).row("frame-cost-192-xdp", unit, per_frame(express).over(floor)),
        floor.row("frame-cost-192-floor", unit, 1.0),
        per_frame(theirs).row("frame-cost-192-controller", unit),
    ]


#: Ways of the loops of `ways`: whether frames are received from a ring, and sent through the parent.
WAYS = {"batch": (False, False), "ring": (True, False), "parent": (False, True), "ring-parent": (True, True)}


def ways(seconds: float, load: Load) -> list[Result]:
    """CPU of a frame in the minimal loop: received by system calls or from a ring, sent by macvlan or parent."""
    turn = seconds / TURNS
    answers: dict[str, list[dict[str, Any]]] = {name: [] for name in WAYS}
    for _ in range(TURNS):
        for name, (ring, parent) in WAYS.items():
            answers[name] += settled_floor(192, 1, 1_000_000, turn, load, ring=ring, parent=parent)
    floor = per_frame(answers["batch"])
    found = {name: per_frame(windows) for name, windows in answers.items()}
    return [windows.row(f"ways-{name}", "us of CPU per frame", windows.over(floor)) for name, windows in found.items()]


def full_port(seconds: float, load: Load) -> list[Result]:
    """148 drives at 1 ms, a full 100 Mbit/s port, for a minute."""
    low = settled_floor(148, 1, 1_000_000, min(10.0, seconds), load)
    with farm_and_plc(148, "1ms", 64) as (farm, plc):
        before = expirations(farm, plc)
        ours, _ = measure(farm, plc, seconds, load)
        lost = expirations(farm, plc) - before
    low += settled_floor(148, 1, 1_000_000, min(10.0, seconds), load)
    p50, p99 = lateness(ours, 0.5), lateness(ours, 0.99)
    used, ratio = cores(ours), p99.over(lateness(low, 0.99))
    return [
        Result("full-port-expirations", lost, f"in {seconds:g} s", None, "0", lost == 0),
        p50.row("full-port-lateness-p50", "us", p50.over(lateness(low, 0.5))),
        p99.row("full-port-lateness-p99", "us", ratio, "ratio <= 1.5", ratio <= 1.5),
        used.row("full-port-cpu", "cores", used.over(cores(low))),
    ]


def memory(seconds: float, load: Load) -> list[Result]:
    """Resident memory of one more drive, connected."""
    del seconds
    sizes = {}
    for drives in (16, 272):
        # the watch lasts as long as the question: others' work does not change what is resident
        with farm_and_plc(drives, "16ms", 16) as (farm, _), load:
            farm.ask("rss")
            sizes[drives] = farm.answer()["rss"]
    value = (sizes[272] - sizes[16]) / 256 / 1000
    return [Result("memory-per-drive", value, "kB", None, "<= 200", 0 < value <= 200)]


def flat(seconds: float, load: Load) -> list[Result]:
    """CPU of one more drive at 4 ms: from 16 to 256 drives, and from 256 to 512."""
    used = {}
    for drives in (16, 256, 512):
        with farm_and_plc(drives, "4ms", 64) as (farm, plc):
            used[drives] = cores(measure(farm, plc, seconds, load)[0])
    few, some, many = (used[drives].median for drives in (16, 256, 512))
    # the engine's ticks cost the same for one drive as for many: measured is what a drive adds
    lower, upper = (some - few) / 240 * 1e6, (many - some) / 256 * 1e6
    ratio = upper / lower
    unit = "us of CPU per drive and second"
    return [
        used[16].row("cpu-16-drives", "cores"),
        used[512].row("cpu-512-drives", "cores"),
        Result("added-drive-16-to-256", lower, unit, None, "none", True),
        Result("added-drive-256-to-512", upper, unit, None, "none", True),
        Result("added-drive-ratio", ratio, "upper over lower", None, "<= 1.2", 0 < ratio <= 1.2),
    ]


def start(seconds: float, load: Load) -> list[Result]:
    """Time for 64 drives to connect and exchange data."""
    del seconds
    from pnfarm.cli.bench_start import start_64

    return start_64(load)


def start_1024(seconds: float, load: Load) -> list[Result]:
    """Time for 1,024 AKDs to exchange data, and what a connection costs among them and among 64."""
    del seconds
    from pnfarm.cli.bench_start import start_1024

    return start_1024(load)


def connect_storm(seconds: float, load: Load) -> list[Result]:
    """Connect 256 drives at once, both ends on one core, while 64 others run at 4 ms."""
    from pnfarm.cli.bench_storm import storm

    return storm(seconds, load)


def akd_1024(seconds: float, load: Load) -> list[Result]:
    """1,024 AKDs at the 16 ms of their manual on one core."""
    low = settled_floor(1024, 16, 1_000_000, min(5.0, seconds), load)
    with farm_and_plc(1024, "16ms", 16) as (farm, plc):
        before = expirations(farm, plc)
        used = cores(measure(farm, plc, seconds, load)[0])
        lost = expirations(farm, plc) - before
    floor = cores(low + settled_floor(1024, 16, 1_000_000, min(5.0, seconds), load))
    ratio = used.over(floor)
    return [
        used.row("akd-1024-cpu", "cores", ratio, "ratio <= 1.5", ratio <= 1.5),
        floor.row("akd-1024-floor", "cores", 1.0),
        Result("akd-1024-expirations", lost, f"in {seconds:g} s", None, "0", lost == 0),
    ]


def enip_64(seconds: float, load: Load) -> list[Result]:
    """64 drives on EtherNet/IP at 10 ms on one core, beside the same packets in a minimal loop."""
    from pnfarm.cli.bench_enip import enip_64

    return enip_64(seconds, load)


def page_1000(seconds: float, load: Load) -> list[Result]:
    """What viewers of the web page cost a farm of 1,000 drives that turn."""
    from pnfarm.cli.bench_page import page_1000

    return page_1000(seconds, load)


def profibus_32(seconds: float, load: Load) -> list[Result]:
    """32 drives on one PROFIBUS line over a pty, polled at the cycle of 1.5 Mbit/s, beside an echo."""
    from pnfarm.cli.bench_profibus import profibus_32

    return profibus_32(seconds, load)


def scrape(seconds: float, load: Load) -> list[Result]:
    """Prometheus scrapes 256 connected drives, with changed counters each time."""
    del seconds
    from pnfarm.cli.bench_memory import scrape

    return scrape(load)


def virtual_time(seconds: float, load: Load) -> list[Result]:
    """64 drives at 1 ms and their controller in memory, beside the copying of their frames; an hour of two drives."""
    del seconds
    from pnfarm.cli.bench_memory import virtual_time

    return virtual_time(load)


def firmware(seconds: float, load: Load) -> list[Result]:
    """One drive's own firmware in a step of 1 ms: all models mixed, moving."""
    del seconds
    from pnfarm.cli.bench_memory import firmware

    return firmware(load)


def trace(seconds: float, load: Load) -> list[Result]:
    """Trace 8 signals of 64 drives at 1 ms, in memory: what it adds, beside the whole engine without a trace."""
    del seconds
    from pnfarm.cli.bench_memory import trace

    return trace(load)


def fault_latency(seconds: float, load: Load) -> list[Result]:
    """Inject a fault by the API into one of 16 drives at 4 ms: from the request to the first changed frame."""
    from pnfarm.cli.bench_latency import fault_latency

    return fault_latency(seconds, load)


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
    "memory": Benchmark(memory, 0.0, ("memory-per-drive",)),
    "flat": Benchmark(
        flat,
        10.0,
        ("cpu-16-drives", "cpu-512-drives", *_figures("added-drive", "16-to-256", "256-to-512", "ratio")),
    ),
    "start": Benchmark(start, 0.0, ("start-64", "start-64-interpreter")),
    "start-1024": Benchmark(
        start_1024,
        0.0,
        ("start-1024", *_figures("start-1024", "farm", "farm-64", "ratio", "frames", "frames-64", "interpreter")),
    ),
    "connect-storm": Benchmark(
        connect_storm,
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


def command(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            help="Benchmarks, or single figures of them; default: all.",
            autocompletion=complete_benchmark,
        ),
    ] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the figures to this file as JSON.")] = None,
    markdown_file: Annotated[
        Path | None, typer.Option("--markdown", help="Write the figures to this file as a page of documentation.")
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.1, max=3600, help="Length of each measurement; default: depends on the benchmark."),
    ] = None,
) -> None:
    """Run the benchmarks, and compare the farm with the floor of this machine.

    Exit codes: 1 a goal was missed; 3 none was missed, but one could not be judged, because others were at work.
    """
    require_address_space(ENGINE)
    wanted = chosen(names or [])
    from pnfarm.links.sandbox import enter_sandbox

    enter_sandbox()
    # threads may exist from here on
    import anyio

    from pnfarm.cli.running import compile_ahead

    # compile beforehand, in a process of its own: otherwise the first benchmark would measure the compiler
    anyio.run(compile_ahead)
    results: list[Result] = []
    for place, (name, figures) in enumerate(wanted.items(), 1):
        counted = f" ({place} of {len(wanted)})" if len(wanted) > 1 else ""
        typer.echo(f"{name}{counted}: {(BENCHMARKS[name].run.__doc__ or '').splitlines()[0]}", err=True)
        results += measured(name, figures, seconds)
    print_table(results)
    if json_file is not None:
        json_file.write_text(json.dumps([asdict(r) for r in results], indent=1) + "\n", encoding="utf-8")
    if markdown_file is not None:
        markdown_file.write_text(markdown(results), encoding="utf-8")
    if code := exit_code(results):
        raise typer.Exit(code)
