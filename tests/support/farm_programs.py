"""A farm and its controller as two processes on a cable of their own, for what happens to the machine below them."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 60.0
CABLE = "ip link add stall0 type veth peer name stall1 && for link in lo stall0 stall1; do ip link set $link up; done"


_GET = "import sys, urllib.request as r; print(r.urlopen(sys.argv[1], timeout=10).read().decode())"
_ASK = """
import json, sys, urllib.error, urllib.request
method, url, body = sys.argv[1:]
head = {} if body == "null" else {"Content-Type": "application/json"}
asked = urllib.request.Request(url, None if body == "null" else body.encode(), head, method=method)
try:
    with urllib.request.urlopen(asked, timeout=20) as answer:
        status, text = answer.status, answer.read()
except urllib.error.HTTPError as error:
    status, text = error.code, error.read()
print(json.dumps([status, json.loads(text) if text else {}]))
"""


class Program:
    """One of the program's commands with its log as JSON lines."""

    def __init__(self, command: str, file: Path, where: int, log: Path) -> None:
        self.enter = ["nsenter", f"--net=/proc/{where}/ns/net"]
        enter = [*self.enter, sys.executable, "-m", "pnfarm.cli.main"]
        self._log = log
        with log.open("wb") as out:
            self.process = subprocess.Popen(
                [*enter, "--log-format", "json", command, str(file)],
                stdout=out, stderr=out, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)},
            )  # fmt: skip

    def events(self, name: str) -> list[dict]:
        lines = [line for line in self.log().splitlines() if line.startswith("{")]
        return [entry for entry in map(json.loads, lines) if entry["event"].partition("\n")[0] == name]

    def wait(self, name: str, count: int = 1) -> list[dict]:
        end = time.monotonic() + SECONDS
        while len(found := self.events(name)) < count:
            assert self.process.poll() is None, self.log()
            assert time.monotonic() < end, self.log()
            time.sleep(0.02)
        return found

    def get(self, path: str) -> str:
        """What the farm's API answers."""
        return self._run(_GET, f"http://127.0.0.1:8702{path}")

    def _run(self, code: str, *arguments: str) -> str:
        """What a script prints in the programs' network."""
        return subprocess.run(
            [*self.enter, sys.executable, "-c", code, *arguments],
            stdout=subprocess.PIPE, text=True, check=True, timeout=SECONDS,
        ).stdout  # fmt: skip

    def ask(self, method: str, path: str, body: dict | None = None) -> tuple[int, dict]:
        """Status and answer of a request to the farm's API."""
        found = self._run(_ASK, method, f"http://127.0.0.1:8702/api/v1/{path}", json.dumps(body))
        status, answer = json.loads(found)
        return status, answer

    @contextlib.contextmanager
    def asking(self, path: str) -> Iterator[None]:
        """Somebody asks, and need not get an answer."""
        url = f"http://127.0.0.1:8702/api/v1/{path}"
        command = [*self.enter, sys.executable, "-c", _GET, url]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as asking:
            yield
            asking.kill()

    def shell(self, command: str) -> None:
        """Run a command in the programs' network."""
        subprocess.run([*self.enter, "sh", "-c", command], check=True, timeout=SECONDS)

    def log(self) -> str:
        """What it has written so far."""
        return self._log.read_text()

    def stop(self) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(20)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()


@contextlib.contextmanager
def two_programs(folder: Path, text: str) -> Iterator[list[Program]]:
    """A farm and its controller, each a process, in a network of their own."""
    holder = subprocess.Popen(["unshare", "-n", "sh", "-c", f"{CABLE} && echo up && exec sleep 300"],
                              stdout=subprocess.PIPE, text=True)  # fmt: skip
    programs = []
    try:
        assert holder.stdout.readline() == "up\n"
        file = folder / "stalls.pnfarm.yml"
        file.write_text(text)
        programs.append(Program("up", file, holder.pid, folder / "up.log"))
        programs.append(Program("plc", file, holder.pid, folder / "plc.log"))
        yield programs
    finally:
        for program in programs:
            program.stop()
        holder.kill()
        holder.wait()
        holder.stdout.close()


def stopped(seconds: float, *programs: Program) -> None:
    """The machine does not run these processes for so long."""
    for program in programs:
        program.process.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    for program in programs:
        program.process.send_signal(signal.SIGCONT)
