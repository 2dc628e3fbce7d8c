"""The gate between the stations and their sockets: messages on streams, and datagrams, pass it.

It is to them what :mod:`pnfarm.faults.gate.gate` is to acyclic frames, with the same rules; cyclic data do not pass
here. The gate parses nothing: the drive's bus cuts a stream into messages and classifies them.

A stream is TCP's, so that its octets stay in order and none is missing.  A rule that loses frames makes them late by
:data:`REPEAT_NS`, the time after which TCP repeats what was lost, again and again as long as the rule hits them; a rule
with ``of_messages`` takes whole messages away, as a drive that does not answer.  The connection itself is not the
gate's: peers can open streams, and TCP acknowledges, whatever rules are in force.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, TypeAlias

from pnfarm.links.sockets import MOST_OCTETS
from pnfarm.wire.endpoint import (
    Datagram,
    DatagramReceived,
    StreamClosed,
    StreamData,
    StreamEnd,
    StreamOpened,
    StreamReceived,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from pnfarm.faults.gate.gate import DelayRule, GateRule, LateRule
    from pnfarm.wire.direction import Direction
    from pnfarm.wire.endpoint import SocketAction, SocketEvent

__all__ = ["DATAGRAM", "REPEAT_NS", "STREAM", "Cutter", "MessageClass", "SocketGate"]

#: Classes that every bus has; one may have more for messages on streams, which then begin with this word.
STREAM = "stream"
DATAGRAM = "datagram"
#: The shortest time after which TCP repeats (Linux: TCP_RTO_MIN).
REPEAT_NS = 200_000_000
#: Messages of one port that wait at most; what comes on top is lost, and with it its stream.
MOST_WAITING = 1024

#: Classifies a message that a drive sends on a stream.
MessageClass: TypeAlias = "Callable[[bytes], str]"


class Cutter(Protocol):
    """Cuts what comes on one stream."""

    def pieces(self, data: bytes) -> list[tuple[bool, bytes]]:
        """``data`` in pieces, each with whether it begins a message; no piece has octets of two."""


class _Whole:
    """Without knowing better: what comes at once is a message."""

    def pieces(self, data: bytes) -> list[tuple[bool, bytes]]:
        return [(True, data)]


@dataclass(slots=True, eq=False)
class _Item:
    """What waits until ``due``; ``lost``: it is to be repeated then, and may be lost again."""

    due: int
    event: SocketEvent | SocketAction
    frame_class: str
    size: int
    rules: set[GateRule]
    late: tuple[LateRule, ...] = ()
    lost: bool = False


@dataclass(slots=True, eq=False)
class _Stream:
    number: int
    cutter: Cutter
    #: Whether the station has sent something on it.
    spoke: bool = False
    #: Rules that hit the message that is on its way in.
    hitting: dict[GateRule, bool] = field(default_factory=dict)
    lanes: dict[Direction, deque[_Item]] = field(default_factory=lambda: {"in": deque(), "out": deque()})


@dataclass(slots=True, eq=False)
class _Port:
    message_class: MessageClass = lambda _: STREAM
    cutter: Callable[[], Cutter] = _Whole
    rules: list[GateRule] = field(default_factory=list)
    delays: list[DelayRule] = field(default_factory=list)
    streams: dict[int, _Stream] = field(default_factory=dict)
    datagrams: list[tuple[Direction, _Item]] = field(default_factory=list)
    octets: int = 0

    def free(self, items: Iterable[_Item]) -> None:
        """Let those of them go on that no rule holds back any more."""
        standing = {rule.late for rule in self.delays}
        for item in items:
            if not item.rules and standing.isdisjoint(item.late):
                item.due = 0

    def waiting(self) -> Iterable[_Item]:
        for stream in self.streams.values():
            for lane in stream.lanes.values():
                yield from lane
        for _, item in self.datagrams:
            yield item


class SocketGate:
    """``deliver(port, event, now)`` hands a station what passes; ``act(port, action)`` carries what it sends.

    The farm's runtime calls :meth:`handle_timeout` at :meth:`next_deadline`.
    """

    def __init__(
        self,
        deliver: Callable[[int, SocketEvent, int], None],
        act: Callable[[int, SocketAction], None],
        refuse: Callable[[int, bool], None],
    ) -> None:
        self._deliver = deliver
        self._act = act
        self._refuse = refuse
        self._ports: dict[int, _Port] = {}
        self._refusing: dict[int, int] = {}

    def classify(self, port: int, message_class: MessageClass, cutter: Callable[[], Cutter]) -> None:
        """Set how the port's bus distinguishes messages."""
        known = self._port(port)
        known.message_class, known.cutter = message_class, cutter

    def _port(self, port: int) -> _Port:
        return self._ports.setdefault(port, _Port())

    # -- rules -------------------------------------------------------------------------------------------------------

    def add(self, port: int, rule: GateRule) -> None:
        self._port(port).rules.append(rule)

    def remove(self, port: int, rule: GateRule) -> None:
        """Remove a rule; what waits for it alone goes on with the next :meth:`handle_timeout`, which is due now."""
        known = self._port(port)
        known.rules = [other for other in known.rules if other is not rule]
        for stream in known.streams.values():
            stream.hitting.pop(rule, None)
        held = [item for item in known.waiting() if rule in item.rules]
        for item in held:
            item.rules.discard(rule)
            rule.waiting -= 1
        known.free(held)

    def delay(self, port: int, rule: DelayRule) -> None:
        """Let ``rule`` hold back what the drive sends."""
        self._port(port).delays.append(rule)

    def undelay(self, port: int, rule: DelayRule) -> None:
        """Remove it; what no other rule holds back goes on with the next :meth:`handle_timeout`."""
        known = self._port(port)
        known.delays = [other for other in known.delays if other is not rule]
        known.free([item for item in known.waiting() if rule.late in item.late])

    def refuse(self, port: int, *, on: bool) -> None:
        """Let the port refuse new streams until every caller that asked for it has withdrawn."""
        before = self._refusing.get(port, 0)
        self._refusing[port] = before + (1 if on else -1)
        if (before > 0) != (self._refusing[port] > 0):
            self._refuse(port, self._refusing[port] > 0)

    def refuses(self, port: int) -> bool:
        return self._refusing.get(port, 0) > 0

    def in_force(self, port: int) -> list[object]:
        """Rules that act on a port, and what waits there."""
        known = self._port(port)
        return [*known.rules, *known.delays, *known.waiting(), *(["refusing"] * self._refusing.get(port, 0))]

    def forget(self, port: int) -> None:
        """Drop what waits: the station has lost its supply."""
        known = self._port(port)
        for item in known.waiting():
            _gone(item)
        for stream in known.streams.values():
            for lane in stream.lanes.values():
                lane.clear()
        known.datagrams.clear()
        known.octets = 0

    def restart(self, port: int) -> None:
        """The port's streams are gone."""
        self.forget(port)
        self._port(port).streams.clear()

    def sessions(self, port: int) -> list[int]:
        """Open streams on which the station has sent something."""
        return [number for number, stream in self._port(port).streams.items() if stream.spoke]

    def cut(self, port: int, number: int, now: int) -> None:
        """End a stream from the drive's end, as if it had closed it."""
        known = self._port(port)
        if number in known.streams:
            self._drop(known, number)
            self._act(port, StreamEnd(number))
            self._deliver(port, StreamClosed(port, number), now)

    # -- what comes --------------------------------------------------------------------------------------------------

    def received(self, event: SocketEvent, now: int) -> None:
        """Something of a stream, or a datagram, for a station."""
        port = event.port
        known = self._port(port)
        match event:
            case StreamOpened(stream=number):
                known.streams[number] = _Stream(number, known.cutter())
                self._deliver(port, event, now)
            case StreamClosed(stream=number):
                stream = known.streams.get(number)
                if stream is not None and stream.lanes["in"]:
                    # after what it sent before
                    self._empty(known, stream.lanes["out"])
                    self._wait(port, known, "in", stream, _Item(now, event, STREAM, 0, set()), now)
                else:
                    self._drop(known, number)
                    self._deliver(port, event, now)
            case StreamReceived(stream=number, data=data):
                stream = known.streams.setdefault(number, _Stream(number, known.cutter()))
                pieces = stream.cutter.pieces(data)
                if not known.rules and not stream.lanes["in"]:
                    self._deliver(port, event, now)
                    return
                for first, piece in pieces:
                    if number not in known.streams:
                        return
                    if first:
                        stream.hitting = {rule: rule.loses("in", STREAM, now) for rule in known.rules}
                    item = _Item(now, StreamReceived(port, number, piece), STREAM, len(piece), set())
                    self._pass(port, known, "in", stream, item, stream.hitting, now)
            case DatagramReceived(data=data):
                item = _Item(now, event, DATAGRAM, len(data), set())
                hits = {rule: rule.loses("in", DATAGRAM, now) for rule in known.rules}
                self._pass(port, known, "in", None, item, hits, now)

    def sent(self, port: int, action: SocketAction, now: int) -> None:
        """What a station sends or closes."""
        known = self._port(port)
        if isinstance(action, Datagram):
            item = _Item(now, action, DATAGRAM, len(action.data), set())
            hits = {rule: rule.loses("out", DATAGRAM, now) for rule in known.rules}
            self._hold(known, item, now)
            self._pass(port, known, "out", None, item, hits, now)
            return
        stream = known.streams.get(action.stream)
        if stream is not None:
            stream.spoke = True
        if isinstance(action, StreamEnd):
            if stream is not None and stream.lanes["out"]:
                self._empty(known, stream.lanes["in"])
                self._wait(port, known, "out", stream, _Item(now, action, STREAM, 0, set()), now)
                return
            self._drop(known, action.stream)
            self._act(port, action)
        elif stream is None or not (known.rules or known.delays or stream.lanes["out"]):
            self._act(port, action)
        else:
            item = _Item(now, action, known.message_class(action.data), len(action.data), set())
            hits = {rule: rule.loses("out", item.frame_class, now) for rule in known.rules}
            self._hold(known, item, now)
            self._pass(port, known, "out", stream, item, hits, now)

    @staticmethod
    def _hold(known: _Port, item: _Item, now: int) -> None:
        """Ask the delays about a message of the drive."""
        waits = [(r.late, r.late.asked(now)) for r in known.delays if item.frame_class in r.classes]
        item.late = tuple(late for late, wait in waits if wait)
        item.due += sum(wait for _, wait in waits)

    def _pass(
        self,
        port: int,
        known: _Port,
        direction: Direction,
        stream: _Stream | None,
        item: _Item,
        hits: dict[GateRule, bool],
        now: int,
    ) -> None:
        """Let the rules decide about one message, or a piece of it."""
        left = [item]
        for rule in known.rules:
            hit = hits.get(rule, False)
            if hit and rule.is_repeated and stream is not None:
                for one in left:
                    one.due = max(one.due, now + REPEAT_NS)
                    one.rules.add(rule)
                    one.lost = True
                continue
            left = [passing for one in left for passing in _shaped(rule, direction, one, hit=hit)]
        if not left:
            _let_go(item)
        for one in left:
            lane = stream.lanes[direction] if stream is not None else ()
            if one.due <= now and not lane:
                self._go_on(port, known, direction, one, now)
            else:
                self._wait(port, known, direction, stream, one, now)

    # -- what waits --------------------------------------------------------------------------------------------------

    def _wait(
        self, port: int, known: _Port, direction: Direction, stream: _Stream | None, item: _Item, now: int
    ) -> None:
        count = len(known.datagrams) + sum(len(lane) for one in known.streams.values() for lane in one.lanes.values())
        if count >= MOST_WAITING or known.octets + item.size > MOST_OCTETS:
            _let_go(item)
            if stream is not None:
                self.cut(port, stream.number, now)
            return
        known.octets += item.size
        for rule in item.rules:
            rule.waiting += 1
        if stream is None:
            known.datagrams.append((direction, item))
        else:
            stream.lanes[direction].append(item)

    def _empty(self, known: _Port, lane: deque[_Item]) -> None:
        for item in lane:
            known.octets -= item.size
            _gone(item)
        lane.clear()

    def _drop(self, known: _Port, number: int) -> None:
        """A stream is over, with all that waits on it."""
        stream = known.streams.pop(number, None)
        if stream is not None:
            for lane in stream.lanes.values():
                self._empty(known, lane)

    def _go_on(self, port: int, known: _Port, direction: Direction, item: _Item, now: int) -> None:
        """After the rules."""
        for late in item.late:
            late.left(sent=True)
        event = item.event
        if isinstance(event, StreamClosed | StreamEnd):
            self._drop(known, event.stream)
        if isinstance(event, StreamData | StreamEnd | Datagram):
            self._act(port, event)
        else:
            assert direction == "in"
            self._deliver(port, event, now)

    def next_deadline(self) -> int | None:
        """When the next one goes on, or is repeated."""
        due: list[int] = []
        for known in self._ports.values():
            due += [item.due for _, item in known.datagrams]
            due += [lane[0].due for stream in known.streams.values() for lane in stream.lanes.values() if lane]
        return min(due, default=None)

    def handle_timeout(self, now: int) -> None:
        for port, known in list(self._ports.items()):
            ready = [entry for entry in known.datagrams if entry[1].due <= now]
            known.datagrams = [entry for entry in known.datagrams if entry[1].due > now]
            for direction, item in sorted(ready, key=lambda entry: entry[1].due):
                known.octets -= item.size
                _no_longer_waiting(item)
                self._go_on(port, known, direction, item, now)
            for stream in list(known.streams.values()):
                for direction in ("in", "out"):
                    self._release(port, known, direction, stream, now)

    def _release(self, port: int, known: _Port, direction: Direction, stream: _Stream, now: int) -> None:
        lane = stream.lanes[direction]
        while lane and lane[0].due <= now and stream.number in known.streams:
            item = lane[0]
            if item.lost:
                self._repeat(known, direction, item, now)
                if item.lost:
                    return
            lane.popleft()
            known.octets -= item.size
            _no_longer_waiting(item)
            self._go_on(port, known, direction, item, now)

    @staticmethod
    def _repeat(known: _Port, direction: Direction, item: _Item, now: int) -> None:
        """TCP repeats what was lost: it may be lost again."""
        item.lost = False
        for rule in item.rules & set(known.rules):
            if rule.loses(direction, item.frame_class, now):
                item.lost = True
                item.due = now + REPEAT_NS


