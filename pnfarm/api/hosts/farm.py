"""One farm as a whole: its clock, whether it is ready, how it does, how controllers reacted, its metrics."""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import anyio
import anyio.lowlevel
import anyio.to_thread

from pnfarm.api.paths.farm import clock_of
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.doctor.machine import examine
from pnfarm.farm.views.reactions import reactions
from pnfarm.farm.views.readiness import Readiness
from pnfarm.farm.views.snapshot import engine_snapshot
from pnfarm.metrics import CONTENT_TYPE
from pnfarm.table.engine_row import LATENESS_EDGES_NS

if TYPE_CHECKING:
    from pnfarm.api.context import ApiContext

__all__ = ["FarmItself"]

#: A farm whose engine has not ticked for this time is not ready; normally it ticks every millisecond.
STALLED_NS = 1_000_000_000
#: How far back the lateness of the event loop is shown, and stolen time.
BACK_NS = 10_000_000_000
#: An examination of the machine takes a second of its time, and holds for a while.
FINDINGS_SECONDS = 60.0
#: Stations whose readiness is made again in one turn of the event loop.
AT_ONCE = 64


class FarmItself:
    """As :class:`~pnfarm.api.paths.farm.FarmHost`."""

    def __init__(self, context: ApiContext) -> None:
        self._context = context
        self._examined: tuple[float, list[dict[str, Any]]] | None = None
        self._examining = anyio.Lock()
        self._readiness = Readiness(context.core)

    def clock(self) -> dict[str, Any]:
        core = self._context.core
        return clock_of(self._context, core.name, time.time(), core.log.newest, len(core.axes))

    async def ready(self) -> dict[str, Any]:
        core = self._context.core
        engine = core.columns.engine[0]
        cycles, age = int(engine.cycles), self._context.now() - int(engine.now_ns)
        if not cycles or age > STALLED_NS:
            since = f"for {age / 1e9:.1f} s" if cycles else "since the farm was made"
            raise EnvironmentError_(f"the engine has not ticked {since}; the drives do not run")
        if core.leaseholder is not None and not core.leaseholder.is_ready:
            raise EnvironmentError_("the drives are mute: their lease is not held, see `pnfarm inspect`")
        return {"ready": True, "cycles": cycles, "last_tick_seconds_ago": age / 1e9}

    async def health(self) -> dict[str, Any]:
        core, now = self._context.core, self._context.now()
        engine = core.columns.engine[0]
        late = core.lateness.between(max(0, now - BACK_NS), now, 0, by_lines=True)
        bounds = [edge / 1e9 for edge in LATENESS_EDGES_NS] + [None]
        return {
            "engine": engine_snapshot(core),
            "lateness": [
                {"up_to_seconds": bound, "count": count}
                for bound, count in zip(bounds, engine.lateness.tolist(), strict=True)
            ],
            # a farm in memory has no ticks that a clock wants
            "lateness_measured": core.link.kind != "memory",
            "lateness_mean_seconds": int(engine.lateness_sum_ns) / max(1, int(engine.lateness.sum())) / 1e9,
            "last_seconds": BACK_NS / 1e9,
            "engine_late_seconds": late.engine_ns / 1e9,
            "loop_late_seconds": late.loop_ns / 1e9,
            "lines_late_seconds": late.lines_ns / 1e9,
            "stolen_seconds": late.stolen_ns / 1e9,
        }

    async def doctor(self) -> dict[str, Any]:
        async with self._examining:
            if self._examined is None or time.monotonic() - self._examined[0] > FINDINGS_SECONDS:
                found = await anyio.to_thread.run_sync(examine)
                self._examined = time.monotonic(), list(map(asdict, found))
            return {"findings": self._examined[1]}

    async def reactions(self) -> dict[str, Any]:
        return {"reactions": reactions(self._context.core, self._context.now())}

    async def readiness(self) -> dict[str, Any]:
        while not self._readiness.update(AT_ONCE):
            # thousands of stations take a while, in which the event loop has other work
            await anyio.lowlevel.checkpoint()
        return self._readiness.view(self._context.now())

    async def metrics(self) -> tuple[bytes, str]:
        context = self._context
        async with context.rendering:
            scrape = context.collector.gather()
            # a thousand drives make megabytes of text, and the event loop must not block meanwhile
            text = await anyio.to_thread.run_sync(scrape.text)
            return text + context.collector.process_text(), CONTENT_TYPE
