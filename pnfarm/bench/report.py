"""What a run of the benchmarks prints: a table, and the page of documentation."""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from pnfarm.bench.load import LIMIT_CORES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.bench.result import Result

__all__ = ["markdown", "print_table", "spread", "verdict"]


def verdict(result: Result) -> str:
    """``ok``, ``missed``, the cores of others beside which nothing is judged, or nothing for a row without a goal."""
    if result.beside_load is not None:
        return f"beside load: {result.beside_load:.2f}"
    if result.goal == "none":
        return ""
    return "ok" if result.ok else "missed"


def spread(result: Result) -> str:
    """The lowest and the highest window."""
    return "" if result.spread is None else f"{result.spread[0]:.4g} to {result.spread[1]:.4g}"


def _cells(result: Result) -> tuple[str, ...]:
    ratio = "" if result.ratio_to_floor is None else f"{result.ratio_to_floor:.2f}"
    goal = "" if result.goal == "none" else result.goal
    return result.name, f"{result.value:.4g}", spread(result), result.unit, ratio, goal, verdict(result)


_COLUMNS = ("benchmark", "value", "spread", "unit", "to floor", "goal", "")
_STYLES = {"ok": "green", "missed": "red", "beside load": "yellow"}


def print_table(results: Sequence[Result]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=f"pnfarm bench, {os.cpu_count()} CPUs")
    for column in _COLUMNS:
        table.add_column(column, no_wrap=column in ("benchmark", "value"))
    for result in results:
        *cells, last = _cells(result)
        table.add_row(*cells, Text(last, _STYLES.get(last.partition(":")[0], "")))
    console = Console(emoji=False)
    if not console.is_terminal:
        # a file has room for a row in one line
        console.width = 180
    console.print(table)
    if any(result.beside_load is not None for result in results):
        console.print(
            "Rows beside load give no verdict: other processes, or the hypervisor, used more than "
            f"{LIMIT_CORES:g} of a core meanwhile."
        )


def markdown(results: Sequence[Result], when: datetime | None = None) -> str:
    date = (when or datetime.now(UTC)).date().isoformat()
    lines = [
        "# Figures",
        "",
        f"What `pnfarm bench --markdown docs/bench.md` printed on {date},",
        f"on a machine with {os.cpu_count()} CPUs",
        f"({platform.machine()}, Linux {platform.release()}, Python {platform.python_version()}). Other machines give",
        "other figures. A value is the median of several short windows, `spread` is the lowest and the highest of",
        "them. `to floor` is the ratio to something of the same kind, measured in turn in the same call: a loop that",
        "only sends and receives, an echo, a fixed loop of the interpreter, or a compiled one (`*-floor`,",
        "`*-interpreter`, `*-loop`).",
        "",
        f"| {' | '.join(_COLUMNS[:-1])} | |",
        "|---" * len(_COLUMNS) + "|",
    ]
    for result in results:
        *cells, last = _cells(result)
        lines.append(f"| {' | '.join(cells)} | {last} |")
    return "\n".join([*lines, *_reading(results)]) + "\n"


def _reading(results: Sequence[Result]) -> list[str]:
    """Notes on how to read the figures, for the page of documentation."""
    values = {r.name: r.value for r in results}
    lines = [
        "",
        "## How to read them",
        "",
        f"- `beside load`: others used more than {LIMIT_CORES:g} of a core during the windows of that benchmark.",
        "  It is what all CPUs did and what the hypervisor took, less what the benchmark's own processes used. Such a",
        "  row gives no verdict; if nothing else missed its goal, `pnfarm bench` ends with 3.",
    ]
    few, many = values.get("cpu-16-drives"), values.get("cpu-512-drives")
    if few is not None and many is not None:
        lines += [
            f"- All CPU time divided by all drives is not flat: {few / 16 * 1e6:.0f} us per drive and second with 16",
            f"  drives, {many / 512 * 1e6:.0f} us with 512, because the ticks cost the same with one drive.",
            "  `added-drive-ratio` is what one more drive costs among many over what it costs among few; up to 1.2",
            "  means that the farm scales. Less than 1 is possible: a tick takes more frames at once.",
        ]
    return [*lines, *_READING.splitlines()]


_READING = """\
- Above 128 drives the kernel's time stamps are off unless the farm file says
  `realtime: {timestamps: true}`: they cost about a tenth of a frame. `frame-cost-192` and `full-port-*` are
  therefore without them.
- `fault-latency-*` counts from the sending of `POST faults` to the first frame with the changed data status,
  by the kernel's time stamps at the farm's interface. The floor is the same request as a dry run, and the
  drive's next frame after the answer. The values are shares of all requests, the spread is that of eight windows.
  The goal is missed if more than 1 % of the requests are above it, by more than chance does in one run of a hundred.
- `devices-256-*` compares devices by a GSDML file with drives of the same number and cycle. `devices-signal-*` counts
  from the sending of `PATCH devices/NAME/signals` to the first frame with the value; the floor writes the value that is
  there already.
- `multi-axis-*` compares 16 drive systems of eight axes with 128 drives of one, each sending every 2 ms: an axis is
  simulated alike, and eight share a frame. `multi-axis-start` counts from the start of both processes until all axes
  are in operation.
- The floor of `virtual-64` copies the frames of both directions and reads their octets: no timers,
  no firmware, no program. The same compiled loop is the floor of `firmware-*`.
- Beside a loop of the interpreter, `to floor` is how many of its passes the figure takes: to connect a drive, to make
  a page for Prometheus, to watch a second of the web page, to start. It stays where the interpreter is slower.
- `start-1024` counts from the start of both processes, each on a CPU of its own. `start-1024-farm` and
  `start-1024-farm-64` are CPU of the farm's event loop for one connection; the engine's thread, which runs
  those that exist already, is not in it.
- `connect-storm-*` measures with SCHED_FIFO, which engines ask for, and with the ordinary scheduler (`fifo: 0`) and the
  niceness that they ask for then. The controller that connects is busy on the same CPU with an even share of it.
  `connect-storm-ordinary-floor` is the lateness of a minimal loop of that niceness that exchanges the frames of the 64
  drives beside the same storm: what the kernel does for 256 connections delays it as well, and so do the ticks of the
  farm's engine.
"""
