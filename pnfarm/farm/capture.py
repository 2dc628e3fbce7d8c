"""A capture of a running farm: all frames of its drives, cyclic and acyclic, both ways, into pcapng files.

Theory: the engine's frames never leave compiled code, so nothing that wraps a link can see them.  A separate packet
socket (:mod:`pnfarm.links.kernel.packet_ring`) receives them at the drives' interfaces, and a thread of low priority
writes them to the file.  The farm never waits for it: frames that the thread is too slow for are dropped by the kernel
and counted here; without a capture neither socket nor thread exists.
"""

from __future__ import annotations

import contextlib
import os
import re
import threading
import time
from collections import deque
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from pnfarm.engine.sockets.capture import ROOM_FACTOR, pack_block
from pnfarm.errors import ConfigError, EnvironmentError_, InternalError
from pnfarm.farm.events import CaptureEnded, CaptureFailed, CaptureLostFrames
from pnfarm.links.capture.files import CaptureFiles
from pnfarm.links.capture.pcap import interface_description, interface_statistics, packet_block, section_header
from pnfarm.links.kernel.bpf_capture import KINDS, atoms_of, capture_filter
from pnfarm.links.kernel.packet_ring import BLOCK, RETIRE_MS, PacketRing
from pnfarm.links.serial.link import FIRST_PORT

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from pnfarm.links.base import Port
    from pnfarm.links.capture.files import BlockSink
    from pnfarm.station.event import Event
    from pnfarm.wire.direction import Direction

__all__ = ["CaptureSettings", "FarmCapture", "parse_size", "prepare"]

#: Size of a file of the ring where only their number was given, octets; files kept where only the size was.
DEFAULT_SIZE = 100_000_000
DEFAULT_FILES = 10
MINIMUM_SIZE = 1_000_000
#: How long the thread waits for frames before it checks other things.
LOOK_MS = 200
#: How often lost frames are reported.
TELL_SECONDS = 10.0
#: Increment of the writing thread's nice value over the farm's.
NICENESS = 5
#: Telegrams of lines that wait for the thread: at 12 Mbit/s those of a second.
MOST_TELEGRAMS = 65_536
BLOCKS_AT_ONCE = 1024

_SIZE = re.compile(r"([0-9]{1,18}(?:\.[0-9]+)?)\s*([kMG]?)(i?)B?", re.IGNORECASE)
_POWERS = {"": 0, "k": 1, "m": 2, "g": 3}

#: Receiver of the capture's events, for the farm's log.
Note: TypeAlias = "Callable[[Event], None]"


def parse_size(text: str, *, minimum: int = MINIMUM_SIZE) -> int:
    """Octets of ``100MB``, ``64MiB``, ``2G``; raises :class:`ConfigError`."""
    found = _SIZE.fullmatch(text.strip())
    if found is None:
        raise ConfigError(f"{text!r} is not a size; give for example 100MB, 64MiB or 2GB")
    number, power, binary = found.groups()
    size = round(float(number) * float(1024 if binary else 1000) ** _POWERS[power.lower()])
    if size < minimum:
        raise ConfigError(f"a file of {text} is too small for a capture; give at least {minimum // 1_000_000}MB")
    return size


@dataclass(frozen=True, slots=True)
class CaptureSettings:
    """``drives`` globs over their names, all if empty; ``only`` keywords of :data:`KINDS`, all frames if empty.

    With ``size`` (octets) or ``files`` a ring of files, else one file.  Raises :class:`ConfigError`.
    """

    path: Path
    drives: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    size: int | None = None
    files: int | None = None
    #: What takes the frames instead of files at ``path``.
    sink: BlockSink | None = None

    def __post_init__(self) -> None:
        for word in self.only:
            if word not in KINDS:
                raise ConfigError(f"unknown kind of frame {word!r}, allowed are {', '.join(KINDS)}")
        if self.files is not None and self.files < 1:
            raise ConfigError(f"a ring of {self.files} files holds nothing; give 1 or more")

    @property
    def ring(self) -> tuple[int | None, int | None]:
        """Octets of a file and files kept; both None for one unlimited file."""
        if self.size is None and self.files is None:
            return None, None
        return self.size or DEFAULT_SIZE, self.files or DEFAULT_FILES

    def chosen(self, names: Sequence[str]) -> list[int]:
        """Indexes of the captured drives; raises :class:`ConfigError` for a glob that matches no drive."""
        for glob in self.drives:
            if not any(fnmatchcase(name, glob) for name in names):
                raise ConfigError(f"no drive of the farm is called {glob!r}; `pnfarm validate` lists them")
        return [
            place
            for place, name in enumerate(names)
            if not self.drives or any(fnmatchcase(name, glob) for glob in self.drives)
        ]


