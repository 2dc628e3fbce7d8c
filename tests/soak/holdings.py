"""What a farm and a controller hold at a moment: table rows, frames that wait, timers, tasks; all cheap to count."""

from __future__ import annotations

import ctypes
import gc
import sys
import threading
from asyncio import AbstractEventLoop, all_tasks
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pnfarm.buses.ethernetip.controller.core import EthernetIpCore
from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
from pnfarm.buses.profinet.controller.core import ProfinetCore
from pnfarm.buses.profinet.device.device import ProfinetDevice

__all__ = ["objects_file", "of_controllers", "of_farm", "of_hub", "of_objects", "of_process", "rows"]

CLASSES = 80


def of_farm(core: Any) -> dict[str, Any]:
    """Of a :class:`pnfarm.farm.core.FarmCore`."""
    columns, gate, manager = core.columns, core.link, core.injections
    profinet = [station.device for station in core.stations if isinstance(station.device, ProfinetDevice)]
    ethernetip = [station.device for station in core.stations if isinstance(station.device, EthernetIpDevice)]
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
        "connections": sum(len(device.ars) for device in profinet),
        "streams": sum(device.adapter.encapsulation.streams for device in ethernetip),
        "calls": sum(len(device.client._calls) for device in profinet),
        "replies kept": sum(len(device.rpc._kept) for device in profinet),
    }


def of_controllers(controllers: Iterable[Any]) -> dict[str, Any]:
    """Of the built-in controllers of a farm file, one for each bus."""
    found: Counter[str] = Counter()
    for core in controllers:
        found["provider rows"] += int(core.columns.ppm["active"].sum())
        found["consumer rows"] += int(core.columns.cpm["active"].sum())
        if isinstance(core, ProfinetCore):
            found["connections"] += len(core.life.by_ar)
            found["calls"] += len(core.life.by_call)
            found["searches"] += len(core._search._asked) + len(core._search._addressed)
            found["replies kept"] += len(core.rpc._kept)
        elif isinstance(core, EthernetIpCore):
            found["streams"] += len(core.life.by_stream)
    found["log subscribers"] = len(core.log._subscribers)
    return dict(found)


def of_hub(hub: Any) -> dict[str, Any]:
    """Of a :class:`pnfarm.hub.hub.Hub`; how many entries its log has is bounded."""
    return {
        "shards": len(list(hub.shards)),
        "log subscribers": len(hub.log._subscribers),
        "faults known": len(hub.specs),
        "scenarios ending": len(hub.undoing),
    }


#: Of what a farm, a controller or a hub holds: what is a row of a table, or stands for one.
ROWS = (
    "provider rows", "consumer rows", "impairment rows", "gate rules", "gate frames", "fault runs due", "connections",
    "streams", "streams", "calls", "log subscribers", "shards",
)  # fmt: skip


def rows(holds: Mapping[str, Any]) -> int:
    """The sum of all rows, for its slope."""
    return sum(holds.get(name, 0) for name in ROWS)


def objects_file(notes: Path) -> Path:
    """Beside the notes of a program: its numbers of objects, seldom."""
    return notes.with_suffix(".objects.jsonl")


def of_objects() -> dict[str, int]:
    """How many objects of each class the garbage collector looks at here, of the :data:`CLASSES` with most of them.

    A farm leaves out what it loaded at its start.
    """
    found = Counter(map(type, gc.get_objects()))
    return {f"{kind.__module__}.{kind.__qualname__}": count for kind, count in found.most_common(CLASSES)}


class _Heap(ctypes.Structure):
    """``mallinfo2`` of the C library, mallinfo(3): octets of all its heaps."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost",
        )
    ]  # fmt: skip


_mallinfo = ctypes.CDLL(None).mallinfo2
_mallinfo.restype = _Heap


def of_process(loop: AbstractEventLoop | None) -> dict[str, Any]:
    """Of this process; the tasks by the names of their coroutines."""
    tasks: dict[str, int] = {}
    if loop is not None:
        for task in all_tasks(loop):
            name = getattr(task.get_coro(), "__qualname__", "?")
            tasks[name] = tasks.get(name, 0) + 1
    heap = _mallinfo()
    resident, of_files = map(int, Path("/proc/self/statm").read_text("ascii").split()[1:3])
    return {
        "rss": resident * 4096,
        # without mapped files, which the kernel takes away and gives back as it needs memory
        "own": (resident - of_files) * 4096,
        # in use, and kept free
        "heap": heap.uordblks + heap.hblkhd,
        "heap free": heap.fordblks,
        "blocks": sys.getallocatedblocks(),
        "garbage": len(gc.garbage),
        "threads": threading.active_count(),
        "files": len(list(Path("/proc/self/fd").iterdir())),
        "tasks": dict(sorted(tasks.items())),
    }
