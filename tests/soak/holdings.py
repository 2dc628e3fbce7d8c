"""What a farm and a controller hold at a moment: table rows, frames that wait, timers, tasks; all cheap to count."""

from __future__ import annotations

import gc
import sys
import threading
from asyncio import AbstractEventLoop, all_tasks
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["of_controller", "of_farm", "of_process"]


def of_farm(core: Any) -> dict[str, Any]:
    """Of a :class:`pnfarm.farm.core.FarmCore`."""
    columns, gate, manager = core.columns, core.link, core.injections
    return {
        "faults": len(manager.list()),
        "fault runs due": manager.scheduled[0],
        "fault timers": manager.scheduled[1],
        "gate rules": sum(len(gate.in_force(station.port.index)) for station in core.axes),
        "gate frames": len(gate._waiting) + sum(map(len, gate._held.values())),
        "held frames": int(columns.engine[0].held_out) + int(columns.engine[0].held_in),
        "impairment rows": int(np.count_nonzero(columns.impairment["kind"])),
        "impaired channels": int(
            np.count_nonzero(columns.ppm["impairment"]) + np.count_nonzero(columns.cpm["impairment"])
        ),
        "provider rows": int(columns.ppm["active"].sum()),
        "consumer rows": int(columns.cpm["active"].sum()),
        "traces": len(core.traces.kept()),
        "log subscribers": len(core.log._subscribers),
        "connections": sum(len(station.device.ars) for station in core.axes),
        "calls": sum(len(station.device.client._calls) for station in core.axes),
        "replies kept": sum(len(station.device.rpc._kept) for station in core.axes),
    }


def of_controller(core: Any) -> dict[str, Any]:
    """Of the built-in PROFINET controller."""
    return {
        "provider rows": int(core.columns.ppm["active"].sum()),
        "consumer rows": int(core.columns.cpm["active"].sum()),
        "connections": len(core.life.by_ar),
        "calls": len(core.life.by_call),
        "searches": len(core._search._asked) + len(core._search._addressed),
        "replies kept": len(core.rpc._kept),
        "log subscribers": len(core.log._subscribers),
    }


def of_process(loop: AbstractEventLoop | None) -> dict[str, Any]:
    """Of this process; the tasks by the names of their coroutines."""
    tasks: dict[str, int] = {}
    if loop is not None:
        for task in all_tasks(loop):
            name = getattr(task.get_coro(), "__qualname__", "?")
            tasks[name] = tasks.get(name, 0) + 1
    return {
        "rss": int(Path("/proc/self/statm").read_text("ascii").split()[1]) * 4096,
        "blocks": sys.getallocatedblocks(),
        "garbage": len(gc.garbage),
        "threads": threading.active_count(),
        "files": len(list(Path("/proc/self/fd").iterdir())),
        "tasks": dict(sorted(tasks.items())),
    }