class FarmCapture:
    """Made before the farm's interfaces, so that a file that cannot be written is reported before the drives send.

    ``note`` is called in the capture's thread.  Raises what :class:`CaptureSettings` and
    :class:`~pnfarm.links.capture.files.CaptureFiles` raise.
    """

    def __init__(self, settings: CaptureSettings, farm: str, names: Sequence[str], note: Note) -> None:
        self.settings = settings
        self._names = list(names)
        self._places = settings.chosen(names)
        self._note = note
        size, files = settings.ring
        kinds = f", only {' '.join(settings.only)}" if settings.only else ""
        head = section_header(f"pnfarm farm {farm}{kinds}")
        self._files: BlockSink
        if settings.sink is not None:
            self._files = settings.sink
            self._files.extend_head(head)
        else:
            self._files = CaptureFiles(settings.path, head, size=size, files=files)
        self._files.tail = self._tail
        #: Interface numbers of ports on lines, and their telegrams on their way to the thread.
        self._line_numbers: dict[int, int] = {}
        self._telegrams: deque[tuple[int, bytes]] = deque()
        self._telegrams_lost = 0
        self._epoch_ns = time.time_ns() - time.monotonic_ns()
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        #: Frames written of each captured drive; the last element: invalid frames of the kernel's ring.
        self._counts = np.zeros(len(self._places) + 1, np.int64)
        #: Frames that the kernel dropped because the writer did not keep up.
        self.lost = 0
        #: Why the capture ended early.
        self.failed: EnvironmentError_ | None = None

    @property
    def frames(self) -> int:
        """Frames written."""
        return int(self._counts[:-1].sum())

    @property
    def path(self) -> Path:
        """The file that is being written, or was last."""
        return self._files.current

    def start(self, ports: Sequence[Port], *, far_end: bool = False) -> None:
        """Capture the chosen ``ports``, which are in the order of the names given before.

        ``far_end``: the interfaces are the other ends of the drives' cables, as with a TAP.
        Raises :class:`~pnfarm.errors.EnvironmentError_`.
        """
        if self._thread is not None:
            raise InternalError("this capture runs already")
        chosen = [ports[place] for place in self._places]
        self._files.extend_head(
            b"".join(
                interface_description(self._names[place], _where(port), port.mac, link_type=port.link_type)
                for place, port in zip(self._places, chosen, strict=True)
            )
        )
        places = {port.index: number for number, port in enumerate(chosen) if port.index < FIRST_PORT}
        # words of --pcap-only are about frames of a network
        if not self.settings.only:
            self._line_numbers = {port.index: n for n, port in enumerate(chosen) if port.index >= FIRST_PORT}
        lowest = min(places, default=0)
        numbers = np.full(max(places, default=0) - lowest + 1, -1, np.int32)
        for index, number in places.items():
            numbers[index - lowest] = number
        atoms = atoms_of(self.settings.only)
        ring = PacketRing(capture_filter(list(places), atoms, others=far_end)) if places else None
        self._thread = threading.Thread(
            target=self._run, args=(ring, numbers, lowest, far_end), name="capture", daemon=True
        )
        self._thread.start()

    def telegram(self, index: int, octets: bytes, now: int, direction: Direction) -> None:
        """Write a telegram of a line, seen by the event loop at ``now`` of the monotonic clock."""
        number = self._line_numbers.get(index)
        if number is None or self._stop.is_set():
            return
        if len(self._telegrams) >= MOST_TELEGRAMS:
            self._telegrams_lost += 1
            return
        self._telegrams.append((number, packet_block(number, octets, now + self._epoch_ns, direction)))

    def stop(self) -> None:
        """Write what has been captured and close the file.  Takes some tenths of a second; may be called twice."""
        if self._thread is None:
            self._files.abandon()
            return
        self._stop.set()
        self._thread.join()
        self._thread = None

    # -- the thread --------------------------------------------------------------------------------------------------

    def _run(self, ring: PacketRing | None, numbers: Any, lowest: int, far_end: bool) -> None:
        # it yields to the event loop's thread and to the engine's, and preempts neither when frames wake it
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
        try:
            if ring is None:
                self._record_lines()
            else:
                self._record(ring, numbers, lowest, far_end)
            self._write_telegrams()
            self._files.close()
        except EnvironmentError_ as exc:
            self.failed = exc
            self._files.abandon()
        except Exception as exc:  # noqa: BLE001 - the farm continues without its capture, and logs the reason
            self.failed = EnvironmentError_(f"the capture failed: {type(exc).__name__}: {exc}")
            self._files.abandon()
        finally:
            if ring is not None:
                ring.close()
        result = str(self.path), self.frames, self.lost
        self._note(CaptureEnded(*result) if self.failed is None else CaptureFailed(*result, str(self.failed)))

    def _record_lines(self) -> None:
        """Of a farm without a network."""
        while not self._stop.wait(LOOK_MS / 1000):
            self._write_telegrams()

    def _write_telegrams(self) -> None:
        """What the event loop left; telegrams of a line are up to a check later in the file than their time says."""
        blocks = []
        for _ in range(len(self._telegrams)):
            number, block = self._telegrams.popleft()
            self._counts[number] += 1
            blocks.append(block)
            if len(blocks) >= BLOCKS_AT_ONCE:
                self._files.write(b"".join(blocks))
                blocks.clear()
        if blocks:
            self._files.write(b"".join(blocks))
        lost, self._telegrams_lost = self._telegrams_lost, 0
        self.lost += lost

    def _record(self, ring: PacketRing, numbers: Any, lowest: int, far_end: bool) -> None:
        memory = np.frombuffer(ring.memory, np.uint8)
        words = memory.view(np.int32)
        out = np.zeros(BLOCK * ROOM_FACTOR, np.uint8)
        out_words, view = out.view(np.uint32), memoryview(out.data)
        try:
            told_lost, told_at = 0, time.monotonic()
            end: float | None = None
            while end is None or time.monotonic() < end:
                ring.wait(LOOK_MS if end is None else RETIRE_MS)
                for start in ring.take():
                    length = pack_block(memory, words, start, numbers, lowest, far_end, out, out_words, self._counts)
                    if length:
                        self._files.write(view[:length])
                self._write_telegrams()
                self.lost += ring.lost()
                if self.lost > told_lost and time.monotonic() - told_at >= TELL_SECONDS:
                    self._note(CaptureLostFrames(self.lost - told_lost))
                    told_lost, told_at = self.lost, time.monotonic()
                if end is None and self._stop.is_set():
                    # frames received until now are handed over when their block retires
                    end = time.monotonic() + 3 * RETIRE_MS / 1000
        finally:
            del memory, words

    def _tail(self) -> bytes:
        """Statistics; the kernel's losses, counted for all interfaces together, are given with the first one."""
        now = time.time_ns()
        return b"".join(
            interface_statistics(
                number, now, written=int(self._counts[number]), lost=self.lost if number == 0 else None
            )
            for number in range(len(self._places))
        )


def _where(port: Port) -> str:
    return f"interface {port.name}" if port.index < FIRST_PORT else f"on a line of {port.baud} bit/s"


def prepare() -> None:
    """Compile what a capture needs, before the drives send."""
    none = np.zeros(64, np.uint8)
    out = np.zeros(64, np.uint8)
    numbers, counts = np.zeros(0, np.int32), np.zeros(1, np.int64)
    pack_block(none, none.view(np.int32), 0, numbers, 0, False, out, out.view(np.uint32), counts)
