"""Lines over file descriptors: a pty that the farm makes, a serial port; TCP is in :mod:`pnfarm.links.serial.tcp`.

All are read in the event loop and written at once, in the call that wants to send.  A far end that does not
read fills a bounded queue, and what comes on top is lost and counted.  A far end that goes away (a closed pty, an
adapter pulled out, a TCP peer gone) is counted, and the way is tried again with growing pauses; the farm runs on.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import hashlib
import os
import socket
import termios
import time
import tty
from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.links.serial.eager_loop import EagerLoop
from pnfarm.links.serial.line import LineCounters

if TYPE_CHECKING:
    from pnfarm.links.serial.line import AtOnce, LineNews, LineReceiver

__all__ = [
    "MOST_WAITING",
    "PARITY",
    "FdLine",
    "PortLine",
    "PtyLine",
    "import_serial",
    "is_pty",
    "open_port",
]

#: Octets that wait for a far end that does not read: some telegrams, so that it does not read old ones for long.
MOST_WAITING = 4096
_READ = 4096
#: Reads in one call of the event loop at most, so that a flood does not keep it.
_READS = 16
#: Pauses between two tries of a way that broke.
_FIRST_PAUSE_SECONDS = 0.005
_LAST_PAUSE_SECONDS = 1.0
#: A pty's far end is a process of this machine, which may open it again at any time: looking costs one call.
_LAST_PTY_PAUSE_SECONDS = 0.02

#: Place of the control characters in what termios.tcgetattr returns.
_CONTROL_CHARACTERS = 6
#: Of each octet, with one stop bit: PROFIBUS has no other form; in pyserial's word.
PARITY = "E"


class FdLine(ABC):
    """What all have in common: reading, writing, losing and trying again."""

    kind: str
    has_rate = False
    last_pause = _LAST_PAUSE_SECONDS

    def __init__(self, *, baud: int | None = None) -> None:
        self._baud = baud
        self._counters = LineCounters()
        self._receiver: LineReceiver | None = None
        self._at_once: AtOnce | None = None
        #: Octets that were read and are still to be given to the receiver.
        self._kept = b""
        self._came: Any = np.zeros(_READ, np.uint8)
        self._news: LineNews | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._fd: int | None = None
        self._queue = bytearray()
        self._pause = _FIRST_PAUSE_SECONDS
        self._attached = 0.0
        self._again: asyncio.TimerHandle | None = None
        #: The last news, so that a way that stays broken is reported once.
        self._told: tuple[bool, str] | None = None

    @property
    def where(self) -> str:
        raise NotImplementedError

    @property
    def baud(self) -> int | None:
        return self._baud

    @property
    def counters(self) -> LineCounters:
        return self._counters

    @property
    def is_up(self) -> bool:
        """Whether the far end is connected."""
        return self._fd is not None

    def set_receiver(self, receiver: LineReceiver) -> None:
        self._receiver = receiver

    def set_at_once(self, at_once: AtOnce) -> None:
        self._at_once = at_once

    def set_news(self, news: LineNews) -> None:
        self._news = news

    def set_baud(self, baud: int) -> None:
        """A pty and TCP have no rate: nothing happens."""
        del baud

    async def open(self) -> None:
        if self._loop is not None:
            raise InternalError(f"this {self.kind} line is already open")
        self._loop = asyncio.get_running_loop()
        try:
            await self._begin()
        except BaseException:
            await self.close()
            raise

    async def close(self) -> None:
        if self._again is not None:
            self._again.cancel()
            self._again = None
        self._news = None
        self._detach()
        self._loop = None
        await self._end()

    # -- what a way does itself

    @abstractmethod
    async def _begin(self) -> None:
        """Take the way: :meth:`_attach` or :meth:`_broken` follows, now or later."""

    @abstractmethod
    async def _end(self) -> None:
        """Give everything back."""

    @abstractmethod
    def _try(self) -> None:
        """Try again, after a pause: calls :meth:`_attach` or :meth:`_broken`."""

    @abstractmethod
    def _release(self) -> None:
        """The descriptor is no longer read: close it, if it is not kept."""

    # -- the descriptor

    def _attach(self, fd: int) -> None:
        """Octets go over this non-blocking descriptor from now on."""
        if self._loop is None:
            raise InternalError(f"this {self.kind} line is not open")
        self._fd = fd
        self._attached = self._loop.time()
        self._counters.opened += 1
        self._loop.add_reader(fd, self._readable)
        if isinstance(self._loop, EagerLoop):
            self._loop.set_eager(fd, self._eagerly)
        self._tell(True, self.where)

    def _detach(self) -> None:
        fd, self._fd = self._fd, None
        if fd is not None and self._loop is not None and not self._loop.is_closed():
            # a far end that hangs up at once is not tried faster than one that is not there
            if self._loop.time() - self._attached >= self.last_pause:
                self._pause = _FIRST_PAUSE_SECONDS
            self._loop.remove_reader(fd)
            self._loop.remove_writer(fd)
            if isinstance(self._loop, EagerLoop):
                self._loop.set_eager(fd, None)
        self._kept = b""
        if self._queue:
            self._counters.lost["cut-off"] += len(self._queue)
            self._queue.clear()
        self._release()

    def _broken(self, reason: str, text: str) -> None:
        """The way broke, or could not be taken: count it, and try again after a pause."""
        self._counters.interruptions[reason] += 1
        self._detach()
        self._tell(False, text)
        self._later()

    def _later(self) -> None:
        """Try again after a pause, which grows."""
        if self._loop is None:
            return
        if self._again is not None:
            self._again.cancel()
        self._again = self._loop.call_later(self._pause, self._try)
        self._pause = min(2 * self._pause, self.last_pause)

    def _tell(self, up: bool, text: str) -> None:
        if self._news is not None and self._told != (up, text):
            self._news(up, text)
        self._told = (up, text)

    def _eagerly(self) -> bool:
        """Read what came, and have it answered at once; what cannot be is left to :meth:`_readable`."""
        if self._at_once is None or self._fd is None or self._kept or self._queue:
            return False
        try:
            length = os.readv(self._fd, (self._came,))
        except OSError:
            # it is found, and reported, once more
            return False
        if not self._at_once(self._came, length, time.monotonic_ns()):
            self._kept = self._came[:length].tobytes()
            return False
        self._counters.received += length
        # an answer that waits, and a way that broke, are the event loop's
        return self._fd is not None and not self._queue

    def _readable(self) -> None:
        if kept := self._kept:
            self._kept = b""
            self._counters.received += len(kept)
            if self._receiver is not None:
                self._receiver(kept, time.monotonic_ns())
            if len(kept) < _READ:
                return
        for _ in range(_READS):
            if self._fd is None:
                return
            try:
                octets = os.read(self._fd, _READ)
            except (BlockingIOError, InterruptedError):
                return
            except OSError as exc:
                self._broken(*_reason(exc, self.where))
                return
            if not octets:
                self._broken("far-end-closed", f"{self.where}: the far end is closed")
                return
            self._counters.received += len(octets)
            if self._receiver is not None:
                self._receiver(octets, time.monotonic_ns())
            if len(octets) < _READ:
                return

    def send(self, octets: bytes | memoryview) -> None:
        counters = self._counters
        if self._fd is None:
            counters.lost["not-open"] += len(octets)
            return
        written = 0
        if not self._queue:
            try:
                written = os.write(self._fd, octets)
            except (BlockingIOError, InterruptedError):
                written = 0
            except OSError as exc:
                counters.lost["cut-off"] += len(octets)
                self._broken(*_reason(exc, self.where))
                return
            counters.sent += written
        if written == len(octets):
            return
        rest = octets[written:]
        if len(self._queue) + len(rest) > MOST_WAITING:
            counters.lost["queue-full"] += len(rest)
            return
        if not self._queue and self._loop is not None:
            self._loop.add_writer(self._fd, self._writable)
        self._queue += rest

    def _writable(self) -> None:
        if self._fd is None:
            return
        try:
            written = os.write(self._fd, self._queue)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as exc:
            self._broken(*_reason(exc, self.where))
            return
        self._counters.sent += written
        del self._queue[:written]
        if not self._queue and self._loop is not None:
            self._loop.remove_writer(self._fd)


def _reason(exc: OSError, where: str) -> tuple[str, str]:
    """Slug and sentence of an error of the kernel's."""
    if exc.errno in {errno.EIO, errno.ECONNRESET, errno.EPIPE}:
        return "far-end-closed", f"{where}: the far end is closed"
    if exc.errno in {errno.ENXIO, errno.ENODEV, errno.ENOENT}:
        return "no-device", f"{where}: the device is gone"
    return "refused", f"{where}: {exc.strerror or exc}"


