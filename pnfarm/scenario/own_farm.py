"""Runs a scenario in real time against a farm that is started for it, on the link of its file."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import anyio

from pnfarm.controller.beside import ControllerBeside
from pnfarm.farm.capture import prepare
from pnfarm.farm.farm import Farm
from pnfarm.metrics import FarmCollector
from pnfarm.scenario.lateness import FarmLateness
from pnfarm.scenario.realtime import carry_out
from pnfarm.scenario.run import ScenarioRun
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from pnfarm.farm.capture import CaptureSettings
    from pnfarm.farm.core import FarmCore
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.run import EachLook, Tell

__all__ = ["Outcome", "run_started"]


@dataclass(frozen=True, slots=True)
class Outcome:
    """``epoch_ns``: the wall time at the start of the run, as a capture stamps frames.

    ``failure``: what ended the farm before the scenario was over.
    """

    record: dict[str, Any]
    epoch_ns: int
    failure: Exception | None = None


async def run_started(
    binding: Binding,
    config: FarmConfig,
    tell: Tell | None = None,
    capture: CaptureSettings | None = None,
    passing: EachLook | None = None,
    *,
    traced: bool = False,
    before: Callable[[], Awaitable[None]] | None = None,
    opened: Callable[[], None] | None = None,
) -> Outcome:
    """A scenario with a farm of its own, in real time.

    The controller is the one on the wire: a PLC, or ``pnfarm plc`` in another process; on a memory link the file's.
    ``passing`` as of :func:`.carry_out`; ``before`` is called before the farm starts, once it is known that it may,
    ``opened`` once it is there.
    """
    # what happens is in the record; on the terminal is the scenario's progress
    farm = Farm(config, log=EventLog(quiet=True), capture=capture)
    farm.check_rights()
    beside = ControllerBeside(farm)
    if before is not None:
        await before()
    collectors: list[FarmCollector] = []

    def listen(core: FarmCore) -> None:
        collectors.append(FarmCollector(core))

    farm.on_start.append(listen)
    if capture is not None:
        prepare()
    failures: list[Exception] = []
    async with farm:
        if opened is not None:
            opened()
        now = farm.now()
        epoch = time.time_ns()
        lateness = FarmLateness(farm.core, binding.scenario.budget_ns, now)
        run = ScenarioRun(
            binding, farm.core, collectors[0], now,
            lateness=lateness, traced=traced, tell=tell, plc_log=beside.log,
        )  # fmt: skip

        async def watch_farm() -> None:
            try:
                await farm.wait()
            except Exception as error:  # noqa: BLE001 - what was found until then is reported, and then this
                failures.append(error)
                run.cancel(time.monotonic_ns(), f"the farm ended: {error}", broken=True)

        async with anyio.create_task_group() as tasks:
            tasks.start_soon(watch_farm)
            await carry_out(run, farm.core, farm.driver.poke, farm.now, passing=passing)
            tasks.cancel_scope.cancel()
        collectors[0].close()
    return Outcome(run.record.as_dict(), epoch, failures[0] if failures else None)
