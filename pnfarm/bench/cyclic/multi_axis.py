"""``pnfarm bench multi-axis``: 16 drive systems of eight axes each, beside as many axes in drives of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.bench.line import cores, farm_and_plc, measure
from pnfarm.bench.loops import interpreter_loop
from pnfarm.bench.result import WINDOWS, Result, Windows
from pnfarm.bench.start import started

if TYPE_CHECKING:
    from pnfarm.bench.load import Load

__all__ = ["multi_axis"]

STATIONS, AXES = 16, 8
CYCLE, WATCHDOG = "2ms", 64
#: How often both take turns: the goal compares them.
TURNS = 2
#: The start takes seconds, and is repeated.
STARTS = 3

SINGLE = """
drives:
  - name: axis-{{n:03}}
    count: {count}
    model: profidrive
    ip: 10.64.0.11/16
"""
SEVERAL = SINGLE + f"    axes: [{', '.join(f'{{{{name: a{number}}}}}' for number in range(1, AXES + 1))}]\n"


def multi_axis(seconds: float, load: Load) -> list[Result]:
    """CPU of an axis in a station of eight over that of one in a station of its own, and the start of all."""
    turn = seconds / TURNS

    def turned(stations: int, drives: str) -> list[dict[str, float]]:
        with farm_and_plc(stations, CYCLE, WATCHDOG, stations=drives) as (farm, plc):
            return measure(farm, plc, turn, load, WINDOWS // TURNS)[0]

    def per_axis(windows: list[dict[str, float]]) -> Windows:
        return Windows(value * 1e6 / (STATIONS * AXES) for value in cores(windows).values)

    together, alone = [], []
    for _ in range(TURNS):
        together += turned(STATIONS, SEVERAL)
        alone += turned(STATIONS * AXES, SINGLE)
    several, single = per_axis(together), per_axis(alone)
    loop, took = [], []
    for _ in range(STARTS):
        loop.append(interpreter_loop(3))
        took.append(started(STATIONS, load, CYCLE, WATCHDOG, SEVERAL, until="running").took)
    ratio, unit, start, interpreter = (
        several.over(single),
        "us of CPU per axis and second",
        Windows(took),
        Windows(loop),
    )
    return [
        several.row("multi-axis-128", unit),
        single.row("multi-axis-128-single", unit, 1.0),
        Result("multi-axis-128-ratio", ratio, "axis of eight over single one", None, "<= 0.8", ratio <= 0.8),
        start.row("multi-axis-start", "s", start.median * 1e3 / interpreter.median, "<= 3", start.median <= 3),
        interpreter.row("multi-axis-interpreter", "ms for a fixed loop in Python", 1.0),
    ]
