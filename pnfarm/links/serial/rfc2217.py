"""A line over a serial port behind RFC 2217 (a terminal server), through pyserial.

pyserial's calls wait, so that two threads make them: one connects and reads, one writes what a bounded queue
holds.  Octets come to the event loop by its thread-safe call.  Slower than the other ways: for ports that only such a
server has.
"""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
import time
from typing import TYPE_CHECKING, Any

from pnfarm.errors import InternalError
from pnfarm.links.serial.descriptor import MOST_WAITING, PARITY, import_serial
from pnfarm.links.serial.line import LineCounters
from pnfarm.vocabulary.endpoints import host_port

if TYPE_CHECKING:
    from pnfarm.links.serial.line import AtOnce, LineNews, LineReceiver

__all__ = ["Rfc2217Line"]

#: How long a thread waits in one call, so that it notices the end.
_LOOK_SECONDS = 0.05
_FIRST_PAUSE_SECONDS = 0.1
_LAST_PAUSE_SECONDS = 2.0


class Rfc2217Line:
    """See :class:`pnfarm.links.serial.line.Line`."""

    kind = "rfc2217"

    def __init__(self, host: str, port: int, baud: int) -> None:
        self._peer = host_port(host, port)
        self._baud = baud
        self._counters = LineCounters()
        self._receiver: LineReceiver | None = None
        self._news: LineNews | None = None
        self._told: tuple[bool, str] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._threads: list[threading.Thread] = []
        self._ended = threading.Event()
        self._port: Any = None
        self._out: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        #: Octets in the queue; the event loop adds, the writing thread takes away.
        self._waiting = 0
        self._lock = threading.Lock()

    @property
    def where(self) -> str:
        return self._peer

    @property
    def baud(self) -> int | None:
        return self._baud

    @property
    def has_rate(self) -> bool:
        """The port behind the server has one; what the network takes is more than any time of the standard."""
        return False

    @property
    def counters(self) -> LineCounters:
        return self._counters

    @property
    def is_up(self) -> bool:
        """Whether the server is connected."""
        return self._port is not None

    async def open(self) -> None:
        if self._loop is not None:
            raise InternalError("this rfc2217 line is already open")
        serial = import_serial(f"the line at {self._peer}")
        self._loop = asyncio.get_running_loop()
        self._threads = [
            threading.Thread(target=self._read, args=(serial,), name="pnfarm-rfc2217-in", daemon=True),
            threading.Thread(target=self._write, name="pnfarm-rfc2217-out", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    async def close(self) -> None:
        self._news = None
        self._ended.set()
        threads, self._threads = self._threads, []
        for thread in threads:
            await asyncio.to_thread(thread.join)
        self._loop = None

    def send(self, octets: bytes | memoryview) -> None:
        if self._port is None:
            self._counters.lost["not-open"] += len(octets)
            return
        with self._lock:
            fits = self._waiting + len(octets) <= MOST_WAITING
            self._waiting += len(octets) if fits else 0
        if fits:
            self._out.put(bytes(octets))
        else:
            self._counters.lost["queue-full"] += len(octets)

    def set_receiver(self, receiver: LineReceiver) -> None:
        self._receiver = receiver

    def set_at_once(self, at_once: AtOnce) -> None:
        """What comes over its thread has a turn of the event loop for itself."""

    def set_news(self, news: LineNews) -> None:
        self._news = news
        if self._told is not None:
            news(*self._told)

    def set_baud(self, baud: int) -> None:
        """Another rate: the port is opened again with it."""
        self._baud = baud

    # -- in the event loop

    def _post(self, action: Any, *values: Any) -> None:
        loop = self._loop
        if loop is not None:
            with contextlib.suppress(RuntimeError):  # the loop is closed: no listener is left
                loop.call_soon_threadsafe(action, *values)

    def _came(self, octets: bytes) -> None:
        self._counters.received += len(octets)
        if self._receiver is not None:
            self._receiver(octets, time.monotonic_ns())

    def _tell(self, up: bool, text: str, reason: str = "") -> None:
        if up:
            self._counters.opened += 1
        elif reason:
            self._counters.interruptions[reason] += 1
        if self._news is not None and self._told != (up, text):
            self._news(up, text)
        self._told = (up, text)

    # -- in the threads

    def _read(self, serial: Any) -> None:
        pause = _FIRST_PAUSE_SECONDS
        while not self._ended.is_set():
            baud = self._baud
            try:
                port = serial.serial_for_url(
                    f"rfc2217://{self._peer}",
                    baud,
                    parity=PARITY,
                    timeout=_LOOK_SECONDS,
                )
            except (OSError, ValueError, TypeError, AttributeError) as exc:
                self._post(self._tell, False, f"{self._peer} cannot be opened: {exc}", "no-connection")
                self._ended.wait(pause)
                pause = min(2 * pause, _LAST_PAUSE_SECONDS)
                continue
            pause = _FIRST_PAUSE_SECONDS
            self._port = port
            self._post(self._tell, True, self._peer)
            try:
                while not self._ended.is_set() and self._baud == baud:
                    octets = port.read(max(1, port.in_waiting))
                    if octets:
                        self._post(self._came, octets)
            except (OSError, TypeError, AttributeError) as exc:
                # pyserial's own thread takes the socket away when the server has gone
                self._post(self._tell, False, f"{self._peer}: the far end is closed ({exc})", "far-end-closed")
            finally:
                self._port = None
                with contextlib.suppress(OSError, TypeError, AttributeError):
                    port.close()

    def _write(self) -> None:
        while not self._ended.is_set():
            try:
                octets = self._out.get(timeout=_LOOK_SECONDS)
            except queue.Empty:
                continue
            with self._lock:
                self._waiting -= len(octets)
            port, reason = self._port, "not-open"
            if port is not None:
                try:
                    port.write(octets)
                except (OSError, TypeError, AttributeError):
                    reason = "cut-off"
                else:
                    self._post(self._left, len(octets))
                    continue
            self._post(self._lost, reason, len(octets))

    def _left(self, count: int) -> None:
        self._counters.sent += count

    def _lost(self, reason: str, count: int) -> None:
        self._counters.lost[reason] += count
