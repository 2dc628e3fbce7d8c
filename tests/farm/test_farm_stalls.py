"""A farm that the machine does not run for a moment: what its controller does then is told as the farm's own doing."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 60.0
FILE = """
farm: stalls
link: {kind: macvlan, parent: stall0}
api: off
drives:
  - {name: axis-01, model: akd-profinet, ip: 10.77.0.11/16}
controller: {name: plc, ip: 10.77.255.1/16, interface: stall1, cycle: 16ms, watchdog_factor: 3, program: {kind: sine}}
"""
CABLE = "ip link add stall0 type veth peer name stall1 && ip link set stall0 up && ip link set stall1 up"


class Program:
    """One of the program's commands with its log as JSON lines."""

    def __init__(self, command: str, file: Path, where: int, log: Path) -> None:
        enter = ["nsenter", f"--net=/proc/{where}/ns/net", sys.executable, "-m", "pnfarm.cli.main"]
        self._log = log
        with log.open("wb") as out:
            self.process = subprocess.Popen(
                [*enter, "--log-format", "json", command, str(file)],
                stdout=out, stderr=out, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)},
            )  # fmt: skip

    def events(self, name: str) -> list[dict]:
        lines = [line for line in self._log.read_text().splitlines() if line.startswith("{")]
        return [entry for entry in map(json.loads, lines) if entry["event"] == name]

    def wait(self, name: str, count: int = 1) -> list[dict]:
        end = time.monotonic() + SECONDS
        while len(found := self.events(name)) < count:
            assert self.process.poll() is None, self._log.read_text()
            assert time.monotonic() < end, self._log.read_text()
            time.sleep(0.02)
        return found

    def stop(self) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(20)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()


@pytest.fixture
def apart(tmp_path):
    """A farm and its controller, each a process, in a network of their own."""
    if os.geteuid() != 0:
        pytest.skip("needs root to make a network namespace")
    holder = subprocess.Popen(["unshare", "-n", "sh", "-c", f"{CABLE} && echo up && exec sleep 300"],
                              stdout=subprocess.PIPE, text=True)  # fmt: skip
    programs = []
    try:
        assert holder.stdout.readline() == "up\n"
        file = tmp_path / "stalls.pnfarm.yml"
        file.write_text(FILE)
        programs.append(Program("up", file, holder.pid, tmp_path / "up.log"))
        programs.append(Program("plc", file, holder.pid, tmp_path / "plc.log"))
        yield programs
    finally:
        for program in programs:
            program.stop()
        holder.kill()
        holder.wait()
        holder.stdout.close()


def stopped(program: Program, seconds: float) -> None:
    """The machine does not run this process for so long."""
    program.process.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    program.process.send_signal(signal.SIGCONT)


@pytest.mark.exclusive
def test_connection_that_ended_because_the_farm_was_stopped_is_the_farm_s_own_fault(apart):
    farm, _ = apart
    farm.wait("ar established")
    time.sleep(0.3)
    lost = len(farm.events("ar aborted"))
    stopped(farm, 0.1)
    aborted = farm.wait("ar aborted", lost + 1)[lost]
    assert aborted["cause"] == "farm"
    assert aborted["farm_late_seconds"] > 0.08
    assert aborted["farm_budget_seconds"] == 0.016
    assert all(entry["cause"] == "farm" for entry in farm.events("watchdog expired")[-1:])


@pytest.mark.exclusive
def test_connection_that_ended_because_the_controller_was_stopped_is_the_controller_s_fault(apart):
    farm, plc = apart
    farm.wait("ar established")
    time.sleep(0.3)
    expired = len(farm.events("watchdog expired"))
    stopped(plc, 0.3)
    entry = farm.wait("watchdog expired", expired + 1)[expired]
    # a machine that stalls at this very moment makes it the farm's: then the entry has to say by how much
    assert entry["cause"] == ("farm" if entry["farm_late_seconds"] > entry["farm_budget_seconds"] else "controller")
    assert entry["silent_seconds"] > 0.048
