"""One of the programs of a run in real time: its process, its log, what it notes of itself."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import IO, Any

from pnfarm.station.event_log import FARM_ENTRIES
from tests.soak.holdings import objects_file
from tests.soak.judge import LogReader, longest_pause

__all__ = ["NOTE_SECONDS", "ROOT", "SAMPLE_SECONDS", "STOP_SECONDS", "Side", "SoakError", "StarvedError"]

ROOT = Path(__file__).resolve().parents[2]
SAMPLE_SECONDS, STOP_SECONDS = 10.0, 30.0
#: Between two notes of a program.
NOTE_SECONDS = SAMPLE_SECONDS / 4


class SoakError(Exception):
    """The run cannot go on."""


class StarvedError(SoakError):
    """The machine has so little time for the run that it says nothing."""


class Side:
    """One of the programs: its process, its log, what it holds; its event log keeps ``entries``."""

    def __init__(self, name: str, folder: Path, *arguments: str | Path, entries: int = FARM_ENTRIES) -> None:
        self.name = name
        self._entries = entries
        self.notes = folder / f"{name.replace(' ', '-')}.jsonl"
        self.log = LogReader()
        self.before: dict[str, Any] | None = None
        self._arguments = list(map(str, arguments))
        self._spent = 0.0
        self.start()

    def start(self) -> None:
        """A new process; what it notes replaces what the one before noted."""
        self.notes.unlink(missing_ok=True)
        #: Octets of the notes that :meth:`stood` has read.
        self._asked = 0
        command = [sys.executable, "-m", "tests.soak.watched", str(self.notes), str(NOTE_SECONDS), str(self._entries)]
        self.process = subprocess.Popen(
            [*command, "--log-format", "json", *self._arguments],
            cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace",
            start_new_session=True, env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )  # fmt: skip
        self._reader = threading.Thread(target=self._read, args=(self.process.stderr,), daemon=True)
        self._reader.start()

    @property
    def processor_seconds(self) -> float:
        """Of all its processes so far."""
        if self.process.poll() is not None:
            return self._spent
        fields = Path(f"/proc/{self.process.pid}/stat").read_text("ascii").rpartition(")")[2].split()
        return self._spent + (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def kill(self) -> int:
        self._spent = self.processor_seconds
        self.process.kill()
        self.process.wait()
        self._reader.join(5.0)
        return self.process.returncode

    def _read(self, lines: IO[str]) -> None:
        for line in lines:
            self.log.line(line.rstrip("\n"))

    def newest(self) -> dict[str, Any] | None:
        """What it noted last."""
        if not self.notes.exists():
            return None
        with self.notes.open("rb") as file:
            file.seek(max(0, self.notes.stat().st_size - 8192))
            lines = file.read().split(b"\n")
        return json.loads(lines[-2]) if len(lines) > 2 or (len(lines) == 2 and lines[0]) else None

    def objects(self) -> list[dict[str, Any]]:
        """Its numbers of objects by class, each with its time ``at``."""
        file = objects_file(self.notes)
        return [json.loads(line) for line in file.read_text("utf-8").splitlines()] if file.exists() else []

    def noted_after(self, at: float) -> dict[str, Any]:
        """What it noted after a moment of the wall clock."""
        end = time.monotonic() + STOP_SECONDS
        while time.monotonic() < end:
            found = self.newest()
            if found is not None and found["at"] > at:
                return found
            time.sleep(0.2)
        raise SoakError(f"the {self.name} has noted nothing for {STOP_SECONDS:g} s")

    def stood(self) -> list[tuple[str, float, float]]:
        """When its process or its engine did not run, by the wall clock, and for how long, s: all that it noted and
        that was not asked yet."""
        if not self.notes.exists():
            return []
        with self.notes.open("rb") as file:
            file.seek(self._asked)
            new = file.read()
        whole = new[: new.rfind(b"\n") + 1]
        self._asked += len(whole)
        return [
            (what, begin, seconds) for one in whole.splitlines() for what, begin, seconds in json.loads(one)["stood"]
        ]

    def paused(self, since: float, until: float) -> float:
        """The longest time between two notes in a time of the wall clock: so long the process did not run."""
        times = [
            json.loads(line)["at"]
            for line in self.notes.read_text("utf-8").splitlines(keepends=True)
            if line[-1] == "\n"
        ]
        return longest_pause(times, since, until)

    def stop(self) -> int | None:
        if self.process.poll() is None:
            self._spent = self.processor_seconds
            self.process.send_signal(signal.SIGCONT)
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
                return None
        self._reader.join(5.0)
        return self.process.returncode
