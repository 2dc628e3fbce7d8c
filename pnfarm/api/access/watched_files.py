"""What is read of files, and read again when they change: tokens, certificates."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING, Generic, TypeVar

from pnfarm.errors import ConfigError
from pnfarm.web.disk import disk_call, silent_disk

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

__all__ = ["WatchedFiles"]

#: How long somebody waits for the disk of such a file; then the file is one that cannot be read.
WAIT_SECONDS = 1.0
#: Between two tries to read what could not be read, as that may pass without a change: where no descriptor was left.
AGAIN_SECONDS = 1.0

_T = TypeVar("_T")
#: What shows that a file has changed: time, size, inode; None without a file.
_Stamp = tuple[int, int, int] | None


class WatchedFiles(Generic[_T]):
    """``read`` raises :class:`ConfigError`, from here, too.

    ``renewed`` is called with what was read later, ``failed`` with why it could not be, once for each reason.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        read: Callable[[], _T],
        renewed: Callable[[_T], None],
        failed: Callable[[str], None],
    ) -> None:
        self._paths = paths
        self._read = read
        self._renewed, self._failed = renewed, failed
        self._stamps = self._look()
        self.first = read()
        #: Why the files as they are could not be read, and when that was.
        self._reason = ""
        self._failed_at = 0.0
        self._turn: asyncio.Future[_T | None] | None = None
        self._turn_begun = 0.0

    async def follow(self) -> None:
        """Check whether the files have changed."""
        if self._turn is not None:
            # that one may have looked before a change
            await self._wait(self._turn)
        if self._turn is None:
            self._turn_begun = time.monotonic()
            self._turn = disk_call(self._read_changed, "pnfarm-files")
            self._turn.add_done_callback(self._ended)
        await self._wait(self._turn)

    async def _wait(self, turn: asyncio.Future[_T | None]) -> None:
        left = self._turn_begun + WAIT_SECONDS - time.monotonic()
        done, _ = await asyncio.wait([turn], timeout=max(0.0, left))
        if not done:
            self._fail(silent_disk(WAIT_SECONDS), at=0.0)
        elif (error := turn.exception()) is not None and not isinstance(error, (ConfigError, OSError)):
            raise error

    def _read_changed(self) -> _T | None:
        """In a thread; None if there is nothing new."""
        stamps = self._look()
        is_due = bool(self._reason) and time.monotonic() - self._failed_at >= AGAIN_SECONDS
        if stamps == self._stamps and not is_due:
            return None
        self._stamps = stamps
        return self._read()

    def _ended(self, turn: asyncio.Future[_T | None]) -> None:
        self._turn = None
        error = turn.exception()
        if error is not None:
            self._fail(error, at=time.monotonic())
        elif (found := turn.result()) is not None:
            self._reason = ""
            self._renewed(found)

    def _fail(self, error: BaseException, *, at: float) -> None:
        before, self._reason, self._failed_at = self._reason, _why(error), at
        if self._reason != before:
            self._failed(self._reason)

    def _look(self) -> list[_Stamp]:
        return [_stamp(path) for path in self._paths]


def _stamp(path: Path) -> _Stamp:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _why(error: BaseException) -> str:
    return (error.strerror or str(error)).lower() if isinstance(error, OSError) else str(error)
