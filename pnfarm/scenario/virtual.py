"""Runs a scenario in memory in virtual time: the farm of its file with the built-in controller."""

from __future__ import annotations

from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Any

import anyio.lowlevel

from pnfarm.controller.line import VirtualLine
from pnfarm.errors import ConfigError
from pnfarm.farm.injections import add_impairments
from pnfarm.metrics import FarmCollector
from pnfarm.scenario.run import LOOK_NS, ScenarioRun
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.farm.virtual import VirtualWorld
    from pnfarm.links.capture.files import BlockSink
    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.run import EachLook, Tell

__all__ = ["carry_on", "carry_out_virtually", "run_virtual"]

#: Longest time without a check: the wall time of one keeps progress visible and Ctrl-C quick.
STRETCH_NS = 10_000_000_000


@asynccontextmanager
async def _line(config: FarmConfig, plc_log: EventLog, frames: BlockSink | None) -> AsyncIterator[VirtualLine]:
    line = await VirtualLine.create(config, log=EventLog(quiet=True), plc_log=plc_log, frames=frames, epoch_ns=0)
    try:
        yield line
    finally:
        await line.close()


async def carry_out_virtually(run: ScenarioRun, world: VirtualWorld, passing: EachLook | None = None) -> None:
    """Until the scenario has ended; other tasks of the event loop have their turn at least every STRETCH_NS."""
    while not run.finished:
        carry_on(run, world, STRETCH_NS, passing)
        await anyio.lowlevel.checkpoint()


def carry_on(run: ScenarioRun, world: VirtualWorld, stretch_ns: int, passing: EachLook | None = None) -> None:
    """Let the time to the scenario's next step pass, at most ``stretch_ns``."""
    due = min(run.advance(world.now), world.now + stretch_ns)

    def looked() -> bool:
        # a step that ends may change the farm: the world takes its deadlines anew
        begun, cases = run.steps_begun, len(run.record.cases)
        run.advance(world.now)
        if passing is not None and (why := passing(run, world.now)):
            run.cancel(world.now, why)
        return run.finished or run.steps_begun != begun or len(run.record.cases) != cases

    if not run.finished and due > world.now:
        world.run((due - world.now) / 1e9, until=looked, look_ns=LOOK_NS if run.polled(virtual=True) else None)


async def run_virtual(
    binding: Binding,
    config: FarmConfig,
    *,
    tell: Tell | None = None,
    frames: BlockSink | None = None,
    passing: EachLook | None = None,
    traced: bool = False,
) -> tuple[dict[str, Any], int]:
    """The record of the run, and the world's time at its start (ns), as a capture stamps frames.

    ``frames``: takes all of them; ``passing`` as of :func:`.carry_out`.  Raises :class:`ConfigError`.
    """
    if config.controller is None:
        raise ConfigError("in virtual time the farm needs its own controller: add a `controller:` section to its file")
    plc_log = EventLog(quiet=True)
    async with _line(config, plc_log, frames) as line:
        world = line.world
        add_impairments(line.farm.injections, line.stations, world.now)
        collector, begin = FarmCollector(line.farm), world.now
        try:
            run = ScenarioRun(binding, line.farm, collector, world.now, tell=tell, traced=traced, plc_log=plc_log)
            await carry_out_virtually(run, world, passing)
        finally:
            collector.close()
    return run.record.as_dict(), begin
