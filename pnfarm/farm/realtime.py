"""A node in real time: the engine's thread beside the event loop, and the only clock that the farm reads.

Three things wake the loop: a frame from the link, the engine's eventfd, and the earliest deadline of a protocol
machine.  All work is done in the callback at once; it is short and never waits.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
import time
from bisect import bisect_left
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.buses.node import LineNode, SocketNode
from pnfarm.engine import tick as engine_tick
from pnfarm.engine.channels.class1 import CLASS1_PORT
from pnfarm.engine.channels.delay_queue import sent_length, sent_port
from pnfarm.engine.columns import RX_BATCH
from pnfarm.engine.lateness import LOOP_LATE_NS, note_late
from pnfarm.engine.realtime import RealTimeEngine, RealTimeSettings
from pnfarm.engine.sockets.xdp import open_xdp
from pnfarm.errors import InternalError
from pnfarm.farm.lateness import StolenTime
from pnfarm.links.base import EngineLink, unwrap
from pnfarm.links.egress import egress_of
from pnfarm.links.joined import lines_of
from pnfarm.links.kernel.linux import PacketLink
from pnfarm.links.serial.carried import BY_TTY, CarriedOctets
from pnfarm.links.serial.link import SerialLink
from pnfarm.links.sockets import sockets_of
from pnfarm.links.tap import TapLink
from pnfarm.table.access.record_fields import field_views
from pnfarm.table.compiling.compiled import direct
from pnfarm.table.engine_row import LATENESS_EDGES_NS

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable
    from typing import TypeAlias

    from pnfarm.buses.node import Node
    from pnfarm.engine.lateness import LatenessRecord
    from pnfarm.engine.sockets.xdp import XdpSocket
    from pnfarm.links.serial.link import Poll, RepeatedPoll
    from pnfarm.wire.endpoint import SocketEvent

    #: Calls it, and ends the farm with its exception.
    Guard: TypeAlias = Callable[[Callable[[], None]], None]

__all__ = ["RealTimeDriver"]

next_due, next_step, tick = direct(engine_tick.next_due), direct(engine_tick.next_step), direct(engine_tick.tick)

#: How often the driver checks that the engine's thread still runs.
CHECK_SECONDS = 0.5
#: How often the delay of the event loop is read: a shorter one can pass between two beats.
BEAT_NS = 20_000_000
#: Beats from one reading of stolen time to the next: it is in files.
BEATS_TO_READ = 5


class RealTimeDriver:
    """Runs one node until :meth:`close`.  Exceptions of callbacks are raised by :meth:`wait`.

    ``lateness`` records how late the event loop is, and what time was stolen.  ``demoted`` is called with what the
    engine's thread lost because it had too much to do, and why.
    """

    def __init__(
        self,
        node: Node,
        settings: RealTimeSettings | None = None,
        *,
        lateness: LatenessRecord | None = None,
        demoted: Callable[[str, str], None] | None = None,
    ) -> None:
        self.node = node
        self._demoted = demoted
        self.settings = settings or RealTimeSettings()
        self._lateness = lateness
        self.engine: RealTimeEngine | None = None
        self._socket: socket.socket | None = None
        self._beside: socket.socket | None = None
        self._xdp_socket: socket.socket | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timer_due: int | None = None
        self._failed: asyncio.Future[None] | None = None
        self._in_loop: _LoopEngine | None = None
        self._heartbeat: _Heartbeat | None = None

    async def start(self) -> None:
        """Start the engine and receive frames.  The node's link is already open."""
        loop = asyncio.get_running_loop()
        self._failed = loop.create_future()
        link = unwrap(self.node.link)
        if isinstance(link, EngineLink):
            self._socket = link.engine_socket()
            self._beside = link.engine_datagrams(CLASS1_PORT) if isinstance(link, PacketLink) else None
            self.engine = RealTimeEngine(
                self.node.columns, self._socket, self.settings, beside=self._beside, xdp=self._open_xdp()
            )
            self.engine.start()
            loop.add_reader(self.engine.wake_fd, self._guard, self._woken)
        elif isinstance(link, (TapLink, SerialLink)):
            self._in_loop = _LoopEngine(self.node, link, self._guard)
            self._in_loop.start()
        else:
            raise InternalError(f"a {link.kind} link has no real time of its own")
        self.node.link.set_receiver(self._received)
        if isinstance(self.node, LineNode):
            for line in lines_of(self.node.link).values():
                line.set_poll(partial(self._polled, self.node.poll), partial(self._repeated, self.node.answer))
        sockets = sockets_of(self.node.link)
        if sockets is not None and isinstance(self.node, SocketNode):
            sockets.set_user(self._socket_event)
        if self._lateness is not None:
            thread = self.engine.thread_id if self.engine else threading.get_native_id()
            ttys = any(one.line.kind in BY_TTY for one in lines_of(self.node.link).values())
            self._heartbeat = _Heartbeat(self._lateness, thread, self._guard, ttys=ttys)
            self._heartbeat.start()
        self._guard(self._service)
        self._check(loop)

    def _open_xdp(self) -> XdpSocket | None:
        egress = egress_of(self.node.link)
        if egress is None or not egress.xdp_interface:
            return None
        xdp, self._xdp_socket = open_xdp(egress.xdp_interface, self.node.columns.ppm.shape[0])
        return xdp

    async def wait(self) -> None:
        """Wait until something fails; raises its exception."""
        if self._failed is None:
            raise InternalError("the driver was not started")
        await asyncio.shield(self._failed)

    async def close(self) -> None:
        """Stop the engine's thread; does nothing when none runs."""
        loop = asyncio.get_running_loop()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._heartbeat is not None:
            self._heartbeat.stop()
            self._heartbeat = None
        if self._in_loop is not None:
            self._in_loop.stop()
        if self.engine is not None:
            loop.remove_reader(self.engine.wake_fd)
            self.engine.close()
            self.engine = None
        for sock in (self._socket, self._beside, self._xdp_socket):
            if sock is not None:
                sock.close()
        self._socket = self._beside = self._xdp_socket = None
        if self._failed is not None and not self._failed.done():
            self._failed.cancel()

    def now(self) -> int:
        """The farm's time, ns: the machine's."""
        return time.monotonic_ns()

    def poke(self) -> None:
        """The node was changed from outside: process the consequences now."""
        self._guard(self._service)

    def fail(self, exc: Exception) -> None:
        """Something beside the node failed: :meth:`wait` raises it."""
        if self._failed is not None and not self._failed.done():
            self._failed.set_exception(exc)

    # -- callbacks ---------------------------------------------------------------------------------------------------

    def _guard(self, action: Callable[[], None]) -> None:
        try:
            action()
        except Exception as exc:  # noqa: BLE001 - carried to wait(), which ends the farm with it
            self.fail(exc)

    def _received(self, port: int, frame: bytes, now: int) -> None:
        try:
            self.node.receive(port, frame, now)
        except Exception as exc:  # noqa: BLE001 - as in _guard, without its call: a telegram or frame comes this way
            self.fail(exc)
        self._arm()

    def _polled(self, poll: Poll, octets: bytes, now: int) -> tuple[int, bytes] | None:
        try:
            return poll(octets, now)
        except Exception as exc:  # noqa: BLE001 - carried to wait(), which ends the farm with it
            self.fail(exc)
            return None

    def _repeated(self, answer: RepeatedPoll, octets: Any, length: int, now: int) -> tuple[int, memoryview] | None:
        try:
            return answer(octets, length, now)
        except Exception as exc:  # noqa: BLE001 - carried to wait(), which ends the farm with it
            self.fail(exc)
            return None

    def _socket_event(self, event: SocketEvent, now: int) -> None:
        if isinstance(self.node, SocketNode):
            node = self.node
            self._guard(lambda: node.socket_event(event, now))
            self._arm()

    def _woken(self) -> None:
        if self.engine is not None:
            with contextlib.suppress(BlockingIOError):
                os.eventfd_read(self.engine.wake_fd)
        self._service()

    def _service(self) -> None:
        self.node.service(time.monotonic_ns())
        self._arm()

    def _arm(self) -> None:
        due = self.node.next_deadline()
        if due == self._timer_due and self._timer is not None:
            return
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._timer_due = due
        if due is not None:
            delay = max(0.0, (due - time.monotonic_ns()) / 1e9)
            self._timer = asyncio.get_running_loop().call_later(delay, self._timed)

    def _timed(self) -> None:
        if self._heartbeat is not None and self._timer_due is not None:
            self._heartbeat.late(self._timer_due)
        self._timer = None
        self._timer_due = None
        self._guard(self._service)

    def _check(self, loop: asyncio.AbstractEventLoop) -> None:
        engine = self.engine
        if engine is not None:
            self._guard(engine.check)
            self._guard(partial(self._demote, engine))
            link = unwrap(self.node.link)
            if isinstance(link, PacketLink):
                self._guard(link.check)
            loop.call_later(CHECK_SECONDS, self._check, loop)

    def _demote(self, engine: RealTimeEngine) -> None:
        lost = engine.demote_if_overloaded()
        if lost is not None and self._demoted is not None:
            self._demoted(*lost)


