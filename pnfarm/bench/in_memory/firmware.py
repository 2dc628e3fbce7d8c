"""Cost of the drives' own firmware in each 1 ms step: state machine, ramp or profile, control loops, motor, signals.

The axes move: farm and controller run in virtual time, and copies of the axes are stepped on from where they are.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from pnfarm.bench.loops import compiled_loop
from pnfarm.bench.result import Windows
from pnfarm.errors import InternalError
from pnfarm.firmware.step import step
from pnfarm.table.compiling.compiled import compiled

if TYPE_CHECKING:
    from pnfarm.controller.line import VirtualLine

__all__ = ["POSITION", "SPEED", "cost_of_a_step", "costs_of_a_step"]

MS = 1_000_000
#: Firmware steps of each copy, and how often a copy is taken.
STEPS = 20
COPIES = 25
#: Rounds of the compiled loop beside each copy, about as long as its steps, and the frames of a round.
LOOPS, FRAMES = 100, 128

_DRIVES = """
farm: bench
link: {{kind: memory}}
api: off
drives:
  - {{name: "akd-{{n:03}}", count: 64, model: akd-profinet, ip: 10.64.1.1/16, limits: lax{akd}}}
  - {{name: "old-{{n:03}}", count: 64, model: akd-profinet-2012, ip: 10.64.2.1/16, limits: lax{old}}}
  - {{name: "e1-{{n:03}}", count: 64, model: hiwin-e1, ip: 10.64.3.1/16, limits: lax{e1}}}
  - {{name: "msd-{{n:03}}", count: 64, model: moog-msd, ip: 10.64.4.1/16, limits: lax{msd}}}
controller: {{name: plc, ip: 10.64.255.250/16, cycle: 4ms, watchdog_factor: 16, program: {program}}}
"""
#: All models, each with a quarter of the drives: sine of the speed.
SPEED = _DRIVES.format(akd="", old="", e1="", msd="", program="{kind: sine, speed_rpm: 600, period: 500ms}")
#: All models in position mode: to and fro without a pause.
POSITION = _DRIVES.format(
    akd=", telegram: 9, params: {DRV.OPMODE: 2}",
    old=", telegram: 9, params: {930: 2}",
    e1=", telegram: 9",
    msd=", telegram: 9",
    program="{kind: positions, speed_rpm: 600, acceleration: 20000, targets: [20, -20]}",
)


@compiled
def step_all(axes: Any, images: Any, now: int, period: int, steps: int) -> None:
    for _ in range(steps):
        now += period
        for index in range(len(axes)):
            step(axes[index], images[index], now)


def _moving(line: VirtualLine) -> bool:
    axes = line.farm.columns.axis
    return bool((axes.drive.state == 4).all()) and float(abs(axes.motor.velocity).mean()) > 1.0


def cost_of_a_step(text: str) -> float:
    """ns of CPU for one drive and one step of 1 ms, all models mixed."""
    return costs_of_a_step(text)[0].median


def costs_of_a_step(text: str, *, motor_step_ns: int = 0) -> tuple[Windows, Windows]:
    """The same for each copy, and in turn with it ns of CPU for copying and reading one frame, compiled as well.

    ``motor_step_ns``: in place of the usual one.
    """
    import anyio

    from pnfarm.controller.line import VirtualLine
    from pnfarm.farm.file.reading import parse_farm

    line = anyio.run(VirtualLine.create, parse_farm(text))
    if not line.world.run(60.0, until=lambda: line.plc.all_connected and _moving(line)):
        raise InternalError("not every drive moves in virtual time")
    spent, loops = [], []
    columns = line.farm.columns
    for turn in range(COPIES + 1):
        line.world.run(0.1)
        axes, images = columns.axis.copy(), columns.image.copy()
        if motor_step_ns:
            axes.motor.settings.step_ns = motor_step_ns
        begin = time.process_time_ns()
        step_all(axes, images, line.world.now, MS, STEPS)
        took = time.process_time_ns() - begin
        loop = compiled_loop(LOOPS)
        if turn:
            # the first one may have been compiled
            spent.append(took / (STEPS * len(columns.axis)))
            loops.append(loop / (LOOPS * FRAMES) * 1e9)
    return Windows(spent), Windows(loops)
