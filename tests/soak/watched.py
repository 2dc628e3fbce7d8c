"""The program, as its user runs it, and beside it a thread that writes down what it holds: one JSON object a line.

``python -m tests.soak.watched FILE SECONDS ARGUMENT ...`` runs ``pnfarm ARGUMENT ...``.
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

from tests.soak.holdings import of_controllers, of_farm, of_hub, of_process

_PR_SET_PDEATHSIG = 1
#: Between two looks at the clock, and what a look may be late.
LOOK_SECONDS, STOOD_SECONDS = 0.1, 0.25
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

    for kind, count in ((Farm, lambda farm: of_farm(farm.core)), (Plc, lambda plc: of_controllers(plc.controllers))):
        opened = kind.open

        async def opening(self: Any, opened: Any = opened, count: Any = count) -> None:
            await opened(self)
            _made.update(count=lambda: count(self), loop=asyncio.get_running_loop())

        kind.open = opening


def _stood(seconds: float) -> list[list[float]]:
    """Let so many seconds pass; when the process did not run meanwhile, and for how long each time."""
    found = []
    end = time.monotonic() + seconds
    while (now := time.monotonic()) < end:
        time.sleep(LOOK_SECONDS)  # how late this wait ends is what is looked for
        if (late := time.monotonic() - now - LOOK_SECONDS) >= STOOD_SECONDS:
            found.append([time.time() - late, late])
    return found


def _write(file: Path, seconds: float) -> None:
    stood: list[list[float]] = []
    with file.open("w", encoding="utf-8", buffering=1) as out:
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


def main() -> None:
    file, seconds, *arguments = sys.argv[1:]
    # the run may be killed, and nothing of it is to stay
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    _note_cores(arguments[2])
    threading.Thread(target=_write, args=(Path(file), float(seconds)), daemon=True).start()
    sys.argv = ["pnfarm", *arguments]
    from pnfarm.cli.main import run

    run()


if __name__ == "__main__":
    main()
