"""``pnfarm bench``: measures the cost of the farm and compares it with the floor of this machine, in one run."""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.cli.bench_line import (
    FARM_CPU,
    PARENT,
    PEER,
    PEER_CPU,
    Child,
    Result,
    farm_and_plc,
    farm_file,
    measure,
    per_frame,
    percentile,
    settled_floor,
    wire,
)
from pnfarm.cli.completion import complete_benchmark
from pnfarm.errors import ConfigError, InternalError
from pnfarm.farm.address_space import ENGINE, require_address_space
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from pnfarm.controller.line import VirtualLine

__all__ = ["BENCHMARKS", "Benchmark", "chosen", "command", "measured"]


def frame_cost(seconds: float) -> list[Result]:
    """CPU of one cyclic frame at 192 drives and 1 ms."""
    floor = per_frame(settled_floor(192, 1, 1_000_000, seconds))
    with farm_and_plc(192, "1ms", 64) as (farm, plc):
        answer, other = measure(farm, plc, seconds)
    value = per_frame(answer)
    again = per_frame(settled_floor(192, 1, 1_000_000, seconds))
    floor = (floor + again) / 2
    ratio = value / floor
    return [
        Result("frame-cost-192", value, "us of CPU per frame", ratio, "ratio <= 1.2", ratio <= 1.2),
        Result("frame-cost-192-floor", floor, "us of CPU per frame", 1.0, "none", True),
        Result("frame-cost-192-controller", per_frame(other), "us of CPU per frame", None, "none", True),
    ]


def full_port(seconds: float) -> list[Result]:
    """148 drives at 1 ms, a full 100 Mbit/s port, for a minute."""
    floor = settled_floor(148, 1, 1_000_000, min(20.0, seconds))
    floor_p99 = percentile(floor["lateness"], 0.99)
    with farm_and_plc(148, "1ms", 64) as (farm, plc):
        answer, other = measure(farm, plc, seconds)
    p99 = percentile(answer["lateness"], 0.99)
    expirations = answer["expirations"] + other["expirations"]
    core = answer["cpu"] / answer["wall"]
    ratio = p99 / floor_p99
    return [
        Result("full-port-expirations", expirations, f"in {seconds:g} s", None, "0", expirations == 0),
        Result("full-port-lateness-p50", percentile(answer["lateness"], 0.5), "us", None, "none", True),
        Result("full-port-lateness-p99", p99, "us", ratio, "ratio <= 1.5", ratio <= 1.5),
        Result("full-port-cpu", core, "cores", None, "none", True),
    ]


def memory(seconds: float) -> list[Result]:
    """Resident memory of one more drive, connected."""
    del seconds
    sizes = {}
    for drives in (16, 272):
        with farm_and_plc(drives, "16ms", 16) as (farm, _):
            farm.ask("rss")
            sizes[drives] = farm.answer()["rss"]
    value = (sizes[272] - sizes[16]) / 256 / 1000
    return [Result("memory-per-drive", value, "kB", None, "<= 200", 0 < value <= 200)]


def flat(seconds: float) -> list[Result]:
    """CPU of one more drive at 4 ms: from 16 to 256 drives, and from 256 to 512."""
    cores = {}
    for drives in (16, 256, 512):
        with farm_and_plc(drives, "4ms", 64) as (farm, plc):
            answer, _ = measure(farm, plc, seconds)
        cores[drives] = answer["cpu"] / answer["wall"]
    # the engine's ticks cost the same for one drive as for many: measured is what a drive adds
    lower = (cores[256] - cores[16]) / 240 * 1e6
    upper = (cores[512] - cores[256]) / 256 * 1e6
    ratio = upper / lower
    unit = "us of CPU per drive and second"
    return [
        Result("cpu-16-drives", cores[16], "cores", None, "none", True),
        Result("cpu-512-drives", cores[512], "cores", None, "none", True),
        Result("added-drive-16-to-256", lower, unit, None, "none", True),
        Result("added-drive-256-to-512", upper, unit, None, "none", True),
        Result("added-drive-ratio", ratio, "upper over lower", None, "0.8 to 1.2", abs(ratio - 1) <= 0.2),
    ]


