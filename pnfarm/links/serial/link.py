"""A serial line as a link: each station has a port of it, a frame is a telegram, and all share the octets.

What comes is split into telegrams once, and given to those that it concerns; what one sends leaves at once.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.errors import InternalError
from pnfarm.links.base import LinkCounters, Port
from pnfarm.links.serial.eager_loop import EagerLoop
from pnfarm.links.serial.line import ReplyTimes

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Callable, Collection, Sequence

    from pnfarm.links.base import PortSpec, Receiver
    from pnfarm.links.serial.line import Line, LineCounters
    from pnfarm.wire.direction import Direction

    #: ``watcher(port_index, telegram, now_ns, direction)``.
    Watcher = Callable[[int, bytes, int, Direction], None]
    #: ``poll(octets, now_ns)``: port and answer of the station that is polled, None where nothing was done.
    Poll = Callable[[bytes, int], tuple[int, bytes] | None]
    #: ``answer(octets, length, now_ns)``: of an array's first octets; the next answer overwrites it.
    RepeatedPoll = Callable[[Any, int, int], tuple[int, memoryview] | None]
    #: ``news(where, count, latest_ns)``: so many answers were withheld by now.
    WithheldNews = Callable[[str, int, int], None]

__all__ = ["FIRST_PORT", "SerialLink", "Splitter"]

#: Ports of lines have numbers that no interface of the kernel has.
FIRST_PORT = 0x0100_0000


#: Start, eight of data, parity and stop.
OCTET_BITS = 11
#: How long each rate is tried.
SEARCH_SECONDS = 0.5
#: Up to this an answer waits where it is; the timers of the event loop are good to a millisecond.
_SHORT_WAIT_NS = 200_000


class Splitter(Protocol):
    """From the octets of a serial line to what its stations receive: whole telegrams."""

    @property
    def dropped(self) -> Counter[str]:
        """What was none, by reason."""

    @property
    def is_whole(self) -> bool:
        """Whether nothing incomplete waits for its rest."""

    def split(self, octets: bytes, now: int) -> list[bytes]:
        """The telegrams that are whole now."""

    def next_deadline(self) -> int | None:
        """When an incomplete telegram is given up."""

    def handle_timeout(self, now: int) -> list[bytes]:
        """Give it up; telegrams that it hid."""


class SerialLink:
    """A :class:`~pnfarm.links.base.Link` over ``line``; its stations get ``baud``.

    ``search``: rates that are tried in turn while octets come and no telegram is among them.
    ``latest_ns``: how late a slave's answer may begin at a rate, ns; None for a rate without such a limit.
    """

    kind = "serial"

    def __init__(
        self,
        line: Line,
        splitter: Splitter,
        baud: int,
        search: Sequence[int] = (),
        latest_ns: Callable[[int], int | None] | None = None,
    ) -> None:
        self.line = line
        self._limit = latest_ns
        self._search = list(search)
        self._look: asyncio.TimerHandle | None = None
        #: Octets and telegrams at the last check.
        self._seen = (0, 0)
        self._set_baud(baud)
        self.splitter = splitter
        self._counters = LinkCounters()
        #: From octets that came to the telegram that was sent next.
        self.replies = ReplyTimes()
        #: Answers that would have begun too late, and were not given.
        self.withheld = 0
        self._withheld_news: WithheldNews | None = None
        self._heard_ns = 0
        #: When what is being answered came, at the earliest; 0 while nothing is.
        self._came_ns = 0
        #: How long the octets that came last take at the line's rate, where the line itself takes no time for them.
        self._octets_ns = 0
        #: More came after what is being answered: its master has given it up.
        self._is_passed = False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._receiver: Receiver | None = None
        self._audience: Callable[[bytes], Collection[int] | None] | None = None
        self._watcher: Watcher | None = None
        self._poll: Poll | None = None
        self._answer: RepeatedPoll | None = None
        self._least_bits: Callable[[int], int] | None = None
        self._is_slave = False
        #: Answers that would begin too soon: port, telegram, and when its request came.
        self._held: deque[tuple[int, bytes, int]] = deque()
        self._hold: asyncio.TimerHandle | None = None
        self._ports: dict[int, Port] = {}
        self._pulled: set[int] = set()
        self._timer: asyncio.TimerHandle | None = None
        line.set_receiver(self._received)
        line.set_at_once(self._at_once)

    @property
    def counters(self) -> LinkCounters:
        return self._counters

    # -- see :class:`pnfarm.links.serial.line.LineTally`

    @property
    def way(self) -> str:
        return self.line.kind

    @property
    def where(self) -> str:
        return self.line.where

    @property
    def is_up(self) -> bool:
        return self.line.is_up

    @property
    def octets(self) -> LineCounters:
        return self.line.counters

    @property
    def telegrams(self) -> tuple[int, int]:
        return self._counters.received, self._counters.sent

    @property
    def dropped(self) -> Counter[str]:
        return self.splitter.dropped

    # -- the link

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        if self._ports:
            raise InternalError("this serial link is already open")
        self._loop = asyncio.get_running_loop()
        await self.line.open()
        ports = [
            Port(spec.station, FIRST_PORT + index, b"", self.baud, spec.link_type, self._rate)
            for index, spec in enumerate(wanted)
        ]
        self._look_later()
        self._ports = {port.index: port for port in ports}
        return ports

    def _rate(self) -> int:
        return self.baud

    def _look_later(self) -> None:
        if self._search:
            self._look = asyncio.get_running_loop().call_later(SEARCH_SECONDS, self._looked)

    def _looked(self) -> None:
        """Another rate, where octets came since the last check and none of them made a telegram."""
        seen = self.line.counters.received, self._counters.received
        octets, telegrams = (now - before for now, before in zip(seen, self._seen, strict=True))
        self._seen = seen
        if octets and not telegrams:
            tried = self._search.index(self.baud) if self.baud in self._search else -1
            self._set_baud(self._search[(tried + 1) % len(self._search)])
            self._ask_for_age()
            self.line.set_baud(self.baud)
        self._look_later()

    async def close(self) -> None:
        if self._look is not None:
            self._look.cancel()
            self._look = None
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._hold is not None:
            self._hold.cancel()
            self._hold = None
        self._held.clear()
        self._loop = None
        self._ports = {}
        await self.line.close()

    def send(self, port_index: int, frame: bytes | memoryview) -> None:
        if port_index not in self._ports:
            self._counters.dropped["unknown-port"] += 1
        elif port_index in self._pulled:
            self._counters.dropped["cable-pulled"] += 1
        else:
            if self._came_ns and self._is_slave and self._is_passed and self.latest_ns is not None:
                self._withhold()
                return
            if self._least_bits is not None and self._too_soon(port_index, frame, self._least_bits(port_index)):
                return
            self._send(port_index, frame, self._came_ns)

    def _send(self, port_index: int, frame: bytes | memoryview, came_ns: int) -> None:
        if came_ns and self._is_slave and self._too_late(came_ns):
            self._withhold()
            return
        self._counters.sent += 1
        self.line.send(frame)
        if self._heard_ns:
            took, self._heard_ns = max(0, time.monotonic_ns() - (came_ns or self._heard_ns)), 0
            self.replies.add(took)
        if self._watcher is not None:
            self._watcher(port_index, bytes(frame), time.monotonic_ns(), "out")

    def _too_late(self, came_ns: int) -> bool:
        """Whether an answer must not begin any more: its master may be sending again by now (max T_SDR).

        It counts from the request's end.  A pseudo terminal has all of a request when its master would have begun
        to send it.  What a fault delays is no answer that this machine made late: it is sent.
        """
        return self.latest_ns is not None and time.monotonic_ns() - came_ns - self._octets_ns > self.latest_ns

    def _set_baud(self, baud: int) -> None:
        self.baud = baud
        #: How late an answer may begin, None: any time.
        self.latest_ns = None if self._limit is None else self._limit(baud)
        self._octet_ns = 0 if self.line.has_rate else OCTET_BITS * 1_000_000_000 // baud

    def _ask_for_age(self) -> None:
        """A limit counts from when a request came, not from when the event loop had time to read it."""
        if self._is_slave and self.latest_ns is not None and isinstance(self._loop, EagerLoop):
            self._loop.ask_for_age()

    def _withhold(self) -> None:
        self.withheld += 1
        self._heard_ns = 0
        # a line that is always late must not fill the log
        if self._withheld_news is not None and self.withheld & (self.withheld - 1) == 0:
            self._wake(self._withheld_news, self.where, self.withheld, self.latest_ns or 0)

    def _too_soon(self, port_index: int, frame: bytes | memoryview, bits: int) -> bool:
        """Whether an answer must not begin yet: it leaves then when it may (4.7.1, min T_SDR)."""
        if self._held:
            # what one line sends stays in order
            self._held.append((port_index, bytes(frame), self._came_ns))
            return True
        left = self._heard_ns + bits * 1_000_000_000 // self.baud - time.monotonic_ns() if self._heard_ns else 0
        if left <= 0:
            return False
        if left < _SHORT_WAIT_NS:
            # the event loop's timers are coarser than that
            time.sleep(left / 1e9)
            return False
        self._held.append((port_index, bytes(frame), self._came_ns))
        self._wake(self._hold_for, left / 1e9)
        return True

    def _wake(self, action: Callable[..., None], *values: object) -> None:
        """Have something done in the event loop's next turn, also where this is called while it waits."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(action, *values)

    def _hold_for(self, seconds: float) -> None:
        if self._loop is not None and self._held:
            self._hold = self._loop.call_later(seconds, self._release)

    def _release(self) -> None:
        self._hold = None
        while self._held:
            self._send(*self._held.popleft())

    def set_receiver(self, receiver: Receiver) -> None:
        self._receiver = receiver

    def set_poll(self, poll: Poll, answer: RepeatedPoll) -> None:
        """Set the fast paths of polls: whoever answers most telegrams at once, without splitting and handing on.

        ``answer`` is asked first, where the event loop has a way to do so before its next turn.
        """
        self._poll, self._answer = poll, answer

    def set_slaves(self, least_bits: Callable[[int], int]) -> None:
        """The ports are slaves from now on: what they send while they hear a telegram is an answer, due in time.

        ``least_bits``: how many bit times a port lets pass before one, where the line has a rate of its own.
        """
        self._is_slave = True
        self._ask_for_age()
        self._least_bits = least_bits if self.line.has_rate else None

    def set_withheld_news(self, news: WithheldNews) -> None:
        """Set what is called for withheld answers: of the first, and whenever there are twice as many."""
        self._withheld_news = news

    def set_watcher(self, watcher: Watcher | None) -> None:
        """Set who sees each telegram that a port receives or sends."""
        self._watcher = watcher

    def set_line_audience(self, audience: Callable[[bytes], Collection[int] | None]) -> None:
        """Set which ports a telegram can concern (None: all): the others get no copy."""
        self._audience = audience

    async def set_carrier(self, port_index: int, up: bool) -> None:
        """The plug of one station: the line goes on for the others."""
        if up:
            self._pulled.discard(port_index)
        else:
            self._pulled.add(port_index)

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        """A line has no hardware addresses."""

    def _received(self, octets: bytes, now: int) -> None:
        if self._polled(octets, now):
            return
        self._hear(now, len(octets))
        try:
            self._deliver(self.splitter.split(octets, now), now)
            self._arm()
        finally:
            self._came_ns = 0

    def _hear(self, now: int, octets: int) -> None:
        self._heard_ns = now
        self._octets_ns = octets * self._octet_ns
        loop = self._loop
        self._came_ns = min(now, loop.earliest_ns) if isinstance(loop, EagerLoop) else now
        self._is_passed = False

    def _at_once(self, octets: Any, length: int, now: int) -> bool:
        """A poll that is like the one before; False, and nothing done, for all else."""
        if self._answer is None or self._watcher is not None or self._pulled or not self.splitter.is_whole:
            return False
        found = self._answer(octets, length, now)
        if found is None:
            return False
        if self.latest_ns is not None or self._least_bits is not None:
            self._give(*found, now, length)
            return True
        # nothing else is to be checked: thousands of times a second, each call counts
        self._counters.received += 1
        self._counters.sent += 1
        self.line.send(found[1])
        self.replies.add(time.monotonic_ns() - now)
        return True

    def _polled(self, octets: bytes, now: int) -> bool:
        """The fast path of a poll; False, and nothing done, for all else."""
        if self._poll is None or self._watcher is not None or self._pulled or not self.splitter.is_whole:
            return False
        found = self._poll(octets, now)
        if found is None:
            return False
        self._give(*found, now, len(octets))
        return True

    def _give(self, port_index: int, answer: bytes | memoryview, now: int, octets: int) -> None:
        self._hear(now, octets)
        self._counters.received += 1
        self.send(port_index, answer)
        self._came_ns = 0

    def _deliver(self, telegrams: list[bytes], now: int) -> None:
        receiver = self._receiver
        if receiver is None:
            return
        last = len(telegrams) - 1
        for place, telegram in enumerate(telegrams):
            self._counters.received += 1
            self._is_passed = place < last or not self.splitter.is_whole
            wanted = None if self._audience is None else self._audience(telegram)
            for index in tuple(self._ports) if wanted is None else wanted:
                if index in self._pulled:
                    self._counters.dropped["cable-pulled"] += 1
                elif index in self._ports:
                    if self._watcher is not None:
                        self._watcher(index, telegram, now, "in")
                    receiver(index, telegram, now)

    def _arm(self) -> None:
        """An incomplete telegram is given up in time."""
        due = self.splitter.next_deadline()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if due is not None:
            delay = max(0.0, (due - time.monotonic_ns()) / 1e9)
            self._timer = asyncio.get_running_loop().call_later(delay, self._given_up)

    def _given_up(self) -> None:
        self._timer = None
        now = time.monotonic_ns()
        self._deliver(self.splitter.handle_timeout(now), now)
        self._arm()
