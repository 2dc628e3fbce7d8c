"""A switch in memory: whole farms in one process and in virtual time.

Ports know their addresses, so nothing is learnt: a unicast frame goes to the ports with that address, a
broadcast or multicast to all others, or where a link knows whom it concerns (:meth:`MemoryLink.set_audience`) to
those; only LLDP, which no switch forwards, crosses from one link to another and not between the ports of one, as if
each link were a cable. A frame is handed over at the time it was sent plus the switch's latency, in the order of
sending, when :meth:`MemorySwitch.deliver` is called for that time; frames sent while frames are delivered belong to
the same call when they are due, so that a question and its answer pass in one instant.

Cyclic frames are exchanged by the compiled engine inside its tables; these are the acyclic ones.
"""

from __future__ import annotations

from collections import Counter, deque
from typing import TYPE_CHECKING, Any, TypeVar

from pnfarm.errors import InternalError
from pnfarm.links.base import MULTICAST_LLDP, Audience, Clock, LinkCounters, Port, PortSpec, Receiver
from pnfarm.links.memory_sockets import MemoryNetwork, MemorySockets
from pnfarm.links.serial.line import LineCounters, ReplyTimes

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Coroutine, Sequence

    from pnfarm.errors import PnfarmError
    from pnfarm.links.serial.line import LineTally

__all__ = ["MemoryLink", "MemorySwitch", "at_once"]

T = TypeVar("T")

#: Frames that one :meth:`MemorySwitch.deliver` takes at most: two stations may answer each other endlessly.
MAX_DELIVERIES = 1_000_000


#: Rate of a line in memory where nothing says another one, bit/s.
USUAL_BAUD = 1_500_000


class _Socket:
    """One port's side of the switch; ``line`` is the name of its serial line, empty for a network."""

    __slots__ = ("carrier", "counters", "line", "mac", "receiver")

    def __init__(self, mac: bytes, counters: LinkCounters, line: str = "") -> None:
        self.mac = mac
        self.line = line
        self.counters = counters
        self.receiver: Receiver | None = None
        self.carrier = True


class _Tally:
    """See :class:`pnfarm.links.serial.line.LineTally`: what one link reports, and gets of all others."""

    way, where, is_up = "memory", "in memory", True
    withheld = 0

    def __init__(self, line: _Line) -> None:
        self._line = line
        #: Telegrams, octets.
        self.said = [0, 0]
        self.replies = ReplyTimes()
        self.dropped: Counter[str] = Counter()

    @property
    def baud(self) -> int:
        return self._line.baud

    @property
    def octets(self) -> LineCounters:
        return LineCounters(received=self._heard(1), sent=self.said[1])

    @property
    def telegrams(self) -> tuple[int, int]:
        return self._heard(0), self.said[0]

    def _heard(self, what: int) -> int:
        return sum(one.said[what] for one in self._line.tallies.values()) - self.said[what]