def _claimed(link: Path) -> socket.socket:
    """A name in the abstract namespace of Unix sockets, which only one holds.  Raises where another farm has it."""
    place = link.parent.resolve() / link.name
    found = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
    try:
        found.bind(b"\0pnfarm-line-" + hashlib.sha256(os.fsencode(place)).digest())
    except OSError as exc:
        found.close()
        if exc.errno == errno.EADDRINUSE:
            raise EnvironmentError_(f"another farm's line is at {link}: give this one another path") from exc
        raise EnvironmentError_(f"the link {link} cannot be claimed: {exc.strerror}") from exc
    return found


class PtyLine(FdLine):
    """A pair of pseudo terminals: the process that opens ``path`` is the far end.  ``link``: a symbolic link to it.

    A link that is there is replaced unless another farm of this network namespace has it now; anything else is not.  A
    pseudo terminal has neither a rate nor a parity; the C
    library refuses to set even parity on one, so that the far end opens it without.
    """

    kind = "pty"
    last_pause = _LAST_PTY_PAUSE_SECONDS

    def __init__(self, link: Path | None = None, *, baud: int | None = None) -> None:
        super().__init__(baud=baud)
        self._link = link
        self._master: int | None = None
        #: Held while the link is this line's; the kernel gives it back whatever ends the process.
        self._claim: socket.socket | None = None
        #: The far end's path, empty until the line is open.
        self.path = ""

    @property
    def where(self) -> str:
        if self._link is None or not self.path:
            return self.path or str(self._link or "a pty")
        return f"{self._link} -> {self.path}"

    async def _begin(self) -> None:
        try:
            self._master, far = os.openpty()
        except OSError as exc:
            raise EnvironmentError_(f"no pty can be made ({exc.strerror}): is /dev/pts mounted?") from exc
        try:
            tty.setraw(far)
            self.path = os.ttyname(far)
        finally:
            os.close(far)
        os.set_blocking(self._master, False)
        if self._link is not None:
            self._make_link(self._link)
        self._try()
        if not self.is_up:
            self._tell(False, f"{self.where}: waits for a client")

    def _make_link(self, link: Path) -> None:
        self._claim = _claimed(link)
        try:
            if link.is_symlink():
                link.unlink()
            link.symlink_to(self.path)
        except OSError as exc:
            raise EnvironmentError_(f"the link {link} to {self.path} cannot be made: {exc.strerror}") from exc

    async def _end(self) -> None:
        if self._master is not None:
            os.close(self._master)
            self._master = None
        link = self._link
        if link is not None and self.path:
            with contextlib.suppress(OSError):
                # another farm may have taken it
                if str(link.readlink()) == self.path:
                    link.unlink()
        if self._claim is not None:
            self._claim.close()
            self._claim = None

    def _release(self) -> None:
        """The pair stays; what the last one at the far end has not read is not for the next one."""
        if self._master is None or self._loop is None:
            return
        with contextlib.suppress(OSError, termios.error):
            # only the far end's own side flushes what is already in its queue
            far = os.open(self.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            try:
                termios.tcflush(far, termios.TCIFLUSH)
            finally:
                os.close(far)

    def _try(self) -> None:
        """The far end is open again once a read no longer fails; what it brings is taken at once."""
        if self._master is None or self._loop is None:
            return
        try:
            octets = os.read(self._master, _READ)
        except (BlockingIOError, InterruptedError):
            octets = b""
        except OSError:
            self._later()
            return
        self._attach(self._master)
        if octets:
            self._counters.received += len(octets)
            if self._receiver is not None:
                self._receiver(octets, time.monotonic_ns())


def is_pty(port: str) -> bool:
    """Whether a port is the far end of a pseudo terminal, which has neither a rate nor a parity."""
    return Path(port).resolve().parts[:3] == ("/", "dev", "pts")


def open_port(port: str, baud: int) -> Any:
    """A serial port through pyserial, raw and not blocking; raises :class:`EnvironmentError_` with one sentence."""
    serial = import_serial(f"serial port {port}")
    try:
        opened = serial.Serial(
            port,
            baud,
            parity="N" if is_pty(port) else PARITY,
            timeout=0,
            write_timeout=0,
            exclusive=True,
        )
    except (OSError, ValueError, termios.error) as exc:
        # pyserial lets some errors of termios through, which are no OSError
        raise EnvironmentError_(_why_not(port, baud, exc)) from exc
    _mark_empty_reads(opened)
    # the driver of an adapter may not have it: it answers later then, and `pnfarm doctor` measures how late
    with contextlib.suppress(OSError, ValueError, NotImplementedError, AttributeError):
        opened.set_low_latency_mode(True)
    return opened


def _mark_empty_reads(opened: Any) -> None:
    """A read without octets is an error from now on.

    pyserial asks for one that returns nothing, which is how a closed far end looks.
    """
    with contextlib.suppress(OSError, termios.error, AttributeError):
        attributes = termios.tcgetattr(opened.fileno())
        attributes[_CONTROL_CHARACTERS][termios.VMIN] = 1
        termios.tcsetattr(opened.fileno(), termios.TCSANOW, attributes)


def import_serial(what: str) -> Any:
    """pyserial; raises :class:`EnvironmentError_` where it is not installed."""
    try:
        import serial  # noqa: PLC0415 - needed by those who have a serial port
    except ImportError as exc:
        raise EnvironmentError_(f"{what} needs pyserial, which is not installed: `pip install pyserial`") from exc
    return serial


def _why_not(port: str, baud: int, exc: Exception) -> str:
    number = getattr(exc, "errno", None)
    if number == errno.ENOENT:
        return f"serial port {port} does not exist: `ls /dev/tty*` shows those that do"
    if number == errno.EACCES:
        return f"serial port {port} may not be opened: join the group of the device (`ls -l {port}`)"
    if number in {errno.EBUSY, errno.EAGAIN}:
        return f"serial port {port} is in use by another program"
    if not _is_terminal(port):
        return f"{port} is not a serial port"
    return f"serial port {port} cannot be set to {baud} baud ({exc}): its driver has other rates or no such parity"


def _is_terminal(port: str) -> bool:
    try:
        fd = os.open(port, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        return os.isatty(fd)
    finally:
        os.close(fd)


class PortLine(FdLine):
    """A serial port of this machine, such as an RS-485 adapter's, or a pseudo terminal's far end."""

    kind = "port"

    def __init__(self, port: str, baud: int) -> None:
        super().__init__(baud=baud)
        self.has_rate = not is_pty(port)
        self._port = port
        self._serial: Any = None

    @property
    def where(self) -> str:
        return self._port

    def set_baud(self, baud: int) -> None:
        """Another rate from now on; one that the driver refuses breaks the way."""
        self._baud = baud
        if self._serial is None:
            return
        try:
            self._serial.baudrate = baud
            _mark_empty_reads(self._serial)
        except (OSError, ValueError, termios.error) as exc:
            self._broken("refused", _why_not(self._port, baud, exc))

    async def _begin(self) -> None:
        self._serial = open_port(self._port, self._baud or 0)
        self._attach(self._serial.fileno())

    def _try(self) -> None:
        try:
            self._serial = open_port(self._port, self._baud or 0)
        except EnvironmentError_ as exc:
            self._broken("no-device", str(exc))
        else:
            self._attach(self._serial.fileno())

    def _release(self) -> None:
        serial, self._serial = self._serial, None
        if serial is not None:
            with contextlib.suppress(OSError):
                serial.close()

    async def _end(self) -> None:
        """Closed with the descriptor."""
