"""The last frames of a run in memory, and on disk those around its failures; both are bounded, however long it is.

A capture writes its blocks (pcapng) into a :class:`FrameRing`.  When a case fails, :meth:`FrameRing.want` names the
time that its reader wants to see: frames that the ring still has, and those to come, go to a file from which
:func:`.slice_capture` takes the slices at the end of the run.  Blocks are handled in chunks and by the thread that
writes them: neither the farm nor its event loop waits for the file.
"""

from __future__ import annotations

import contextlib
import itertools
import struct
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO

from pnfarm.errors import EnvironmentError_

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

__all__ = ["MAX_FILE", "MAX_NS", "MAX_OCTETS", "FrameRing"]

#: The ring's bounds: octets, and time that it reaches back.
MAX_OCTETS = 64_000_000
MAX_NS = 60_000_000_000
#: Octets that go to disk, of all failures together.
MAX_FILE = 256_000_000
#: Failures whose frames are kept; a chunk's octets and time.
MAX_WINDOWS = 256
CHUNK_OCTETS, CHUNK_NS = 65_536, 100_000_000
#: After every stamp.
_END_NS = (1 << 64) - 1
_ENHANCED_PACKET = struct.pack("<I", 6)


@dataclass(slots=True)
class _Chunk:
    first_ns: int
    data: bytearray
    #: Stamp of the first frame of the next one; 0 while frames are added to this one.
    end_ns: int = 0
    filed: bool = False


@dataclass(slots=True, eq=False)
class _Window:
    begin_ns: int
    end_ns: int
    whole: bool = True


class FrameRing:
    """Takes whole blocks, packets in the order of their stamps (ns).  Raises :class:`EnvironmentError_`.

    ``path``: the file for the frames of failures, made when there are any.
    """

    def __init__(self, path: Path, *, octets: int = MAX_OCTETS, ns: int = MAX_NS, file_octets: int = MAX_FILE) -> None:
        self.current = path
        #: What a capture ends with; a slice needs no statistics.
        self.tail: Callable[[], bytes] = bytes
        self._octets, self._ns, self._file_octets = octets, ns, file_octets
        self._head = bytearray()
        self._chunks: deque[_Chunk] = deque()
        self._asked: deque[_Window] = deque()
        self._windows: list[_Window] = []
        self._dropped_ns = -1
        self._count = 0
        self._file: BinaryIO | None = None
        #: Octets in memory, and in the file.
        self.held = self.filed = 0
        #: Failures whose frames are not all there: the ring had lost some, or the file was full.
        self.not_whole = 0

    @property
    def head(self) -> bytes:
        """Blocks that describe the frames."""
        return bytes(self._head)

    def want(self, begin_ns: int, end_ns: int) -> None:
        """Keep the frames from ``begin_ns`` to ``end_ns``, which may be to come; from any thread, without waiting."""
        self._asked.append(_Window(begin_ns, end_ns))

    # -- what a capture calls, in its thread

    def extend_head(self, more: bytes) -> None:
        """Blocks that a file of these frames begins with."""
        self._head += more
        if self._file is not None:
            self._put(more)

    def write(self, blocks: bytes | memoryview) -> int:
        """Whole blocks; packets, or what describes them."""
        if bytes(blocks[:4]) != _ENHANCED_PACKET:
            self.extend_head(bytes(blocks))
            return len(blocks)
        high, low = struct.unpack_from("<II", blocks, 12)
        stamp = high << 32 | low
        last = self._chunks[-1] if self._chunks else None
        if last is not None and len(last.data) < CHUNK_OCTETS and stamp - last.first_ns < CHUNK_NS:
            last.data += blocks
        else:
            if last is not None:
                last.end_ns = stamp
                self._serve(stamp)
            self._chunks.append(_Chunk(stamp, bytearray(blocks)))
        self.held += len(blocks)
        # the last chunk always stays
        while len(self._chunks) > 1 and (self.held > self._octets or stamp - self._chunks[0].end_ns > self._ns):
            if self._asked:
                # before what it may want is dropped
                self._serve(self._chunks[-1].first_ns)
            dropped = self._chunks.popleft()
            self.held -= len(dropped.data)
            if not dropped.filed:
                self._dropped_ns = dropped.end_ns
        return len(blocks)

    def flush(self) -> None:
        """Nothing waits in front of the file."""

    def close(self) -> None:
        """No more frames will come."""
        try:
            if self._chunks:
                # after every window
                self._chunks[-1].end_ns = _END_NS
            self._serve(_END_NS)
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close without writing, after an error of the capture: what is there can still be read."""
        self.not_whole += len(self._asked) + len(self._windows)
        for held in (self._asked, self._windows, self._chunks):
            held.clear()
        self.held = 0
        if self._file is not None:
            # it would write what its disk had no room for
            with contextlib.suppress(OSError):
                self._file.close()
            self._file = None

    # --

    def _serve(self, now: int) -> None:
        """File the complete chunks that windows want; forget windows that end before ``now``."""
        new: list[_Window] = []
        while self._asked:
            window = self._asked.popleft()
            self._count += 1
            if self._count > MAX_WINDOWS:
                self.not_whole += 1
                continue
            window.whole = window.begin_ns >= self._dropped_ns
            new.append(window)
        self._windows += new
        for window in self._windows:
            # to an older window only the newest complete chunk is new
            for chunk in self._chunks if window in new else self._newest():
                wanted = chunk.end_ns >= window.begin_ns and chunk.first_ns <= window.end_ns
                if wanted and chunk.end_ns and not chunk.filed:
                    window.whole &= self._to_file(chunk)
        self.not_whole += sum(not window.whole for window in self._windows if window.end_ns < now)
        self._windows = [window for window in self._windows if window.end_ns >= now]

    def _newest(self) -> list[_Chunk]:
        return [chunk for chunk in itertools.islice(reversed(self._chunks), 2) if chunk.end_ns]

    def _to_file(self, chunk: _Chunk) -> bool:
        """Whether there was room for it."""
        if self.filed + len(chunk.data) > self._file_octets:
            return False
        if self._file is None:
            try:
                self._file = self.current.open("wb")
            except OSError as exc:
                raise EnvironmentError_(f"capture {self.current} cannot be written: {exc.strerror}") from exc
            self._put(self._head)
        self._put(chunk.data)
        chunk.filed = True
        return True

    def _put(self, data: bytes | bytearray) -> None:
        assert self._file is not None
        try:
            self._file.write(data)
            # a full disk is known now, not when the file is closed
            self._file.flush()
        except OSError as exc:
            raise EnvironmentError_(f"capture {self.current} cannot be written: {exc.strerror}") from exc
        self.filed += len(data)
