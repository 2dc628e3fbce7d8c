"""``pnfarm bench plant``: drives with a plant behind them, beside the drives alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnfarm.bench.line import DRIVES, cores, farm_and_plc, lateness, measure
from pnfarm.bench.loops import wake_ups
from pnfarm.bench.result import WINDOWS, Result, Windows

if TYPE_CHECKING:
    from pnfarm.bench.load import Load

__all__ = ["plant"]

COUNT, CYCLE, WATCHDOG = 64, "1ms", 64
BEHAVIOURS = 200
STEP_NS = 5_000_000
#: How often all take turns: the goals compare them.
TURNS = 4


def _listed(lines: list[str]) -> str:
    return "\n".join(f"  - {line}" for line in lines)


def _stations(models: list[str], wires: list[str]) -> str:
    """The drives, and a plant; braces of the plant's own are doubled."""
    plant = f"plant:\n  models:\n{_listed(models)}\n  wires:\n{_listed(wires)}\n"
    return DRIVES + plant.replace("{", "{{").replace("}", "}}")


def _compiled() -> str:
    """A mass behind a spring on each axis, and behaviours that sensors over the axes' places move."""
    axes = [f"axis-{number:04}" for number in range(1, COUNT + 1)]
    models = [
        f"{{name: mass-{axis}, kind: elastic-load, axis: {axis}, stiffness: 5, inertia: 1.0e-4}}" for axis in axes
    ]
    wires = []
    for number in range(BEHAVIOURS // 2):
        models += [
            f"{{name: cam-{number}, kind: position-sensor, from: 0.2, to: 0.6, period: 1, hysteresis: 0.01}}",
            f"{{name: valve-{number}, kind: cylinder, time: 20ms}}",
        ]
        wires += [
            f"{axes[number % COUNT]}.shaft_position -> cam-{number}.position",
            f"cam-{number}.on -> valve-{number}.extend",
        ]
    return _stations(models, wires)


def _in_python() -> str:
    model = Path(__file__).with_name("plant_model.py")
    wires = [f"axis-{number + 1:04}.shaft_position -> twenty.in_{number}" for number in range(10)]
    return _stations([f"{{name: twenty, python: {model}, step: {STEP_NS}ns}}"], wires)


def plant(seconds: float, load: Load) -> list[Result]:
    """CPU of 64 drives at 1 ms with 64 masses behind springs and 200 behaviours, and with a model in Python."""
    turn = seconds / TURNS
    alone, moved, python, woken = [], [], [], []

    def turned(stations: str) -> list[dict[str, Any]]:
        with farm_and_plc(COUNT, CYCLE, WATCHDOG, stations=stations) as (farm, plc):
            found = measure(farm, plc, turn, load, WINDOWS // TURNS)[0]
            # beside each farm: what a wake-up costs depends on what else the machine does
            woken.append(wake_ups(turn / WINDOWS, STEP_NS))
            return found

    for _ in range(TURNS):
        alone += turned(DRIVES)
        moved += turned(_compiled())
        python += turned(_in_python())
    least, behind = cores(alone), cores(moved)
    ratio, late = behind.over(least), lateness(moved, 0.99).over(lateness(alone, 0.99))
    # of its threads: two runs of the whole farm differ by more than a model takes
    own = Windows(float(answer["plant_cpu"]) / float(answer["wall"]) for answer in python)
    floor = Windows(woken)
    return [
        least.row("plant-64-alone", "cores", 1.0),
        behind.row("plant-64", "cores", ratio),
        Result("plant-64-ratio", ratio, "with a plant over alone", None, "<= 1.15", ratio <= 1.15),
        Result("plant-64-lateness", late, "p99 with a plant over alone", None, "<= 1.5", late <= 1.5),
        own.row(
            "plant-python", "cores for a model of 20 ports at 5 ms", own.over(floor), "<= 0.02", own.median <= 0.02
        ),
        floor.row("plant-python-floor", "cores for a thread that only wakes", 1.0),
    ]
