"""The audit log: a line for each request that changes something, before it is carried out, and one for its answer.

::

    {
        "sequence": 7,
        "time": "2026-11-29T04:00:00.123456Z",
        "record": "request",
        "token": "ci",
        "role": "inject",
        "peer": "10.0.0.7",
        "method": "POST",
        "path": "/api/v1/faults",
        "query": "",
        "body": "9f86...",
        "previous": "60303a...",
    }
    {"sequence": 8, "time": "...", "record": "answer", "of": 7, "status": 201, "previous": "d15d..."}

``previous`` is the SHA-256 of the line before, so that no line can be changed, added or taken out inside the file
(:mod:`pnfarm.api.access.audit_check`).  Its end is noted in the state folder: a run begins with a record that says how
it found the file.  What cannot be written is not done.
"""

from __future__ import annotations

import asyncio
import errno
import fcntl
import hashlib
import json
import os
import stat
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from functools import partial
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, NamedTuple

import anyio
import structlog
from starlette.requests import Request

from pnfarm.api.access.guard import ROLE, SAFE_METHODS, WHO
from pnfarm.api.problems import problem
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.version import __version__
from pnfarm.web.bodies import MAX_BODY, read_octets
from pnfarm.web.disk import disk_call, silent_disk
from pnfarm.web.errors import ClientGoneError, TooLargeError

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Mapping
    from pathlib import Path

    from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["FIRST", "MOST_LINE", "Audit", "AuditLog", "digest_of_line", "kept"]

#: ``previous`` of the first line.
FIRST = "0" * 64
#: Octets of a line, and characters of what a client names in it, each of which may take six octets.
MOST_LINE = 131_072
MOST_TEXT = 2_000
#: How long anybody waits for the disk.
WAIT_SECONDS = 5.0
#: Octets of the note of the end; in one sector, so that it is there as a whole or not at all.
NOTE_OCTETS = 512

logger = structlog.get_logger("pnfarm.api")


def digest_of_line(line: bytes) -> str:
    """Of a line without its end."""
    return hashlib.sha256(line).hexdigest()


class _Noted(NamedTuple):
    """The end of the file as it was noted: its last record, and its octets."""

    sequence: int
    digest: str
    size: int