def start(seconds: float) -> list[Result]:
    """Time for 64 drives to connect and exchange data."""
    del seconds
    with wire(), ExitStack() as stack:
        begin = time.monotonic()
        plc = Child("plc", PEER_CPU, file=farm_file(64, "16ms", 16, PEER_CPU), interface_from_outside=PEER)
        stack.callback(plc.close)
        farm = Child("farm", FARM_CPU, file=farm_file(64, "16ms", 16, FARM_CPU))
        stack.callback(farm.close)
        farm.answer()
        plc.answer()
        plc.ask("connected 60")
        connected = plc.answer()["connected"]
        value = time.monotonic() - begin
    return [Result("start-64", value, "s", None, "<= 5", connected and value <= 5)]


def start_1024(seconds: float) -> list[Result]:
    """Time for 1,024 AKDs to exchange data, and what a connection costs among them and among 64."""
    del seconds
    from pnfarm.cli.bench_start import start_1024

    return start_1024()


def connect_storm(seconds: float) -> list[Result]:
    """Connect 256 drives at once, both ends on one core, while 64 others run at 4 ms."""
    from pnfarm.cli.bench_storm import storm

    return storm(seconds)


def akd_1024(seconds: float) -> list[Result]:
    """1,024 AKDs at the 16 ms of their manual on one core."""
    with farm_and_plc(1024, "16ms", 16) as (farm, plc):
        answer, other = measure(farm, plc, seconds)
    core = answer["cpu"] / answer["wall"]
    lost = answer["expirations"] + other["expirations"]
    floor = settled_floor(1024, 16, 1_000_000, min(10.0, seconds))
    ratio = core / (floor["cpu"] / floor["wall"])
    return [
        Result("akd-1024-cpu", core, "cores", ratio, "< 0.35", core < 0.35),
        Result("akd-1024-expirations", lost, f"in {seconds:g} s", None, "0", lost == 0),
    ]


def enip_64(seconds: float) -> list[Result]:
    """64 drives on EtherNet/IP at 10 ms on one core, beside the same packets in a minimal loop."""
    from pnfarm.cli.bench_enip import enip_64

    return enip_64(seconds)


def page_1000(seconds: float) -> list[Result]:
    """What viewers of the web page cost a farm of 1,000 drives that turn."""
    from pnfarm.cli.bench_page import page_1000

    return page_1000(seconds)


def profibus_32(seconds: float) -> list[Result]:
    """32 drives on one PROFIBUS line over a pty, polled at the cycle of 1.5 Mbit/s, beside an echo."""
    from pnfarm.cli.bench_profibus import profibus_32

    return profibus_32(seconds)


def _in_memory(drives: int, cycle: str, watchdog: int) -> VirtualLine:
    """The benchmarks' farm and controller in virtual time."""
    import anyio

    from pnfarm.controller.line import VirtualLine
    from pnfarm.farm.file.reading import parse_farm

    text = farm_file(drives, cycle, watchdog, FARM_CPU).replace(f"kind: macvlan, parent: {PARENT}", "kind: memory")
    return anyio.run(VirtualLine.create, parse_farm(text.replace(f"  interface: {PEER}\n", "")))


def scrape(seconds: float) -> list[Result]:
    """Prometheus scrapes 256 connected drives: the best of ten scrapes, with changed counters each time."""
    del seconds
    from pnfarm.metrics.collector import FarmCollector

    line = _in_memory(256, "16ms", 16)
    collector = FarmCollector(line.farm)
    if not line.world.run(60.0, until=lambda: line.plc.all_connected):
        raise InternalError("256 drives did not connect in virtual time")
    best = float("inf")
    for _ in range(10):
        line.world.run(0.1)
        begin = time.perf_counter()
        collector.gather().text()
        best = min(best, time.perf_counter() - begin)
    return [Result("scrape-256", best * 1000, "ms", None, "none", True)]


def virtual_time(seconds: float) -> list[Result]:
    """64 drives at 1 ms and their controller in memory, beside the copying of their frames; an hour of two drives."""
    del seconds
    many, few = _in_memory(64, "1ms", 3), _in_memory(2, "16ms", 3)
    _run_up(many)
    _run_up(few)
    took = floor = float("inf")
    _copied(1)
    for _ in range(100):
        begin = time.thread_time()
        many.world.run(0.2)
        took = min(took, time.thread_time() - begin)
        floor = min(floor, _copied(200))
    begin = time.thread_time()
    few.world.run(3600.0)
    hour = time.thread_time() - begin
    ratio = took / floor
    return [
        Result("virtual-64", 0.2 / took, "times faster than real time", ratio, "ratio <= 45", ratio <= 45),
        Result("virtual-64-floor", 0.2 / floor, "times faster than real time", 1.0, "none", True),
        Result("virtual-hour", hour, "s of CPU for an hour of 2 drives", None, "none", True),
    ]


