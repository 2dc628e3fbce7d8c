"""Where other processes of this user ask a running controller for parameters of the stations on its line.

A Unix socket in the abstract namespace, named after the way to the line: it leaves nothing behind, however the process
ends.  One line of JSON is a question, one the answer; a process of another user is turned away.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import os
import socket
import struct
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pnfarm.buses.line_parameters import AskedController, LineQuestion
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.errors import ConfigError, EnvironmentError_, PnfarmError, RemoteError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.controller import Controller

__all__ = ["LineDoor", "ask_controller"]

#: A question, and an answer, in octets at most.
LONGEST: Final = 4096
#: Beyond the time that a controller itself gives a request.
ANSWER_SECONDS: Final = 20.0
_LOOK_SECONDS: Final = 0.01
_QUESTION_SECONDS: Final = 2.0
#: pid, uid and gid of the process at the other end (``struct ucred``).
_CREDENTIALS: Final = struct.Struct("3i")
_KINDS: Final[dict[str, type[PnfarmError]]] = {
    "config": ConfigError,
    "remote": RemoteError,
    "machine": EnvironmentError_,
}


def _name(where: str) -> bytes:
    """By the path as it is given, of a port or of a link to a pty, or by HOST:PORT."""
    path = Path(where)
    place = str(path.parent.resolve() / path.name) if path.exists() or path.is_symlink() else where
    return b"\0pnfarm-controller-" + hashlib.sha256(os.fsencode(place)).digest()


class LineDoor:
    """``poke`` is called when the controller was given something to do."""

    def __init__(self, controller: Controller, where: str, poke: Callable[[], None]) -> None:
        self._controller = controller
        self._where = where
        self._poke = poke
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    async def open(self) -> bool:
        """False where the controller cannot be asked, or another one of this machine is asked for this line."""
        if not isinstance(self._controller, AskedController):
            return False
        sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)
        try:
            sock.bind(_name(self._where))
        except OSError:
            sock.close()
            return False
        self._server = await asyncio.start_unix_server(self._asked, sock=sock, limit=LONGEST)
        return True

    async def close(self) -> None:
        """A client that waits for an answer gets none."""
        server, self._server = self._server, None
        if server is None:
            return
        server.close()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _asked(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        if task is not None:
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        try:
            if _is_trusted(writer.get_extra_info("socket")):
                async with asyncio.timeout(_QUESTION_SECONDS):
                    line = await reader.readline()
                writer.write(json.dumps(await self._answer(line)).encode() + b"\n")
                await writer.drain()
        except (TimeoutError, OSError, ValueError):
            # it does not ask, asks at length, or has gone: there is no client to answer
            pass
        finally:
            writer.close()

    async def _answer(self, line: bytes) -> dict[str, Any]:
        controller = self._controller
        assert isinstance(controller, AskedController)
        try:
            asked = controller.ask_station(_question(line), time.monotonic_ns())
            self._poke()
            async with asyncio.timeout(ANSWER_SECONDS):
                while not asked.done:  # noqa: ASYNC110 - the state machines have no events to wait for
                    await asyncio.sleep(_LOOK_SECONDS)
            return {"found": asked.result()}
        except ParameterError as exc:
            return {"error": str(exc), "kind": "parameter"}
        except TimeoutError:
            return {"error": "the controller has not asked in time", "kind": "remote"}
        except PnfarmError as exc:
            kind = next((name for name, one in _KINDS.items() if isinstance(exc, one)), "remote")
            return {"error": str(exc), "kind": kind}


def _is_trusted(sock: Any) -> bool:
    """Whether the other end is a process of this user, or of root."""
    _, user, _ = _CREDENTIALS.unpack(sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
    return user in {os.getuid(), 0}


def _question(line: bytes) -> LineQuestion:
    """Raises :class:`ConfigError` for what is none."""
    try:
        given = json.loads(line)
        wanted = LineQuestion(**given)
    except (ValueError, TypeError, RecursionError) as exc:
        raise ConfigError("this is no question for a parameter") from exc
    whole = all(type(one) is int for one in (wanted.station, wanted.own, wanted.baud))
    fits = whole and type(wanted.parameter) is str and (wanted.value is None or type(wanted.value) is int)
    if not fits or not (wanted.model is None or type(wanted.model) is str):
        raise ConfigError("this is no question for a parameter")
    return wanted


class _RefusedError(ParameterError):
    """What another process was refused, in its words."""

    def __init__(self, text: str) -> None:
        Exception.__init__(self, text)


def ask_controller(where: str, question: LineQuestion) -> dict[str, Any] | None:
    """The answer of the controller that runs on this line; None where none of this machine does.

    Raises what the controller got, as :meth:`pnfarm.buses.line_parameters.Asked.result` does.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as sock:
        sock.settimeout(ANSWER_SECONDS + 2 * _QUESTION_SECONDS)
        try:
            sock.connect(_name(where))
        except OSError:
            return None
        if not _is_trusted(sock):
            return None
        octets = b""
        with contextlib.suppress(OSError):
            sock.sendall(json.dumps(asdict(question)).encode() + b"\n")
            while not octets.endswith(b"\n") and (more := sock.recv(LONGEST)):
                octets += more
    if not octets.endswith(b"\n"):
        raise RemoteError(f"the controller on {where} gave no answer: it ends, or is another user's")
    told: dict[str, Any] = json.loads(octets)
    if "found" in told:
        found: dict[str, Any] = told["found"]
        return found
    if told["kind"] == "parameter":
        raise _RefusedError(told["error"])
    raise _KINDS[told["kind"]](told["error"])