class _Heartbeat:
    """Reads at intervals how late the event loop is, and also when asked how much time was stolen from the engine.

    With ``ttys``, also how late octets of serial lines are in the kernel.
    """

    def __init__(self, record: LatenessRecord, thread: int, guard: Guard, *, ttys: bool) -> None:
        self._record = record
        self._guard = guard
        self._stolen = StolenTime(thread)
        self._carried: CarriedOctets | None = None
        if ttys:
            # without a pty to try, as in a container without /dev/ptmx, nothing is known of the kernel's part
            with contextlib.suppress(OSError):
                self._carried = CarriedOctets(record.lines, time.monotonic_ns)
        self._beats = 0
        self._handle: asyncio.TimerHandle | None = None

    def start(self) -> None:
        self._record.sample = self._sample
        self._sample()
        self._arm()

    def stop(self) -> None:
        self._record.sample = None
        self._record.loop.due_ns = 0
        if self._carried is not None:
            self._carried.close()
        if self._handle is not None:
            self._handle.cancel()

    def late(self, due: int) -> None:
        """Something of the event loop that was due at ``due`` is being done now."""
        now = time.monotonic_ns()
        self._record.loop.note(now, now - due)

    def _sample(self) -> None:
        self._record.stolen(time.monotonic_ns(), self._stolen.total_ns())

    def _arm(self) -> None:
        self._record.loop.due_ns = time.monotonic_ns() + BEAT_NS
        self._handle = asyncio.get_running_loop().call_later(BEAT_NS / 1e9, self._guard, self._beat)

    def _beat(self) -> None:
        self.late(self._record.loop.due_ns)
        self._arm()
        self._beats += 1
        if self._carried is not None:
            self._carried.beat()
        if self._beats % BEATS_TO_READ == 0:
            self._sample()