def _run_up(line: VirtualLine) -> None:
    if not line.world.run(30.0, until=lambda: line.plc.all_connected and line.plc.all_running):
        raise InternalError("the drives did not run in virtual time")


def _copied(rounds: int) -> float:
    """Seconds for copying and reading 64 frames in both directions."""
    import numpy as np

    from pnfarm.engine.floor import copy_floor

    sent = np.zeros((128, 64), np.uint8)
    begin = time.thread_time()
    copy_floor(sent, np.zeros_like(sent), rounds)
    return time.thread_time() - begin


def firmware(seconds: float) -> list[Result]:
    """One drive's own firmware in a step of 1 ms: all models mixed, moving."""
    del seconds
    from pnfarm.cli.bench_firmware import POSITION, SPEED, cost_of_a_step

    results = []
    for name, text in (("speed", SPEED), ("position", POSITION)):
        value = cost_of_a_step(text)
        results.append(Result(f"firmware-{name}", value, "ns per drive and step", None, "< 500", value < 500))
    value = cost_of_a_step(POSITION, motor_step_ns=62_500)
    results.append(Result("firmware-position-16-khz", value, "ns per drive and step", None, "none", True))
    return results


def trace(seconds: float) -> list[Result]:
    """Trace 8 signals of 64 drives at 1 ms, in memory: what it adds, beside the whole engine without a trace."""
    del seconds
    from pnfarm.cli.bench_trace import cost_of_a_trace

    floor, traced = cost_of_a_trace(_in_memory(64, "1ms", 3))
    added = (traced - floor) * 100
    unit = "% of a core"
    return [
        Result("trace-64x8", added, unit, traced / floor, "<= 3", added <= 3),
        Result("trace-64x8-floor", floor * 100, unit, 1.0, "none", True),
    ]


def fault_latency(seconds: float) -> list[Result]:
    """Inject a fault by the API into one of 16 drives at 4 ms: from the request to the first changed frame."""
    from pnfarm.cli.bench_latency import fault_latency

    return fault_latency(seconds)


@dataclass(frozen=True, slots=True)
class Benchmark:
    """``seconds`` is the usual length of one measurement, ``figures`` are the names that ``run`` measures."""

    run: Callable[[float], list[Result]]
    seconds: float
    figures: tuple[str, ...]


def _figures(head: str, *rest: str) -> tuple[str, ...]:
    return tuple(f"{head}-{word}" for word in rest)


#: By name on the command line; each figure can be named there as well.
BENCHMARKS: dict[str, Benchmark] = {
    "frame-cost": Benchmark(frame_cost, 10.0, ("frame-cost-192", "frame-cost-192-floor", "frame-cost-192-controller")),
    "full-port": Benchmark(
        full_port, 60.0, _figures("full-port", "expirations", "lateness-p50", "lateness-p99", "cpu")
    ),
    "memory": Benchmark(memory, 0.0, ("memory-per-drive",)),
    "flat": Benchmark(
        flat,
        10.0,
        ("cpu-16-drives", "cpu-512-drives", *_figures("added-drive", "16-to-256", "256-to-512", "ratio")),
    ),
    "start": Benchmark(start, 0.0, ("start-64",)),
    "start-1024": Benchmark(
        start_1024, 0.0, ("start-1024", *_figures("start-1024", "farm", "farm-64", "ratio", "interpreter"))
    ),
    "connect-storm": Benchmark(
        connect_storm,
        5.0,
        _figures(
            "connect-storm",
            *("256", "farm", "controller", "lateness-p99", "lateness-ratio"),
            *("ordinary-p99", "ordinary-ratio", "expirations", "interpreter"),
        ),
    ),
    "akd-1024": Benchmark(akd_1024, 10.0, _figures("akd-1024", "cpu", "expirations")),
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
            *("cpu", "reply-p50", "reply-p99", "cycle", "missed", "floor-p50", "floor-p99", "floor-cpu"),
        ),
    ),
    "page-1000": Benchmark(
        page_1000,
        10.0,
        _figures("page-1000", *("cpu", "cpu-8", "memory", "stalled", "lateness", "rate", "flow")),
    ),
    "fault-latency": Benchmark(fault_latency, 30.0, _figures("fault-latency", "p50", "p99", "floor-p50", "floor-p99")),
    "virtual": Benchmark(virtual_time, 0.0, ("virtual-64", "virtual-64-floor", "virtual-hour")),
    "scrape": Benchmark(scrape, 0.0, ("scrape-256",)),
    "trace": Benchmark(trace, 0.0, ("trace-64x8", "trace-64x8-floor")),
    "firmware": Benchmark(firmware, 0.0, _figures("firmware", "speed", "position", "position-16-khz")),
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
    """Run one benchmark; those of its figures that were asked for."""
    benchmark = BENCHMARKS[name]
    results = benchmark.run(benchmark.seconds if seconds is None else seconds)
    if tuple(result.name for result in results) != benchmark.figures:
        raise InternalError(f"benchmark {name} measured {[result.name for result in results]}")
    return [result for result in results if result.name in wanted]