class AuditLog:
    """The file at ``path``, and the ``note`` of its end, None where there is no place for it.

    Raises :class:`ConfigError` for what is no such file, :class:`EnvironmentError_` for one that another process has.
    """

    def __init__(self, path: Path, note: Path | None = None) -> None:
        self.path = path
        self._note_path = note
        self._note: int | None = None
        #: Answers that could not be written: they are the first to be, before any further request.
        self._owed: list[dict[str, Any]] = []
        #: Held while a thread writes, also when no request waits for it any more.
        self._lock = asyncio.Lock()
        #: Part of a line is after the last record.
        self._half = False
        was_there = path.exists()
        self._made = not was_there
        self._file = self._open(path)
        try:
            noted = self._noted()
            self._size = os.fstat(self._file).st_size
            self.found = self._compare(noted, was_there=was_there)
            self._sequence, self._digest, self._torn = self._end(noted)
            self._before = noted
        except BaseException:
            self.release()
            raise

    @property
    def sequence(self) -> int:
        """Of the last record."""
        return self._sequence

    @property
    def digest(self) -> str:
        """Of the last line."""
        return self._digest

    # -- a run

    def begin(self, name: str) -> None:
        """The first record of a run: how it found the file."""
        before = None if self._before is None else {"sequence": self._before.sequence, "digest": self._before.digest}
        try:
            self._append({"record": "begin", "pnfarm": __version__, "name": name, "found": self.found, "noted": before})
        except OSError as exc:
            raise EnvironmentError_(f"the audit log {self.path} cannot be written: {_why(exc)}") from exc
        told = logger.warning if self.found in {"shortened", "changed", "missing", "unnoted"} else logger.info
        told("audit log begun", file=str(self.path), found=self.found, sequence=self._sequence, digest=self._digest)

    async def close(self) -> None:
        """The last record of a run; a thread that still writes keeps the files until the process ends."""
        with anyio.CancelScope(shield=True):
            try:
                await self._carefully({"record": "end"})
            except OSError as exc:
                logger.warning("audit log not ended", file=str(self.path), reason=_why(exc))
            else:
                logger.info("audit log ended", file=str(self.path), sequence=self._sequence, digest=self._digest)
            if not self._lock.locked():
                self.release()

    def release(self) -> None:
        """Close the files without a record; a log that was made now and has none is gone again."""
        if self._made and self._file >= 0 and os.fstat(self._file).st_size == 0 and self._is_in_place():
            self.path.unlink()
        for one in (self._file, self._note):
            if one is not None and one >= 0:
                os.close(one)
        self._file, self._note = -1, None

    # -- records

    async def request(self, fields: Mapping[str, Any]) -> int:
        """Write a request to the disk; its sequence number.

        Raises :class:`OSError`, also for a disk that takes too long: if it is written then, so is its refusal.
        """
        return await self._carefully({"record": "request", **fields}, late=self._refused)

    async def answer(self, of: int, status: int) -> None:
        """Write how a request was answered, now or before the next request."""
        record = {"record": "answer", "of": of, "status": status}
        with anyio.CancelScope(shield=True):
            try:
                await self._carefully(record)
            except OSError as exc:
                logger.warning("audit log owes an answer", file=str(self.path), of=of, reason=_why(exc))

    def _refused(self, writing: asyncio.Future[int]) -> None:
        """A request was written when no client waited for it any more."""
        if not writing.exception():
            self._owed.append({"record": "answer", "of": writing.result(), "status": HTTPStatus.SERVICE_UNAVAILABLE})

    async def _carefully(
        self, record: dict[str, Any], late: Callable[[asyncio.Future[int]], None] | None = None
    ) -> int:
        """Write a record, in a thread, as the disk may not answer; ``late`` is called with one that took too long."""
        until = anyio.current_time() + WAIT_SECONDS
        try:
            async with asyncio.timeout_at(until):
                await self._lock.acquire()
        except TimeoutError as exc:
            self._owe(record)
            raise silent_disk(WAIT_SECONDS) from exc
        writing = disk_call(partial(self._append_all, record), "pnfarm-audit")
        writing.add_done_callback(partial(self._written, record))
        done, _ = await asyncio.wait([writing], timeout=until - anyio.current_time())
        if done:
            return writing.result()
        if late is not None:
            writing.add_done_callback(late)
        raise silent_disk(WAIT_SECONDS)

    def _written(self, record: dict[str, Any], writing: asyncio.Future[int]) -> None:
        self._lock.release()
        if writing.exception():
            self._owe(record)

    def _owe(self, record: dict[str, Any]) -> None:
        if record["record"] == "answer":
            self._owed.append(record)

    def _append_all(self, record: dict[str, Any]) -> int:
        while self._owed:
            self._append(self._owed[0])
            del self._owed[0]
        return self._append(record)

    def _append(self, record: dict[str, Any]) -> int:
        """One line, whole or not at all; on the disk, but for answers, which the next record takes along."""
        if self._file < 0:
            raise OSError(errno.EBADF, "it is closed")
        time = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%S.%fZ}"
        whole = {"sequence": self._sequence + 1, "time": time, **record, "previous": self._digest}
        line = json.dumps(whole, separators=(",", ":")).encode("ascii")
        if len(line) > MOST_LINE:
            raise OSError(errno.EMSGSIZE, os.strerror(errno.EMSGSIZE))
        if not self._is_in_place():
            # a record in a file that is not at its place is none
            raise OSError(errno.ESTALE, "the file is not in its place")
        if self._half:
            self._take_back()
        octets = (b"\n" if self._torn else b"") + line + b"\n"
        try:
            if os.write(self._file, octets) != len(octets):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            if record["record"] != "answer":
                os.fdatasync(self._file)
        except OSError:
            self._half = True
            self._take_back()
            raise
        self._torn = False
        self._size += len(octets)
        self._sequence += 1
        self._digest = digest_of_line(line)
        if record["record"] != "answer":
            self._take_note()
        return self._sequence

    def _take_back(self) -> None:
        """What is there of a line is no record."""
        os.ftruncate(self._file, self._size)
        self._half = False

    # -- the file as it is found

    def _is_in_place(self) -> bool:
        return self.path.exists() and os.path.samestat(self.path.stat(), os.fstat(self._file))

    @staticmethod
    def _open(path: Path) -> int:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NONBLOCK | os.O_CLOEXEC
            file = os.open(path, flags, 0o600)
        except OSError as exc:
            raise ConfigError(f"the audit log {path} cannot be opened: {_why(exc)}") from exc
        try:
            if not stat.S_ISREG(os.fstat(file).st_mode):
                raise ConfigError(f"the audit log {path} is not a regular file")
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as exc:
            os.close(file)
            raise EnvironmentError_(f"the audit log {path} is written by another process: give each its own") from exc
        except ConfigError:
            os.close(file)
            raise
        return file

    def _noted(self) -> _Noted | None:
        if self._note_path is None:
            return None
        try:
            self._note_path.parent.mkdir(parents=True, exist_ok=True)
            self._note = os.open(self._note_path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            text = os.read(self._note, NOTE_OCTETS)
        except OSError as exc:
            raise ConfigError(f"the end of the audit log cannot be noted in {self._note_path}: {_why(exc)}") from exc
        if not text.strip():
            return None
        try:
            found = json.loads(text)
            return _Noted(int(found["sequence"]), str(found["digest"]), int(found["size"]))
        except (ValueError, KeyError, TypeError, OverflowError):
            # another program wrote into it: nothing fits it
            return _Noted(0, "", -1)

    def _compare(self, noted: _Noted | None, *, was_there: bool) -> str:
        """How the file is found: new, continued, missing, shortened or changed; torn if its last line is half there.

        Unnoted: there is a place for the note of its end, and no note.
        """
        if noted is not None:
            if not was_there:
                return "missing"
            if self._size < noted.size:
                return "shortened"
            lines = self._lines_before(noted.size) if noted.size > 0 else []
            if not lines or digest_of_line(lines[-1]) != noted.digest:
                return "changed"
        if self._size == 0:
            return "new"
        if os.pread(self._file, 1, self._size - 1) != b"\n":
            return "torn"
        return "unnoted" if noted is None and self._note_path is not None else "continued"

    def _lines_before(self, end: int) -> list[bytes]:
        """The lines of the last octets before ``end``, without what may be half a line at their start."""
        begin = max(0, end - 2 * MOST_LINE)
        lines = os.pread(self._file, end - begin, begin).removesuffix(b"\n").split(b"\n")
        return lines[1:] if begin > 0 else lines

    def _end(self, noted: _Noted | None) -> tuple[int, str, bool]:
        """Number and digest of the last line, and whether its end is missing."""
        last = max(0, noted.sequence) if noted is not None else 0
        if self._size == 0:
            return last, FIRST, False
        torn = os.pread(self._file, 1, self._size - 1) != b"\n"
        lines = self._lines_before(self._size)
        for line in reversed(lines):
            try:
                return max(last, int(json.loads(line)["sequence"])), digest_of_line(lines[-1]), torn
            except (ValueError, KeyError, TypeError):
                # half a record, or none
                continue
        if lines and self.found != "torn" and noted is None:
            raise ConfigError(f"{self.path} is not an audit log: none of its last lines is a record")
        return last, digest_of_line(lines[-1] if lines else b""), torn

    def _take_note(self) -> None:
        if self._note is None:
            return
        text = json.dumps({"sequence": self._sequence, "digest": self._digest, "size": self._size})
        try:
            os.pwrite(self._note, text.encode().ljust(NOTE_OCTETS - 1) + b"\n", 0)
        except OSError as exc:
            logger.warning("end of the audit log not noted", file=str(self._note_path), reason=_why(exc))


def _why(exc: OSError) -> str:
    return (exc.strerror or str(exc)).lower()


@asynccontextmanager
async def kept(log: AuditLog | None, name: str) -> AsyncIterator[None]:
    """A run: its first and its last record; nothing without a ``log``.  Raises :class:`EnvironmentError_`."""
    if log is None:
        yield
        return
    log.begin(name)
    try:
        yield
    finally:
        await log.close()


class Audit:
    """ASGI layer between the guard, which knows the client, and the check of its rights, whose refusals count too."""

    def __init__(self, app: ASGIApp, log: AuditLog) -> None:
        self._app = app
        self._log = log

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] in SAFE_METHODS:
            await self._app(scope, receive, send)
            return
        request = Request(scope, receive)
        try:
            body = await read_octets(request, MAX_BODY)
            number = await self._log.request(_fields(scope, body))
        except TooLargeError as exc:
            await problem(exc.status, str(exc), request)(scope, receive, send)
            return
        except ClientGoneError as exc:
            await problem(HTTPStatus.BAD_REQUEST, str(exc), request)(scope, receive, send)
            return
        except OSError as exc:
            logger.warning("audit log not written", file=str(self._log.path), reason=_why(exc))
            sentence = f"nothing was changed: the audit log cannot be written ({_why(exc)})"
            headers = {"Retry-After": "5"}
            await problem(HTTPStatus.SERVICE_UNAVAILABLE, sentence, request, headers=headers)(scope, receive, send)
            return
        status = HTTPStatus.INTERNAL_SERVER_ERROR.value

        async def watched(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self._app(scope, _again(body, receive), watched)
        finally:
            await self._log.answer(number, status)


def _fields(scope: Scope, body: bytes) -> dict[str, Any]:
    client = scope.get("client")
    return {
        "token": scope[WHO],
        "role": scope[ROLE].value,
        "peer": _cut(str(client[0]) if client else ""),
        "method": _cut(scope["method"]),
        "path": _cut(scope["path"]),
        "query": _cut(scope.get("query_string", b"").decode("latin-1")),
        "body": hashlib.sha256(body).hexdigest(),
    }


def _cut(text: str) -> str:
    """Of a text that is too long its start, and the digest of the whole."""
    if len(text) <= MOST_TEXT:
        return text
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    return f"{text[:MOST_TEXT]}... ({len(text)} characters, SHA-256 {digest})"


def _again(body: bytes, receive: Receive) -> Receive:
    """The body that was read, then what comes after it."""
    is_read = False

    async def receive_again() -> Message:
        nonlocal is_read
        if is_read:
            return await receive()
        is_read = True
        return {"type": "http.request", "body": body, "more_body": False}

    return receive_again
