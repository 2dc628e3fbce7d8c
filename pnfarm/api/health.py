"""How the farm itself does, and how controllers reacted to faults: for the page, and for whoever asks."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import anyio
import anyio.to_thread

from pnfarm.api.schemas import Findings, Health, Reactions
from pnfarm.farm.doctor.machine import examine
from pnfarm.farm.views.reactions import reactions
from pnfarm.farm.views.snapshot import engine_snapshot
from pnfarm.table.engine_row import LATENESS_EDGES_NS
from pnfarm.web.bodies import PREFIX, Json

if TYPE_CHECKING:
    from enum import Enum

    from fastapi import FastAPI

    from pnfarm.api.context import ApiContext

__all__ = ["add_health"]

#: How far back the lateness of the event loop is shown, and stolen time.
BACK_NS = 10_000_000_000
#: An examination of the machine takes a second of its time, and holds for a while.
FINDINGS_SECONDS = 60.0


def add_health(app: FastAPI, context: ApiContext) -> None:
    """Handlers of ``health``, ``doctor`` and ``reactions``."""
    tags: list[str | Enum] = ["farm"]
    examined: tuple[float, list[dict[str, Any]]] | None = None
    examining = anyio.Lock()

    @app.get(
        f"{PREFIX}/health",
        tags=tags,
        summary="The farm's own lateness: of the engine, of its event loop, and stolen from it",
        responses={200: {"model": Health}},
    )
    async def get_health() -> Json:
        core, now = context.core, context.now()
        engine = core.columns.engine[0]
        late = core.lateness.between(max(0, now - BACK_NS), now, 0)
        bounds = [edge / 1e9 for edge in LATENESS_EDGES_NS] + [None]
        return Json(
            {
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
                "stolen_seconds": late.stolen_ns / 1e9,
            }
        )

    @app.get(
        f"{PREFIX}/doctor",
        tags=tags,
        summary="What `pnfarm doctor` finds on the farm's machine, not older than a minute",
        responses={200: {"model": Findings}},
    )
    async def get_doctor() -> Json:
        nonlocal examined
        async with examining:
            if examined is None or time.monotonic() - examined[0] > FINDINGS_SECONDS:
                found = await anyio.to_thread.run_sync(examine)
                examined = (
                    time.monotonic(),
                    [{"name": one.name, "ok": one.ok, "detail": one.detail, "remedy": one.remedy} for one in found],
                )
            return Json({"findings": examined[1]})

    @app.get(
        f"{PREFIX}/reactions",
        tags=tags,
        summary="What controllers did about faults and lost connections, the newest first",
        responses={200: {"model": Reactions}},
    )
    async def get_reactions() -> Json:
        return Json({"reactions": reactions(context.core, context.now())})
