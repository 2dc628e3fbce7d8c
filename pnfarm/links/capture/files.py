"""The file, or the ring of files, that a capture goes to.

Names of a ring are dumpcap's: ``OUT_00001_20261121120000.pcapng``.  Whole blocks are written, unbuffered: a reader that
opens a file that is being written finds whole packets.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections import deque
from typing import TYPE_CHECKING, Protocol

from pnfarm.errors import EnvironmentError_

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

__all__ = ["BlockSink", "CaptureFiles"]


class BlockSink(Protocol):
    """Takes the blocks of a capture: files, or a ring in memory."""

    #: Where they go.
    current: Path
    #: What a file ends with.
    tail: Callable[[], bytes]

    def extend_head(self, more: bytes) -> None:
        """Blocks that every file begins with."""

    def write(self, blocks: bytes | memoryview) -> int | None:
        """Whole blocks."""

    def flush(self) -> None:
        """Hand over what waits."""

    def close(self) -> None:
        """The capture is over."""

    def abandon(self) -> None:
        """The capture failed."""


class CaptureFiles:
    """Writes blocks to ``path``; with ``size`` (octets) to a ring of files beside it, of which ``files`` are kept.

    ``head`` begins every file.  Raises :class:`~pnfarm.errors.EnvironmentError_` when a file cannot be written;
    what was written before stays a whole capture.
    """

    def __init__(self, path: Path, head: bytes, *, size: int | None = None, files: int | None = None) -> None:
        self._path = path
        self._head = head
        self._size = size
        self._keep = files
        self._fd = -1
        self._written = 0
        self._kept: deque[Path] = deque()
        self.number = 0
        #: The file that is being written.
        self.current = path
        #: What a file ends with: called when it is full, and at the end.
        self.tail: Callable[[], bytes] = bytes
        self._open()

    def extend_head(self, more: bytes) -> None:
        """Add to the head, in this file and in those that follow."""
        self._head += more
        self._put(more)

    def write(self, blocks: bytes | memoryview) -> None:
        """Append whole blocks; they never lie in two files."""
        if (
            self._size is not None
            and self._written > len(self._head)
            and self._written + len(blocks) > self._size - _TAIL_ROOM
        ):
            self._finish()
            self._open()
        self._put(blocks)

    def flush(self) -> None:
        """Nothing waits: writes are unbuffered."""

    def close(self) -> None:
        """Write the tail and close; closing twice does nothing."""
        if self._fd >= 0:
            self._finish()

    def abandon(self) -> None:
        """Close without a tail, after an error."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def _finish(self) -> None:
        try:
            self._put(self.tail())
        finally:
            self.abandon()

    def _open(self) -> None:
        self.number += 1
        if self._size is not None:
            stamp = time.strftime("%Y%m%d%H%M%S")
            suffix = self._path.suffix
            name = f"{self._path.name.removesuffix(suffix)}_{self.number:05}_{stamp}{suffix}"
            self.current = self._path.with_name(name)
        try:
            self._fd = os.open(self.current, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o644)
        except OSError as exc:
            raise self._refused(exc) from exc
        self._written = 0
        self._kept.append(self.current)
        while self._keep is not None and len(self._kept) > self._keep:
            with contextlib.suppress(FileNotFoundError):  # it was removed already
                self._kept.popleft().unlink()
        try:
            self._put(self._head)
        except EnvironmentError_:
            self.abandon()
            raise

    def _put(self, data: bytes | memoryview) -> None:
        left = memoryview(data)
        try:
            while left:
                left = left[os.write(self._fd, left) :]
        except OSError as exc:
            with contextlib.suppress(OSError):  # a device or a pipe has no length to cut
                os.ftruncate(self._fd, self._written)
            raise self._refused(exc) from exc
        self._written += len(data)

    def _refused(self, exc: OSError) -> EnvironmentError_:
        return EnvironmentError_(f"capture {self.current} cannot be written: {exc.strerror}")


#: Octets left free in a file of a ring for its tail.
_TAIL_ROOM = 65_536
