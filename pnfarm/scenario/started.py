"""Runs a scenario in real time against a farm that is started for it, on the link of its file."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import anyio

from pnfarm.farm.capture import prepare
from pnfarm.farm.farm import Farm
from pnfarm.metrics import FarmCollector
from pnfarm.scenario.lateness import Lateness
from pnfarm.scenario.realtime import carry_out
from pnfarm.scenario.run import ScenarioRun

if TYPE_CHECKING:
    from pnfarm.farm.capture import CaptureSettings
    from pnfarm.farm.core import FarmCore
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.scenario.binding import Binding
    from pnfarm.scenario.run import Tell

__all__ = ["run_started"]


async def run_started(
    binding: Binding, config: FarmConfig, tell: Tell | None = None, capture: CaptureSettings | None = None
) -> tuple[dict[str, Any], int]:
    """The record of the run, and the wall time at its start (ns), as a capture stamps frames.

    The controller is the one on the wire: a PLC, or ``pnfarm plc`` in another process.
    """
    farm = Farm(config, capture=capture)
    farm.check_rights()
    collectors: list[FarmCollector] = []

    def listen(core: FarmCore) -> None:
        collectors.append(FarmCollector(core))

    farm.on_start.append(listen)
    if capture is not None:
        prepare()
    async with farm:
        now = time.monotonic_ns()
        epoch = time.time_ns()
        lateness = Lateness(farm.core, binding.scenario.budget_ns, now)
        run = ScenarioRun(binding, farm.core, collectors[0], now, lateness=lateness, tell=tell)
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(farm.wait)
            await carry_out(run, farm.core, farm.driver.poke)
            tasks.cancel_scope.cancel()
        collectors[0].close()
    return run.record.as_dict(), epoch
