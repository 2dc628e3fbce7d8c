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


def _write(file: Path, seconds: float) -> None:
    with file.open("w", encoding="utf-8", buffering=1) as out:
        while True:
            time.sleep(seconds)
            loop = _made.get("loop")
            if loop is None:
                continue
            try:
                held = _made["count"]()
                line = {"at": time.time(), "process": of_process(loop), "holds": held}
            except RuntimeError:
                # a container changed while it was counted: the next time will do
                continue
            out.write(json.dumps(line) + "\n")


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
