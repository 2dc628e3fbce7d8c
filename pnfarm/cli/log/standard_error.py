"""Standard error as the log's destination: it never makes the program wait for its reader.

A pipe that is not read is full after 64 KB: the supervisor of a container may have died, and the container runs on.
Then lines are lost, as with a reader that has gone or a full disk, and the next one that is written says how many.
"""

from __future__ import annotations

import os
import select
import stat
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import MutableMapping

__all__ = ["StandardError"]

#: So many octets go into a pipe without waiting once it takes any (PIPE_BUF of Linux).
PIECE = 4096


class StandardError:
    """Looked up for each line: a live table on the terminal replaces ``sys.stderr`` while it runs."""

    def __init__(self) -> None:
        #: Lines lost since the last one that was written.
        self.lost = 0
        self._is_torn = False

    def write(self, text: str) -> int:
        try:
            is_written = self._written(text)
        except OSError:
            is_written = False
        self.lost = 0 if is_written else self.lost + 1
        return len(text)

    def _written(self, text: str) -> bool:
        pipe = self._pipe()
        if pipe is None:
            sys.stderr.write(text)
            sys.stderr.flush()
            return True
        octets = text.encode("utf-8", "backslashreplace")
        if self._is_torn:
            octets = b"\n" + octets
        for start in range(0, len(octets), PIECE):
            if not _takes_more(pipe):
                self._is_torn = self._is_torn or start > 0
                return False
            os.write(pipe, octets[start : start + PIECE])
        self._is_torn = False
        return True

    def flush(self) -> None:
        """Each line is flushed when it is written."""

    def isatty(self) -> bool:
        return sys.stderr.isatty()

    def tell_lost(self, _logger: Any, _method: str, line: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
        """A step of structlog's: ``lines_lost`` in the line."""
        if self.lost:
            line["lines_lost"] = self.lost
        return line

    @staticmethod
    def _pipe() -> int | None:
        """The descriptor, if standard error is a pipe or a socket."""
        real = sys.__stderr__
        if real is None or sys.stderr is not real:
            return None
        try:
            number = real.fileno()
            mode = os.fstat(number).st_mode
        except (OSError, ValueError):
            return None
        return number if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) else None


def _takes_more(pipe: int) -> bool:
    """Whether a piece is taken at once.  The write itself reports a reader that is gone."""
    poll = select.poll()
    poll.register(pipe, select.POLLOUT)
    return bool(poll.poll(0))
