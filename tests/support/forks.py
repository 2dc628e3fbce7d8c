"""This project's programs as processes that start at once: forks of one that has loaded them (:mod:`fork_server`)."""

from __future__ import annotations

import atexit
import json
import os
import select
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import IO, Any

from fork_server import NUMBER

from pnfarm.drives.catalogue import MODELS_VARIABLE

#: The module whose ``main()`` is the program.
PROGRAM = "pnfarm.cli.main"
ROOT = Path(__file__).resolve().parents[2]
#: Variables that are read while the program is loaded: with another value, a fork would not be that program.
READ_AT_IMPORT = ("NUMBA_", "PYTHON", "XDG_CACHE_HOME", "LD_")


class Fork:
    """A forked program, with the methods of :class:`subprocess.Popen` that tests use."""

    def __init__(
        self,
        program: str | Path,
        *arguments: str | Path,
        env: Mapping[str, str] | None = None,
        stdin: int | IO[Any] | None = None,
        stdout: int | IO[Any] | None = None,
        stderr: int | IO[Any] | None = None,
        namespaces: int | None = None,
    ) -> None:
        self.args = [str(program), *map(str, arguments)]
        self.returncode: int | None = None
        theirs: list[int] = []
        self.stdin = self._standard(stdin, 0, theirs)
        self.stdout = self._standard(stdout, 1, theirs)
        self.stderr = self._standard(stderr, 2, theirs)
        # the namespace of this thread, which a test may have moved
        theirs.append(os.open("/proc/thread-self/ns/net", os.O_RDONLY | os.O_CLOEXEC))
        self._pipe, pipe = os.pipe()
        theirs.append(pipe)
        request = {
            "program": self.args[0],
            "arguments": self.args[1:],
            "environment": dict(os.environ if env is None else env),
            "folder": str(Path.cwd()),
            "namespaces": namespaces,
        }
        socket.send_fds(_server(), [json.dumps(request).encode()], theirs)
        for descriptor in theirs:
            os.close(descriptor)
        self.pid = self._number()

    @staticmethod
    def _standard(wanted: int | IO[Any] | None, number: int, theirs: list[int]) -> IO[Any] | None:
        if wanted == subprocess.PIPE:
            ours, other = os.pipe() if number else reversed(os.pipe())
            theirs.append(other)
            return os.fdopen(ours, "r" if number else "w", encoding="utf-8")
        if wanted == subprocess.DEVNULL:
            theirs.append(os.open(os.devnull, os.O_RDWR))
        elif wanted == subprocess.STDOUT:
            theirs.append(os.dup(theirs[1]))
        else:
            theirs.append(os.dup(number if wanted is None else wanted if isinstance(wanted, int) else wanted.fileno()))
        return None

    def _number(self) -> int:
        octets = os.read(self._pipe, NUMBER.size)
        if len(octets) != NUMBER.size:
            raise RuntimeError("the process that forks ended")
        return int(NUMBER.unpack(octets)[0])

    def _ended(self, seconds: float | None) -> bool:
        if self.returncode is None and select.select([self._pipe], [], [], seconds)[0]:
            self.returncode = os.waitstatus_to_exitcode(self._number())
            os.close(self._pipe)
        return self.returncode is not None

    def poll(self) -> int | None:
        self._ended(0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        if not self._ended(timeout):
            raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        assert self.returncode is not None
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(15)

    def kill(self) -> None:
        self.send_signal(9)


def run_fork(program: str | Path, *arguments: str | Path, timeout: float, **options: Any) -> Any:
    """A forked program to its end: a finished process with its text, as :func:`subprocess.run` returns it."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        process = Fork(program, *arguments, stdin=subprocess.DEVNULL, stdout=out, stderr=err, **options)
        try:
            code = process.wait(timeout)
        finally:
            process.kill()
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(process.args, code, out.read(), err.read())


def clean_environment(**more: str) -> dict[str, str]:
    """Without the program's own variables, but with the models that the test run knows."""
    kept = {n: v for n, v in os.environ.items() if not n.startswith("PNFARM_") or n == MODELS_VARIABLE}
    return kept | more


def can_fork(environment: Mapping[str, str]) -> bool:
    """Whether a program with this environment is the one that was loaded."""
    return all(
        os.environ.get(name) == environment.get(name)
        for name in {*os.environ, *environment}
        if name.startswith(READ_AT_IMPORT)
    )


@cache
def _server() -> socket.socket:
    """The socket of the process that forks; it ends with this one."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 18)
    with theirs:
        number = theirs.fileno()
        process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("fork_server.py")), str(number)],
            pass_fds=[number], cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)},
        )  # fmt: skip

    def end() -> None:
        ours.close()
        process.wait()

    atexit.register(end)
    return ours