class _Line:
    """A serial line: one medium, on which octets take their time and everybody hears everything."""

    #: Start bit, eight of data, parity, stop bit; between the octets of two stations, the line turns around.
    BITS, TURN_BITS = 11, 11

    def __init__(self, baud: int) -> None:
        self.baud = baud
        #: What each link on it said, by its counters.
        self.tallies: dict[int, _Tally] = {}
        self.under_way: deque[tuple[int, int, bytes]] = deque()
        self._free_ns = 0
        self._last = 0

    def tally(self, counters: LinkCounters) -> _Tally:
        """That of a link."""
        return self.tallies.setdefault(id(counters), _Tally(self))

    def send(self, port: int, octets: bytes, now: int, counters: LinkCounters) -> None:
        """Put octets on the line.  While others are on it, both are garbled."""
        begin = now
        mine = self.tally(counters)
        mine.said[0] += 1
        mine.said[1] += len(octets)
        if now < self._free_ns and self.under_way:
            due, other, garbled = self.under_way.pop()
            self.under_way.append((due, other, _garbled(garbled)))
            octets = _garbled(octets)
        elif self._last not in {0, port}:
            # an answer begins no sooner than that after its request
            begin = max(now, self._free_ns + self.TURN_BITS * 1_000_000_000 // self.baud)
            mine.replies.add(begin - self._free_ns)
        end = max(self._free_ns, begin + len(octets) * self.BITS * 1_000_000_000 // self.baud)
        self._free_ns, self._last = end, port
        self.under_way.append((end, port, octets))


def _garbled(octets: bytes) -> bytes:
    """What is heard where two speak, or more: no telegram begins so."""
    return b"\x55" * len(octets)


class MemorySwitch:
    """Joins ports.  ``latency_ns`` passes between sending and delivery.  Port indexes count from 1."""

    def __init__(self, latency_ns: int = 0) -> None:
        if latency_ns < 0:
            raise ValueError(f"latency of {latency_ns} ns: a frame cannot arrive before it was sent")
        self._latency_ns = latency_ns
        self._sockets: dict[int, _Socket] = {}
        self._by_mac: dict[bytes, list[int]] = {}
        self._next_index = 1
        self._audiences: list[tuple[frozenset[int], Audience]] = []
        self._line_audiences: list[tuple[frozenset[int], Audience]] = []
        #: How often a port has changed its address.
        self.moves = 0
        self._under_way: deque[tuple[int, int, bytes | Callable[[int], None]]] = deque()
        self._lines: dict[str, _Line] = {}
        #: Streams and datagrams of stations with addresses of their own.
        self.network = MemoryNetwork(self._post, self._plugged, self.mac_of, self.join, self.leave)
        #: Multicast groups that ports have joined, for what passes frames by address.
        self.groups: list[tuple[bytes, int]] = []

    def attach(
        self,
        mac: bytes,
        receiver: Receiver | None = None,
        *,
        name: str = "",
        counters: LinkCounters | None = None,
        line: str = "",
        baud: int = 0,
    ) -> Port:
        """A new port.  ``counters`` are shared by the ports of one link, and say that they are of one link.

        ``line``: it is on the serial line of that name, whose rate is that of its first port that gives a ``baud``.
        """
        index = self._next_index
        self._next_index += 1
        socket = _Socket(mac, counters if counters is not None else LinkCounters(), line)
        socket.receiver = receiver
        self._sockets[index] = socket
        if line:
            made = self._lines.setdefault(line, _Line(baud or USUAL_BAUD))
            return Port(name or f"memory-{index}", index, mac, made.baud)
        self._by_mac.setdefault(mac, []).append(index)
        return Port(name or f"memory-{index}", index, mac)

    def detach(self, port_index: int) -> None:
        """Take a port away; frames on their way to it are lost."""
        socket = self._sockets.pop(port_index, None)
        self.groups = [(group, index) for group, index in self.groups if index != port_index]
        if socket is not None and not socket.line:
            self._by_mac[socket.mac].remove(port_index)

    def set_receiver(self, port_index: int, receiver: Receiver) -> None:
        self._socket(port_index).receiver = receiver

    def set_carrier(self, port_index: int, up: bool, now: int = 0) -> None:
        """Pull or plug a cable; frames on their way are delivered only if it is plugged when they arrive."""
        self._socket(port_index).carrier = up
        if up:
            self.network.replugged(port_index, now)

    def _plugged(self, port_index: int) -> bool:
        socket = self._sockets.get(port_index)
        return socket is not None and socket.carrier

    def _post(self, port_index: int, action: Callable[[int], None], now: int) -> None:
        """Call ``action`` when what is sent now arrives, after everything sent before."""
        self._under_way.append((now + self._latency_ns, port_index, action))

    def join(self, port_index: int, group: bytes) -> None:
        """Let cyclic frames to a multicast address pass to this port, one of each table."""
        if (group, port_index) not in self.groups:
            self.groups.append((group, port_index))
            self.moves += 1

    def leave(self, port_index: int, group: bytes) -> None:
        """Undo :meth:`join`."""
        if (group, port_index) in self.groups:
            self.groups.remove((group, port_index))
            self.moves += 1

    def set_mac(self, port_index: int, mac: bytes) -> None:
        """Change a port's address.  Two ports may share one, as on a wire with a duplicate address."""
        socket = self._socket(port_index)
        self._by_mac[socket.mac].remove(port_index)
        self._by_mac.setdefault(mac, []).append(port_index)
        socket.mac = mac
        self.moves += 1

    def mac_of(self, port_index: int) -> bytes:
        """A port's present address."""
        return self._socket(port_index).mac

    def _socket(self, port_index: int) -> _Socket:
        socket = self._sockets.get(port_index)
        if socket is None:
            raise InternalError(f"the switch has no port {port_index}")
        return socket

    def send(self, port_index: int, frame: bytes, now: int) -> None:
        """Put a frame on the wire at ``now``."""
        socket = self._socket(port_index)
        if not socket.carrier:
            socket.counters.dropped["cable-pulled"] += 1
            return
        socket.counters.sent += 1
        if socket.line:
            self._lines[socket.line].send(port_index, bytes(frame), now, socket.counters)
            return
        self._under_way.append((now + self._latency_ns, port_index, bytes(frame)))

    def next_deadline(self) -> int | None:
        """When the oldest frame on its way is due."""
        due = [line.under_way[0][0] for line in self._lines.values() if line.under_way]
        if self._under_way:
            due.append(self._under_way[0][0])
        return min(due, default=None)

    def deliver(self, now: int) -> int:
        """Hand over every frame that is due; returns how many were handed to a port.

        Raises :class:`~pnfarm.errors.InternalError` when stations keep answering each other within one instant.
        """
        delivered = sum(self._deliver_line(name, line, now) for name, line in self._lines.items())
        for _ in range(MAX_DELIVERIES):
            if not self._under_way or self._under_way[0][0] > now:
                return delivered
            due, source_port, frame = self._under_way.popleft()
            if not isinstance(frame, bytes):
                delivered += 1
                frame(due)
                continue
            destination = frame[:6]
            to_all = bool(destination and destination[0] & 1)
            sender = self._sockets.get(source_port) if destination == MULTICAST_LLDP else None
            for index in self._group_receivers(frame) if to_all else list(self._by_mac.get(destination, ())):
                delivered += index != source_port and self._hand_over(index, frame, due, sender)
        raise InternalError(
            f"stations exchanged {MAX_DELIVERIES} frames in one instant: do two of them answer each other endlessly?"
        )

    def _deliver_line(self, name: str, line: _Line, now: int) -> int:
        """Hand what has left a line to everybody else on it."""
        delivered = 0
        while line.under_way and line.under_way[0][0] <= now:
            due, source, octets = line.under_way.popleft()
            for index in self._hearers(name, octets):
                delivered += index != source and self._hand_over(index, octets, due)
        return delivered

    def _hand_over(self, index: int, frame: bytes, due: int, sender: _Socket | None = None) -> bool:
        """A frame reaches a port, unless that is one of its ``sender``'s link; whether it got it."""
        # a receiver earlier in this round may have taken the port away
        socket = self._sockets.get(index)
        if socket is None or (sender is not None and socket.counters is sender.counters):
            return False
        if not socket.carrier:
            socket.counters.dropped["cable-pulled"] += 1
            return False
        socket.counters.received += 1
        if socket.receiver is not None:
            socket.receiver(index, frame, due)
        return True

    def _hearers(self, name: str, octets: bytes) -> list[int]:
        """Ports of a line, less those that a telegram does not concern."""
        hearers = {index for index, socket in self._sockets.items() if socket.line == name}
        for ports, audience in self._line_audiences:
            wanted = audience(octets)
            if wanted is not None:
                hearers -= ports.difference(wanted)
        return sorted(hearers)

    def tallies(self, counters: LinkCounters, ports: Collection[int]) -> dict[str, LineTally]:
        """Of a link's lines, by name; ``ports`` are the link's."""
        names = {name: None for index in ports if (name := self._sockets[index].line)}
        return {name: self._lines[name].tally(counters) for name in names}

    def set_line_audience(self, ports: Collection[int], audience: Audience | None) -> None:
        """Ask ``audience`` which of ``ports`` a telegram of their line goes to; None: to all of them again."""
        self._line_audiences = [(of, ask) for of, ask in self._line_audiences if of.isdisjoint(ports)]
        if audience is not None:
            self._line_audiences.append((frozenset(ports), audience))

    def set_audience(self, ports: Collection[int], audience: Audience | None) -> None:
        """Ask ``audience`` which of ``ports`` a group-addressed frame goes to; None: to all of them again."""
        self._audiences = [(of, ask) for of, ask in self._audiences if of.isdisjoint(ports)]
        if audience is not None:
            self._audiences.append((frozenset(ports), audience))

    def _group_receivers(self, frame: bytes) -> list[int]:
        """The ports that a group-addressed frame goes to, in the order in which they were attached."""
        if not self._audiences:
            return list(self._sockets)
        chosen: set[int] = set()
        asked: set[int] = set()
        for ports, audience in self._audiences:
            wanted = audience(frame)
            if wanted is not None:
                asked |= ports
                chosen.update(wanted)
        if not asked:
            return list(self._sockets)
        return sorted(chosen.intersection(asked).union(self._sockets.keys() - asked))


def at_once(work: Coroutine[Any, Any, T], otherwise: PnfarmError) -> T:
    """Carry out a coroutine that never waits, as in memory nothing blocks, also where a loop runs already.

    Raises ``otherwise`` where it waits after all.
    """
    try:
        work.send(None)
    except StopIteration as end:
        return end.value  # type: ignore[no-any-return]  # the coroutine's result
    work.close()
    raise otherwise


class MemoryLink:
    """The ports of one farm (or of one controller) on a switch.  ``clock`` is the virtual time at which it sends.

    ``baud`` is the rate of serial lines that begin with its ports.
    """

    kind = "memory"

    def __init__(self, switch: MemorySwitch, clock: Clock, *, baud: int = 0) -> None:
        self._switch = switch
        self._baud = baud
        self._clock = clock
        self._counters = LinkCounters()
        self._receiver: Receiver | None = None
        self._indexes: set[int] = set()
        self.sockets = MemorySockets(switch.network, clock, self._counters)

    @property
    def counters(self) -> LinkCounters:
        return self._counters

    def tallies(self) -> dict[str, LineTally]:
        """What is to be known of its lines, by name."""
        return self._switch.tallies(self._counters, self._indexes)

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        if self._indexes:
            raise InternalError("this memory link is already open")
        ports = [
            self._switch.attach(
                spec.mac, self._receive, name=spec.station, counters=self._counters, line=spec.line, baud=self._baud
            )
            for spec in wanted
        ]
        self._indexes = {port.index for port in ports}
        return ports

    async def close(self) -> None:
        self._switch.set_audience(self._indexes, None)
        self._switch.set_line_audience(self._indexes, None)
        self.sockets.close(self._indexes)
        for index in self._indexes:
            self._switch.detach(index)
        self._indexes = set()

    def _receive(self, port_index: int, frame: bytes, now: int) -> None:
        if self._receiver is not None:
            self._receiver(port_index, frame, now)

    def send(self, port_index: int, frame: bytes) -> None:
        if port_index not in self._indexes:
            self._counters.dropped["unknown-port"] += 1
            return
        self._switch.send(port_index, frame, self._clock())

    def set_receiver(self, receiver: Receiver) -> None:
        self._receiver = receiver

    def set_audience(self, audience: Audience) -> None:
        """Set which ports a broadcast or multicast frame can concern; the others get no copy."""
        self._switch.set_audience(self._indexes, audience)

    def set_line_audience(self, audience: Audience) -> None:
        """Set which ports a telegram of a serial line can concern; the others get no copy."""
        self._switch.set_line_audience(self._indexes, audience)

    async def set_carrier(self, port_index: int, up: bool) -> None:
        self._switch.set_carrier(port_index, up, self._clock())

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        self._switch.set_mac(port_index, mac)