class _LoopEngine:
    """Ticks in the event loop, for links without a packet socket: as exact as asyncio's timers.

    A serial line has no cyclic frames: what is polled is not the engine's.
    """

    def __init__(self, node: Node, link: TapLink | SerialLink, guard: Guard) -> None:
        self._node = node
        self._link = link
        self._guard = guard
        self._waiting = 0
        self._event_head, self._lease_until, self._muted, self._lateness, self._late_sum, self._late_most = field_views(
            node.columns.engine[0], "event_head", "lease_until_ns", "muted", "lateness", "lateness_sum_ns",
            "lateness_max_ns",
        )  # fmt: skip
        self._paced = not isinstance(link, TapLink)
        self._head = 0
        self._handle: asyncio.TimerHandle | None = None
        self._due = 0

    def start(self) -> None:
        if isinstance(self._link, TapLink):
            self._link.set_cyclic_receiver(self._received)
        self._head = self._event_head[0]
        self._handle = asyncio.get_running_loop().call_soon(lambda: self._guard(self._tick))  # type: ignore[assignment]  # a Handle is cancelled in the same way

    def stop(self) -> None:
        if self._handle is not None:
            self._handle.cancel()

    def _received(self, port: int, frame: bytes, now: int) -> None:
        columns = self._node.columns
        if self._waiting == RX_BATCH:
            self._advance(now)
        slot = self._waiting
        length = min(len(frame), columns.rx_frames.shape[1])
        columns.rx_frames[slot, :length] = memoryview(frame)[:length]
        columns.rx_length[slot] = len(frame)
        columns.rx_port[slot] = port
        columns.rx_ns[slot] = now
        self._waiting += 1

    def _advance(self, now: int) -> None:
        columns = self._node.columns
        count, self._waiting = self._waiting, 0
        sent = tick(columns, count, now)
        if self._lease_until[0] and time.clock_gettime_ns(time.CLOCK_BOOTTIME) >= self._lease_until[0]:
            self._muted[0] += sent
            return
        for i in range(sent):
            row = int(columns.tx_row[i])
            length, port = (told(columns.ppm, columns.held, row) for told in (sent_length, sent_port))
            self._link.send(int(port), columns.frames[row, : int(length)].tobytes())

    def _tick(self) -> None:
        now = time.monotonic_ns()
        if self._due:
            late = max(0, now - self._due)
            self._lateness[bisect_left(LATENESS_EDGES_NS, late)] += 1
            self._late_sum[0] += late
            self._late_most[0] = max(self._late_most[0], late)
            if late > LOOP_LATE_NS:
                note_late(self._node.columns.engine[0], self._node.columns.late, self._due, now, 0)
        self._advance(now)
        if self._event_head[0] != self._head:
            self._head = self._event_head[0]
            self._node.service(now)
        if self._paced:
            # nothing is sent by the engine
            self._due = int(next_step(self._node.columns, now))
        else:
            self._due = int(next_due(self._node.columns, now))
        delay = max(0.0, (self._due - time.monotonic_ns()) / 1e9)
        self._handle = asyncio.get_running_loop().call_later(delay, lambda: self._guard(self._tick))