def _shaped(rule: GateRule, direction: Direction, item: _Item, *, hit: bool) -> list[_Item]:
    """What goes on after one rule."""
    before = _octets(item.event)
    found: list[_Item] = []
    for due, octets in rule.left(direction, item.frame_class, before, item.due, hit=hit, bare=True):
        rules = {*item.rules, rule} if due > item.due else set(item.rules)
        event = item.event if octets is before else _with(item.event, octets)
        # a copy is not answered late once more
        late = () if found else item.late
        found.append(_Item(due, event, item.frame_class, len(octets), rules, late, item.lost))
    return found


def _octets(event: SocketEvent | SocketAction) -> bytes:
    assert isinstance(event, StreamReceived | StreamData | Datagram | DatagramReceived)
    return event.data


def _with(event: SocketEvent | SocketAction, data: bytes) -> SocketEvent | SocketAction:
    match event:
        case StreamReceived(port, stream, _):
            return StreamReceived(port, stream, data)
        case StreamData(stream, _):
            return StreamData(stream, data)
        case Datagram(service, peer, _):
            return Datagram(service, peer, data)
        case DatagramReceived(port, service, peer, _, broadcast):
            return DatagramReceived(port, service, peer, data, broadcast)
        case _:
            return event


def _let_go(item: _Item) -> None:
    """It never leaves."""
    for late in item.late:
        late.left(sent=False)


def _no_longer_waiting(item: _Item) -> None:
    for rule in item.rules:
        rule.waiting -= 1
    item.rules = set()


def _gone(item: _Item) -> None:
    """What waited never leaves."""
    _no_longer_waiting(item)
    _let_go(item)
