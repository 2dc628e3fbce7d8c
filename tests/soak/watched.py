"""The program, as its user runs it, and beside it a thread that writes down what it holds: one JSON object a line.

``python -m tests.soak.watched FILE SECONDS ENTRIES ARGUMENT ...`` runs ``pnfarm ARGUMENT ...``, whose event log keeps
so many entries.
"""

from __future__ import annotations

import asyncio
import ctypes
import json
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

from pnfarm.station import event_log
from pnfarm.table.late import LATE_ROWS
from tests.soak.holdings import objects_file, of_controllers, of_farm, of_hub, of_objects, of_process

_PR_SET_PDEATHSIG = 1
#: Between two looks at the clock, and what a look may be late.
LOOK_SECONDS, STOOD_SECONDS = 0.1, 0.05
#: What ticks of an engine may be late within some ms.
LATE_SECONDS = 0.04
#: Between two counts of objects, each of which stops the interpreter for some 0.05 s.
OBJECTS_SECONDS = 300.0
#: Objects of the program, noted when it makes them.
_made: dict[str, Any] = {}


def _note_cores(command: str) -> None:
    """Have the farm, the controllers or the hub that this command makes noted."""
    if command == "hub":
        from pnfarm.hub import tasks

        run_hub = tasks.run_hub

        async def running(hub: Any, *arguments: Any, **options: Any) -> None:
            _made.update(count=lambda: of_hub(hub), loop=asyncio.get_running_loop())
            await run_hub(hub, *arguments, **options)

        tasks.run_hub = running
        return
    from pnfarm.controller.runtime import Plc
    from pnfarm.farm.farm import Farm

    def of_plc(plc: Any) -> dict[str, Any]:
        return of_controllers(plc.controllers)

    for kind, count, cores in (
        (Farm, lambda farm: of_farm(farm.core), lambda farm: [farm.core]),
        (Plc, of_plc, lambda plc: list(plc.controllers)),
    ):
        opened = kind.open

        async def opening(self: Any, opened: Any = opened, count: Any = count, cores: Any = cores) -> None:
            await opened(self)
            _made["engines"] = [_Engine(core.columns) for core in cores(self)]
            _made.update(count=lambda: count(self), loop=asyncio.get_running_loop())

        kind.open = opening


class _Engine:
    """Reads when an engine was late."""

    def __init__(self, columns: Any) -> None:
        self._columns = columns
        self._head = 0

    def late(self) -> list[tuple[str, float, float]]:
        """Since the last call; the times of the wall clock at which it began."""
        head = int(self._columns.engine[0].late_head)
        ahead = time.time() - time.monotonic()
        new = [self._columns.late[place % LATE_ROWS] for place in range(max(self._head, head - LATE_ROWS), head)]
        self._head = head
        found = [(float(row.begin_ns) / 1e9 + ahead, float(row.late_ns) / 1e9) for row in new]
        return [("engine", begin, seconds) for begin, seconds in found if seconds >= LATE_SECONDS]


def _stood(seconds: float) -> list[tuple[str, float, float]]:
    """Let so many seconds pass; when the process did not run meanwhile, and for how long each time."""
    found = []
    end = time.monotonic() + seconds
    while (now := time.monotonic()) < end:
        time.sleep(LOOK_SECONDS)  # how late this wait ends is what is looked for
        if (late := time.monotonic() - now - LOOK_SECONDS) >= STOOD_SECONDS:
            found.append(("process", time.time() - late, late))
    return [*found, *(one for engine in _made.get("engines", ()) for one in engine.late())]


def _write(file: Path, seconds: float) -> None:
    stood: list[tuple[str, float, float]] = []
    counted = time.monotonic()
    beside = objects_file(file)
    with (
        file.open("w", encoding="utf-8", buffering=1) as out,
        beside.open("w", encoding="utf-8", buffering=1) as objects,
    ):
        while True:
            stood += _stood(seconds)
            loop = _made.get("loop")
            if loop is None:
                continue
            try:
                held = _made["count"]()
                line = {"at": time.time(), "process": of_process(loop), "holds": held, "stood": stood}
            except RuntimeError:
                # a container changed while it was counted: the next time will do
                continue
            out.write(json.dumps(line) + "\n")
            stood = []
            if time.monotonic() - counted >= OBJECTS_SECONDS:
                counted = time.monotonic()
                objects.write(json.dumps({"at": time.time(), "objects": of_objects()}) + "\n")


def main() -> None:
    file, seconds, entries, *arguments = sys.argv[1:]
    # the run may be killed, and nothing of it is to stay
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    event_log.FARM_ENTRIES = int(entries)
    _note_cores(arguments[2])
    threading.Thread(target=_write, args=(Path(file), float(seconds)), daemon=True).start()
    sys.argv = ["pnfarm", *arguments]
    from pnfarm.cli.main import run

    run()


if __name__ == "__main__":
    main()
