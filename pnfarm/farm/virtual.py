"""Two nodes on a memory switch in virtual time: an hour of farm time in seconds, with the bytes of a real wire.

Cyclic frames are exchanged inside compiled code; acyclic ones travel through the switch.  Time only moves in
:meth:`VirtualWorld.run`, so that every run is the same.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np

from pnfarm.engine import tick as engine_tick
from pnfarm.engine import virtual as engine_virtual
from pnfarm.engine.channels.delay_queue import sent_length, sent_port
from pnfarm.errors import InternalError
from pnfarm.links.memory import MemoryLink, MemorySwitch
from pnfarm.protocols.deadlines import Timed, earliest
from pnfarm.table.compiling.compiled import direct
from pnfarm.wire.direction import Direction
from pnfarm.wire.mac import mac_to_int

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.buses.node import Node
    from pnfarm.engine.columns import Columns
    from pnfarm.links.base import Port

__all__ = ["Seen", "Serviced", "VirtualClock", "VirtualWorld"]

deliver, take = direct(engine_virtual.deliver), direct(engine_virtual.take)
next_due, tick = direct(engine_tick.next_due), direct(engine_tick.tick)
run_alone, run_virtual = direct(engine_virtual.run_alone), direct(engine_virtual.run_virtual)

#: ``seen(port, frame, now, direction)``: a cyclic frame of the farm; the direction is the drive's.
Seen = Callable[[int, bytes, int, Direction], None]

#: Where virtual time begins: not at zero, which means "never" in several columns.
EPOCH_NS = 1_000_000_000_000
#: Longest chain of frames and answers within one instant.
MOST_ROUNDS = 1000


class Serviced(Timed, Protocol):
    """What has something to do at its deadline."""

    def service(self, now: int) -> None:
        """Do what is due."""


class VirtualClock:
    """The time of one world, for all its parts."""

    def __init__(self, now: int = EPOCH_NS) -> None:
        self.now = now

    def __call__(self) -> int:
        return self.now


class VirtualWorld:
    """A switch, a clock, a farm and perhaps controllers.

    Make links with :meth:`link`, nodes on their ports, then :meth:`join` them and :meth:`run`.
    """

    def __init__(self, begin_ns: int = EPOCH_NS) -> None:
        self.clock = VirtualClock(begin_ns)
        self.switch = MemorySwitch()
        self._nodes: list[Node] = []
        #: All that has deadlines, in the order of their service: the nodes, and the users' programs after them.
        self._parts: list[Serviced] = []
        self._dues: list[int | None] = []
        #: For each node: its table, and the field that counts its events.
        self._tables: list[Columns] = []
        self._heads: list[np.ndarray] = []
        #: For each part: the events of its node until its last service.
        self._served: list[int] = []
        self._addresses: list[tuple[np.ndarray, np.ndarray]] = []
        self._ports: dict[bytes, int] = {}
        self._seen: Seen | None = None
        self._moves = 0

    @property
    def now(self) -> int:
        """Nanoseconds."""
        return self.clock.now

    def link(self, *, baud: int = 0) -> MemoryLink:
        """A link on this world's switch; ``baud``: of serial lines that begin with its ports."""
        return MemoryLink(self.switch, self.clock, baud=baud)

    def join(self, node: Node, ports: Sequence[Port]) -> None:
        """Put a node into the world; the first is the farm, the others its controllers.

        With more than one controller the world runs slower.
        """
        first = not self._nodes
        self._nodes.append(node)
        place = len(self._nodes) - 1
        self._parts.insert(place, node)
        self._dues.insert(place, None)
        self._served.insert(place, -1)
        self._tables.append(node.columns)
        self._heads.append(node.columns.engine["event_head"])
        self._addresses.append(_sorted((port.mac, port.index) for port in ports))
        if first:
            self._ports = {port.mac: port.index for port in ports}

    def join_programs(self, programs: Serviced) -> None:
        """Call users' programs at their times, after all nodes, so that they see what these received."""
        self._parts.append(programs)
        self._dues.append(None)
        self._served.append(0)

    def _follow_addresses(self) -> None:
        """A port of the switch has another address: frames to it arrive there."""
        self._moves = self.switch.moves
        known = [
            [(self.switch.mac_of(index), index) for index in sorted(set(indexes.tolist()))]
            for _, indexes in self._addresses
        ]
        joined = [[pair for pair in self.switch.groups if pair[1] in indexes] for _, indexes in self._addresses]
        self._addresses = [_sorted({*pairs, *groups}) for pairs, groups in zip(known, joined, strict=True)]
        self._ports = dict(known[0]) if known else {}

    def watch(self, seen: Seen) -> None:
        """Show each cyclic frame between the nodes, with the same bytes and times as without; slower."""
        self._seen = seen

    def run(self, seconds: float, *, until: Callable[[], bool] | None = None, look_ns: int | None = None) -> bool:
        """Let time pass; stops early, and returns True, once ``until`` holds.

        It is called after each event, where it only looks, and with ``look_ns`` also at that interval, where it may
        change set points.
        """
        end = self.now + round(seconds * 1e9)
        look = None if look_ns is None else self.now + look_ns
        first = self._settle()
        while True:
            if until is not None:
                if until():
                    return True
                if look_ns is not None:
                    # which may have changed something
                    first = earliest(self.switch, *self._parts)
            if self.now >= end:
                return False
            target = max(self.now, end if first is None else min(end, first))
            if until is None or look_ns is None or look is None:
                self.clock.now = self._cyclic(target)
            else:
                while look <= self.now:
                    look += look_ns
                if self._looking(target, until, look, look_ns):
                    return True
            # only what is due, unless `until` may have changed something
            first = self._settle(whole=look_ns is not None)

    def _looking(self, target: int, until: Callable[[], bool], look: int, look_ns: int) -> bool:
        """Ticks up to ``target``, or to the first event; ends early, with True, once ``until`` holds."""
        heads = [int(head[0]) for head in self._heads]
        while look < target:
            self.clock.now = self._cyclic(look)
            if [int(head[0]) for head in self._heads] != heads:
                return False
            look += look_ns
            if until():
                return True
        self.clock.now = self._cyclic(target)
        return False

    def _cyclic(self, target: int) -> int:
        """Ticks up to ``target``, or to the first event."""
        if target <= self.now:
            return self.now
        if self.switch.moves != self._moves:
            self._follow_addresses()
        if len(self._nodes) == 1:
            return run_alone(self._tables[0], self.now, target)
        if len(self._nodes) > 2:
            return self._cyclic_many(target)
        (farm, controller), (here, there) = self._tables, self._addresses
        if self._seen is not None:
            return self._cyclic_seen(target)
        return run_virtual(farm, controller, *here, *there, self.now, target)

    def _cyclic_many(self, target: int) -> int:
        """:func:`run_virtual` with several controllers, each in turn."""
        farm, *controllers = self._tables
        here, *there = self._addresses
        heads = [int(head[0]) for head in self._heads]
        now = self.now
        while now < target and [int(head[0]) for head in self._heads] == heads:
            now = min(target, *(int(next_due(columns, now)) for columns in self._tables))
            for controller in controllers:
                sent = tick(controller, 0, now)
                self._show_inbound(controller, sent, now)
                take(farm, controller, deliver(controller, sent, farm, *here, now))
            sent = tick(farm, 0, now)
            self._show_outbound(farm, sent, now)
            for controller, addresses in zip(controllers, there, strict=True):
                take(controller, farm, deliver(farm, sent, controller, *addresses, now))
        return now

    def _show_inbound(self, controller: Columns, sent: int, now: int) -> None:
        """Show what a controller sends to the farm in this tick, if there is a capture."""
        if self._seen is None:
            return
        for row in controller.tx_row[:sent]:
            frame = controller.frames[row, : sent_length(controller.ppm, controller.held, int(row))].tobytes()
            if (port := self._ports.get(frame[:6])) is not None:
                self._seen(port, frame, now, "in")

    def _show_outbound(self, farm: Columns, sent: int, now: int) -> None:
        """Show what the farm sends in this tick, if there is a capture."""
        if self._seen is None:
            return
        for row in farm.tx_row[:sent]:
            length, port = (told(farm.ppm, farm.held, int(row)) for told in (sent_length, sent_port))
            self._seen(int(port), farm.frames[row, : int(length)].tobytes(), now, "out")

    def _cyclic_seen(self, target: int) -> int:
        """:func:`run_virtual`, step by step, with each frame shown on its way."""
        (farm, controller), (here, there) = self._tables, self._addresses
        heads = [int(head[0]) for head in self._heads]
        now, waiting = self.now, 0
        while now < target and [int(head[0]) for head in self._heads] == heads:
            now = min(int(next_due(farm, now)), int(next_due(controller, now)), target)
            take(controller, farm, waiting)
            sent = tick(controller, 0, now)
            self._show_inbound(controller, sent, now)
            take(farm, controller, deliver(controller, sent, farm, *here, now))
            sent = tick(farm, 0, now)
            self._show_outbound(farm, sent, now)
            waiting = deliver(farm, sent, controller, *there, now)
        take(controller, farm, waiting)
        return now

    def _settle(self, *, whole: bool = True) -> int | None:
        """Handle everything acyclic that is due at this instant; the first deadline after it.

        ``whole``: ask each part, as something may have been done to it from outside; else what is due or has events.
        """
        for _ in range(MOST_ROUNDS):
            delivered = self.switch.deliver(self.now)
            self._service(whole=whole or delivered > 0)
            due = self.switch.next_deadline()
            for one in self._dues:
                if one is not None and (due is None or one < due):
                    due = one
            if not delivered and (due is None or due > self.now):
                return due
        raise InternalError("the virtual world does not come to rest: a machine asks to be called again and again")

    def _service(self, *, whole: bool) -> None:
        """Of other parts the deadline stays: what one does to another travels as a frame, or is in its events."""
        now, heads = self.now, [int(head[0]) for head in self._heads]
        asked = []
        for number, part in enumerate(self._parts):
            head = heads[number] if number < len(heads) else 0
            due = self._dues[number]
            if whole or (due is not None and due <= now) or head != self._served[number]:
                self._served[number] = head
                part.service(now)
                asked.append(number)
        for number in asked:
            self._dues[number] = self._parts[number].next_deadline()


def _sorted(ports: Iterable[tuple[bytes, int]]) -> tuple[np.ndarray, np.ndarray]:
    """Addresses as numbers, in order, and the ports that have them."""
    pairs = sorted((mac_to_int(mac), index) for mac, index in ports)
    return np.array([mac for mac, _ in pairs], np.int64), np.array([index for _, index in pairs], np.int32)