def _table(results: list[Result]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"pnfarm bench, {os.cpu_count()} CPUs")
    for column in ("benchmark", "value", "unit", "to floor", "goal", ""):
        table.add_column(column)
    for r in results:
        ratio = "" if r.ratio_to_floor is None else f"{r.ratio_to_floor:.2f}"
        verdict = "" if r.goal == "none" else ("[green]ok" if r.ok else "[red]missed")
        table.add_row(r.name, f"{r.value:.4g}", r.unit, ratio, "" if r.goal == "none" else r.goal, verdict)
    Console(emoji=False).print(table)


def _markdown(results: list[Result]) -> str:
    lines = [
        "# Figures",
        "",
        f"What `pnfarm bench --markdown docs/bench.md` printed on {datetime.now(UTC).date().isoformat()},",
        f"on a machine with {os.cpu_count()} CPUs",
        f"({platform.machine()}, Linux {platform.release()}, Python {platform.python_version()}). The farm and the",
        "floor run in the same call, in turn; `to floor` is the ratio of the two. Other machines give other figures.",
        "",
        "| benchmark | value | unit | to floor | goal | |",
        "|---|---|---|---|---|---|",
    ]
    for r in results:
        ratio = "" if r.ratio_to_floor is None else f"{r.ratio_to_floor:.2f}"
        goal, verdict = ("", "") if r.goal == "none" else (r.goal, "ok" if r.ok else "missed")
        lines.append(f"| {r.name} | {r.value:.4g} | {r.unit} | {ratio} | {goal} | {verdict} |")
    return "\n".join([*lines, *_reading(results)]) + "\n"


def _reading(results: list[Result]) -> list[str]:
    """Notes on how to read the figures, for the page of documentation."""
    values = {r.name: r.value for r in results}
    lines = ["", "## How to read them", ""]
    few, many = values.get("cpu-16-drives"), values.get("cpu-512-drives")
    if few is not None and many is not None:
        lines += [
            f"- All CPU time divided by all drives is not flat: {few / 16 * 1e6:.0f} us per drive and second with 16",
            f"  drives, {many / 512 * 1e6:.0f} us with 512, because the ticks cost the same with one drive.",
            "  `added-drive-ratio` is what one more drive costs among many over what it costs among few; 0.8 to 1.2",
            "  means that the farm scales.",
        ]
    lines += [
        "- `fault-latency-*` counts from the sending of `POST faults` to the first frame with the changed data status,",
        "  by the kernel's time stamps at the farm's interface. The floor is the same request as a dry run, and the",
        "  drive's next frame after the answer.",
        "- The floor of `virtual-64` copies the frames of both directions and reads their octets: no timers,",
        "  no firmware, no program. Both are the best of 100 measurements of CPU time.",
        "- `start-1024` counts from the start of both processes, each on a CPU of its own. `start-1024-farm` and",
        "  `start-1024-farm-64` are CPU of the farm's event loop for one connection; the engine's thread, which runs",
        "  those that exist already, is not in it. `*-interpreter` is a fixed loop in Python: these figures follow it.",
        "- `connect-storm-*` measures twice, with `realtime: {fifo: 20}` and with the ordinary scheduler and the",
        "  niceness that engines ask for. The controller that connects is busy on the same CPU with an even share of",
        "  it; how much it delays the farm's ticks then, `connect-storm-ordinary-*` says.",
    ]
    return lines


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
    """Run the benchmarks, and compare the farm with the floor of this machine."""
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
    _table(results)
    if json_file is not None:
        json_file.write_text(json.dumps([asdict(r) for r in results], indent=1) + "\n", encoding="utf-8")
    if markdown_file is not None:
        markdown_file.write_text(_markdown(results), encoding="utf-8")
    if not all(r.ok for r in results):
        raise typer.Exit(1)
