"""Runs a scenario against a farm that runs in this process, in real time."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING

from pnfarm.scenario.run import LOOK_NS

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.farm.core import FarmCore
    from pnfarm.scenario.run import EachLook, ScenarioRun

__all__ = ["carry_out"]

#: Longest pause between two checks.
PAUSE_NS = 200_000_000


async def carry_out(
    run: ScenarioRun,
    core: FarmCore,
    poke: Callable[[], None],
    now: Callable[[], int] = time.monotonic_ns,
    *,
    passing: EachLook | None = None,
) -> None:
    """Until the scenario has ended; cancelled from outside, it ends at once, with its faults cleared.

    ``passing`` is called at each check, at least every :data:`PAUSE_NS`; what it returns ends the scenario.
    """
    woken = asyncio.Event()
    unsubscribe = core.log.subscribe(lambda entry: woken.set())  # noqa: ARG005 - the entry is in the log
    try:
        while not run.finished:
            woken.clear()
            due = run.advance(now())
            if passing is not None and (why := passing(run, now())):
                run.cancel(now(), why)
                break
            # the farm's runtime sends what a step put in force
            poke()
            pause = min(due - now(), LOOK_NS if run.polled(virtual=False) else PAUSE_NS)
            if pause > 0:
                try:
                    await asyncio.wait_for(woken.wait(), pause / 1e9)
                except TimeoutError:
                    continue
            else:
                await asyncio.sleep(0)
    finally:
        unsubscribe()
        run.cancel(now())
        poke()
