"""The programs of a run in real time, and what is done to them: stopped, killed, paused and started anew."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path
from random import Random

from pnfarm.station.event_log import FARM_ENTRIES
from tests.soak.cell import BRIDGE, FEWEST_OF_A_CELL, SHARDS, cell_text, line_text
from tests.soak.side import Side

__all__ = ["HUB_PORT", "PORT", "Programs"]

PORT, HUB_PORT, SHARD_PORT = 8702, 8703, 8711
#: What is done to a program, and to which: the cell's farm runs from begin to end, so that its memory can be judged.
WAYS = ("restart", "kill", "pause")
#: A pause is longer than the watchdogs of 0.5 s; the hub calls a shard away after 2 s.
SHORTEST_PAUSE, LONGEST_PAUSE = 1.0, 6.0
#: Entries that the event logs of the line's programs keep: little happens there, and with as many as usual they grow
#: for hours, which looks like a leak.
LINE_ENTRIES = 256


class Programs:
    """The cell's farm and its controller; with a whole cell also the line's shards, its controller and a hub."""

    def __init__(self, folder: Path, drives: int, link: str) -> None:
        self._whole = drives >= FEWEST_OF_A_CELL
        self._cell, self._line = folder / "soak.pnfarm.yml", folder / "line.pnfarm.yml"
        #: The pty of the cell's PROFIBUS drives.
        self.profibus = folder / "profibus"
        self._cell.write_text(cell_text(drives, link, f"127.0.0.1:{PORT}", self.profibus))
        self._line.write_text(line_text())
        self._folder = folder
        self.sides: dict[str, Side] = {}

    @property
    def hub(self) -> bool:
        """Whether there is one."""
        return self._whole

    def start_farms(self) -> None:
        """The farms, and the hub over them."""
        self._start("farm", "up", self._cell)
        if not self._whole:
            return
        subprocess.run(["ip", "link", "add", BRIDGE, "type", "bridge"], check=True)
        subprocess.run(["ip", "link", "set", BRIDGE, "addrgenmode", "none", "up"], check=True)
        ports = [SHARD_PORT + part for part in range(SHARDS)]
        for part, port in enumerate(ports, 1):
            self._start(f"shard {part}", "up", self._line, "--shard", f"{part}/{SHARDS}", "--api", f"127.0.0.1:{port}")
        shards = [word for port in (PORT, *ports) for word in ("--shard", f"http://127.0.0.1:{port}")]
        self._start("hub", "hub", "--api", f"127.0.0.1:{HUB_PORT}", *shards)

    def start_controllers(self) -> None:
        self._start("controller", "plc", self._cell, "--format", "json")
        if self._whole:
            self._start("line controller", "plc", self._line, "--format", "json")

    def _start(self, name: str, *arguments: str | Path) -> None:
        entries = LINE_ENTRIES if self._line in arguments else FARM_ENTRIES
        self.sides[name] = Side(name, self._folder, *arguments, entries=entries)

    def disturb(self, name: str, way: str, rng: Random) -> int | None:
        """Do this to a program; the exit code of one that was asked to end and did, else None."""
        side = self.sides[name]
        seconds = rng.uniform(SHORTEST_PAUSE, LONGEST_PAUSE)
        if way == "pause":
            side.process.send_signal(signal.SIGSTOP)
            time.sleep(seconds)
            side.process.send_signal(signal.SIGCONT)
            return 0
        code = side.kill() if way == "kill" else side.stop()
        time.sleep(seconds)
        side.start()
        return 0 if way == "kill" else code

    def stop(self) -> list[tuple[str, int | None]]:
        """End all, the last first; their exit codes."""
        return [(name, side.stop()) for name, side in reversed(self.sides.items())]
