"""The process of one FMU as the farm sees it: asked, it answers later; whatever the FMU does, the farm goes on."""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import signal
import subprocess
import sys
import time
import weakref
from importlib.util import find_spec
from multiprocessing.connection import Pipe
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from pnfarm.errors import EnvironmentError_
from pnfarm.plant.fmi.memory import DONE, END, ENDED, MAX_STATE, REFUSED, STEP, STEP_SECONDS, TIME, VALUES

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from pnfarm.plant.fmi.planned import FmuModel

__all__ = ["FmuFailure", "FmuProcess", "FmuRefusal"]

#: How long the process of an FMU is waited for when it is asked to end.
PATIENCE_SECONDS = 1.0
MAX_TEXT = 500


class FmuFailure(Exception):  # noqa: N818 - what became of an FMU; the farm makes an event or an error of it
    """Why the FMU cannot go on, for people."""


class FmuRefusal(Exception):  # noqa: N818 - its answer to what was asked
    """Why the FMU did not do what it was asked, for people; it goes on."""


class FmuProcess:
    """Starts at once; the first :meth:`answer` says that it is ready.  Raises :class:`EnvironmentError_` without FMPy.

    ``inputs`` and ``outputs`` are the shared numbers; they are the farm's while nothing is asked.
    """

    def __init__(self, name: str, model: FmuModel, inputs: list[float]) -> None:
        if find_spec("fmpy") is None:
            raise EnvironmentError_(f"plant model {name} is an FMU, which needs FMPy: `pip install 'pnfarm[fmi]'`")
        # its process ends, whatever happens, with the farm's end of this pipe
        theirs, lifetime = os.pipe()
        memory = os.memfd_create("pnfarm-fmu")
        try:
            octets = 8 * (VALUES + len(model.inputs) + len(model.outputs))
            os.ftruncate(memory, octets)
            self._numbers = np.frombuffer(mmap.mmap(memory, octets), np.float64)
            self.inputs = self._numbers[VALUES : VALUES + len(inputs)]
            self.outputs = self._numbers[VALUES + len(inputs) :]
            self.inputs[:] = inputs
            folder = TemporaryDirectory(prefix="pnfarm-fmu-")
            self._connection, other = Pipe()
            with other:
                passed = (other.fileno(), theirs, memory)
                self._process = subprocess.Popen(
                    [sys.executable, "-m", "pnfarm.plant.fmi.child", *map(str, passed)],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    pass_fds=passed,
                    # Ctrl-C is the farm's to see
                    start_new_session=True,
                )
        except BaseException:
            os.close(lifetime)
            raise
        finally:
            os.close(theirs)
            os.close(memory)
        self._end = weakref.finalize(self, _end, self._process, self._connection, lifetime, folder)
        self._gone = False
        #: How long its last step took, from the asking on.
        self.took_ns = 0
        #: When it was asked for what it has not answered, by the machine's clock; 0: nothing is asked.
        self.asked_ns = time.perf_counter_ns()
        self._send(json.dumps(_order(name, model, folder.name)).encode())

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._process.pid

    def ask_step(self, at_ns: int, step_ns: int) -> None:
        """From this time of the FMU on, with :attr:`inputs`."""
        self._numbers[TIME], self._numbers[STEP_SECONDS] = at_ns / 1e9, step_ns / 1e9
        self.ask(STEP)

    def ask(self, order: bytes) -> None:
        """One of :mod:`pnfarm.plant.fmi.memory`."""
        self.asked_ns = time.perf_counter_ns()
        self._send(order)

    def _send(self, order: bytes) -> None:
        with contextlib.suppress(BrokenPipeError):  # the answer says that it is gone
            self._connection.send_bytes(order)

    def answer(self, limit_ns: int) -> bytes | None:
        """None: there is none yet, after so long.  Raises :class:`FmuFailure` or :class:`FmuRefusal`."""
        if self.asked_ns == 0:
            return b""
        try:
            if not self._gone and not self._connection.poll(limit_ns / 1e9):
                return None
            found = b"" if self._gone else self._connection.recv_bytes(MAX_STATE + 1)
        except (EOFError, OSError):
            self._gone, found = True, b""
        if found[:1] == DONE:
            self.took_ns = round(float(self._numbers[ENDED]) * 1e9) - self.asked_ns
            self.asked_ns = 0
            return found[1:]
        if found:
            text = " ".join(found[1 : 4 * MAX_TEXT].decode("utf-8", "replace").split())[:MAX_TEXT]
            if found[:1] == REFUSED:
                self.asked_ns = 0
                raise FmuRefusal(text)
            raise FmuFailure(text)
        # it ends at this moment; who cannot wait asks again
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(min(limit_ns / 1e9, PATIENCE_SECONDS))
            raise FmuFailure(f"its process ended{_how(self._process.returncode)}")
        return None

    def kill(self) -> None:
        """End it without waiting for it."""
        self._process.kill()

    def ask_to_end(self, limit_ns: int) -> None:
        """Have it end its FMU, if what it was asked last is done within this time."""
        with contextlib.suppress(FmuFailure):
            if self._end.alive and self.answer(limit_ns) is not None:
                self._send(END)

    def close(self, limit_seconds: float) -> None:
        """Wait for its end, and bring it about."""
        if self.asked_ns == 0:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(limit_seconds)
        self._end()


def _end(
    process: subprocess.Popen[bytes], connection: Connection, lifetime: int, folder: TemporaryDirectory[str]
) -> None:
    process.kill()
    os.close(lifetime)
    connection.close()
    process.wait()
    folder.cleanup()


def _how(code: int | None) -> str:
    """``, SIGSEGV``."""
    if code is None or code == 0:
        return ""
    if code > 0:
        return f" with code {code}"
    with contextlib.suppress(ValueError):
        return f", {signal.Signals(-code).name}"
    return f", signal {-code}"


def _order(name: str, model: FmuModel, folder: str) -> dict[str, object]:
    """What a process has to know of its FMU."""
    known = model.description
    return {
        "name": name,
        "path": str(model.path),
        "folder": folder,
        "library": model.library,
        "version": known.version,
        "identifier": known.identifier,
        "token": known.token,
        "parameters": [
            [known.variables[name].type, known.variables[name].reference, value]
            for name, value in model.parameters.items()
        ],
        **{
            f"{side}s": [[one.type, one.reference, one.low, one.high] for one in known.of(side)]
            for side in ("input", "output")
        },
    }
