"""The program run in this process, and as a process of its own in a private network namespace."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from fake_api import served
from forks import PROGRAM, Fork, can_fork, clean_environment, run_fork

from pnfarm.cli.main import main

CLONE_NEWNET = 0x40000000
#: A first start compiles the engine, on a machine that others use as well.
START_SECONDS = 120.0
_libc = ctypes.CDLL(None, use_errno=True)


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


@pytest.fixture
def pnfarm(capsys, monkeypatch):
    """One command line in this process; the test run keeps its own logging."""
    monkeypatch.setattr("pnfarm.cli.log.setup.configure", lambda **_: None)
    for name in os.environ.keys() - clean_environment().keys():
        monkeypatch.delenv(name)

    def run(*arguments: str | Path) -> Outcome:
        code = main([str(argument) for argument in arguments])
        return Outcome(code, *capsys.readouterr())

    return run


def command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", PROGRAM, *map(str, arguments)]


@pytest.fixture(scope="session")
def process():
    """One command line as a process of its own, to its end."""

    def run(*arguments: str | Path, timeout: float = START_SECONDS, **environment: str) -> Outcome:
        wanted = clean_environment(**environment)
        if can_fork(wanted):
            done = run_fork(PROGRAM, *arguments, timeout=timeout, env=wanted)
        else:
            done = subprocess.run(
                command(*arguments), check=False, capture_output=True, text=True, timeout=timeout, env=wanted
            )
        return Outcome(done.returncode, done.stdout, done.stderr)

    run.command = command
    return run


@pytest.fixture(scope="module")
def network():
    """Moves this thread into an empty network namespace; runs ``ip`` in it.  It vanishes afterwards."""
    outside = os.open("/proc/thread-self/ns/net", os.O_RDONLY | os.O_CLOEXEC)
    try:
        if _libc.unshare(CLONE_NEWNET) != 0:
            pytest.skip(f"needs a private network namespace, so root: {os.strerror(ctypes.get_errno())}")
        try:

            def ip(*arguments: str) -> str:
                return subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True).stdout

            try:
                ip("link", "set", "lo", "up")
            except FileNotFoundError:
                pytest.skip("needs the tool `ip` (iproute2)")
            yield ip
        finally:
            assert _libc.setns(outside, CLONE_NEWNET) == 0
    finally:
        os.close(outside)


class Background:
    """A command that runs until it is stopped; its output is a file each, so that no pipe fills."""

    def __init__(self, folder: Path, *arguments: str | Path, **environment: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._out, self._err = folder / "out", folder / "err"
        wanted = clean_environment(**environment)
        with self._out.open("w") as out, self._err.open("w") as err:
            if can_fork(wanted):
                self._process = Fork(PROGRAM, *arguments, stdout=out, stderr=err, env=wanted)
                return
            # under nohup, or behind a shell's &, the tests would hand on that these are ignored
            handed_on = {number: signal.signal(number, signal.SIG_DFL) for number in (signal.SIGHUP, signal.SIGINT)}
            self._process = subprocess.Popen(command(*arguments), stdout=out, stderr=err, env=wanted)
        for number, handler in handed_on.items():
            signal.signal(number, handler)

    @property
    def out(self) -> str:
        return self._out.read_text()

    @property
    def err(self) -> str:
        return self._err.read_text()

    def wait_for(self, text: str, seconds: float = START_SECONDS) -> None:
        """Until it has said ``text``, on either way out."""
        end = time.monotonic() + seconds
        while text not in self.out and text not in self.err:
            if self._process.poll() is not None or time.monotonic() > end:
                pytest.fail(f"never said {text!r}: {self.out}\n{self.err}")
            time.sleep(0.02)

    def end(self) -> int:
        """Wait for it to end by itself; the exit code."""
        return self._process.wait(START_SECONDS)

    def send(self, number: int) -> None:
        self._process.send_signal(number)

    def stop(self, number: int = signal.SIGTERM) -> int:
        """Send a signal and wait for the end; the exit code."""
        if self._process.poll() is None:
            self._process.send_signal(number)
        return self._process.wait(START_SECONDS)


@contextlib.contextmanager
def _started(folder: Path):
    started: list[Background] = []

    def start(*arguments: str | Path, **environment: str) -> Background:
        started.append(Background(folder / f"process-{len(started)}", *arguments, **environment))
        return started[-1]

    try:
        yield start
    finally:
        for one in reversed(started):
            try:
                one.stop(signal.SIGTERM)
            except subprocess.TimeoutExpired:
                one.stop(signal.SIGKILL)


@pytest.fixture
def background(tmp_path):
    """Starts commands that run beside the test; what still runs at its end is stopped."""
    with _started(tmp_path) as start:
        yield start


@pytest.fixture(scope="module")
def shared_background(tmp_path_factory):
    """The same for a whole module."""
    with _started(tmp_path_factory.mktemp("shared")) as start:
        yield start


@pytest.fixture
def farm():
    """The API of a farm: what it answers is the test's."""
    with served() as fake:
        yield fake


@pytest.fixture
def ask(pnfarm, farm, monkeypatch):
    """The command line, with that farm as its own."""

    def ask(*arguments: str):
        monkeypatch.setenv("PNFARM_API", farm.url)
        return pnfarm(*arguments)

    return ask
