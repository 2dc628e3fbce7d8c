"""Streams and datagrams between the stations on a switch in memory: joined directly, in virtual time.

Octets arrive after everything sent before them, frames included, at the time of sending plus the switch's latency.
While a cable is pulled, those of a stream wait, as TCP repeats them, and datagrams are lost.  A station that was
withdrawn is silent; once it serves again, its peers' old streams are closed when they send, as by a reset.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.errors import InternalError
from pnfarm.links.sockets import MOST_OCTETS, MOST_STREAMS
from pnfarm.wire.endpoint import (
    Datagram,
    DatagramReceived,
    StreamClosed,
    StreamData,
    StreamOpened,
    StreamReceived,
)
from pnfarm.wire.mac import multicast_mac

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.links.base import Clock, LinkCounters
    from pnfarm.links.sockets import SocketUser
    from pnfarm.wire.endpoint import Peer, Services, SocketAction

__all__ = ["MemoryNetwork", "MemorySockets"]

_LIMITED_BROADCAST = IPv4Address("255.255.255.255")
#: First port number of a stream's own end (RFC 6335: dynamic ports).
_FIRST_DYNAMIC = 49152
_DYNAMIC = 16384


@dataclass(slots=True)
class _End:
    """One end of a stream.  ``other`` is the other end's number, ``beyond`` its port, 0 before it is known."""

    port: int
    other: int
    service: int
    beyond: int = 0
    #: Octets and closings on their way to this end while a cable is pulled.
    waiting: deque[Callable[[int], None]] = field(default_factory=deque)
    octets: int = 0


@dataclass(slots=True)
class _Host:
    sockets: MemorySockets
    services: Services
    groups: set[IPv4Address] = field(default_factory=set)
    refuses: bool = False


@dataclass(eq=False)
class MemoryNetwork:
    """All stations with addresses on one switch; ``post(action)`` calls it when what is sent now arrives.

    ``join`` and ``leave`` let frames to a group address pass to a port.
    """

    post: Callable[[int, Callable[[int], None], int], None]
    plugged: Callable[[int], bool]
    mac_of: Callable[[int], bytes]
    join: Callable[[int, bytes], None]
    leave: Callable[[int, bytes], None]
    hosts: dict[int, _Host] = field(default_factory=dict)
    ends: dict[int, _End] = field(default_factory=dict)
    _last: int = 0

    def number(self) -> int:
        self._last += 1
        return self._last

    def host_of(self, address: IPv4Address) -> int | None:
        """The port of the station with this address."""
        return next((port for port, host in self.hosts.items() if host.services.address.ip == address), None)

    def reach(self, one: int, other: int) -> bool:
        """Whether both cables are plugged."""
        return self.plugged(one) and self.plugged(other)

    def replugged(self, port: int, now: int) -> None:
        """A cable is in again: what waited goes on."""
        for number, end in list(self.ends.items()):
            other = self.ends.get(end.other)
            if other is None or port not in {end.port, other.port} or not self.reach(end.port, other.port):
                continue
            while end.waiting and number in self.ends:
                self.post(end.port, end.waiting.popleft(), now)
            end.octets = 0


class MemorySockets:
    """See :class:`pnfarm.links.sockets.SocketCarrier`."""

    answers_arp = False

    def __init__(self, network: MemoryNetwork, clock: Clock, counters: LinkCounters) -> None:
        self._network = network
        self._clock = clock
        self.counters = counters
        self._user: SocketUser | None = None
        self._next_dynamic = 0

    def set_user(self, user: SocketUser) -> None:
        self._user = user

    def serve(self, port: int, services: Services) -> None:
        self.withdraw(port)
        self._network.hosts[port] = _Host(self, services)

    def withdraw(self, port: int) -> None:
        host = self._network.hosts.pop(port, None)
        for group in () if host is None else host.groups:
            self._network.leave(port, multicast_mac(group))
        for number in [number for number, end in self._network.ends.items() if end.port == port]:
            del self._network.ends[number]

    def join(self, port: int, group: IPv4Address) -> None:
        host = self._network.hosts.get(port)
        if host is None:
            self.counters.dropped["no-address"] += 1
            return
        host.groups.add(group)
        self._network.join(port, multicast_mac(group))

    def leave(self, port: int, group: IPv4Address) -> None:
        host = self._network.hosts.get(port)
        if host is not None and group in host.groups:
            host.groups.discard(group)
            self._network.leave(port, multicast_mac(group))

    def close(self, ports: set[int]) -> None:
        """The link closes: its streams end in order."""
        for number, end in list(self._network.ends.items()):
            if end.port in ports:
                self._finish(number, end)
        for port in ports:
            self._network.hosts.pop(port, None)

    def refuse(self, port: int, *, refused: bool) -> None:
        if port in self._network.hosts:
            self._network.hosts[port].refuses = refused

    def serves(self, port: int) -> bool:
        return port in self._network.hosts

    def tell(self, event: StreamOpened | StreamReceived | StreamClosed | DatagramReceived, now: int) -> None:
        if self._user is not None:
            self._user(event, now)

    def next_hop(self, port: int, address: IPv4Address) -> bytes | None:
        """Without routers: the station's own."""
        del port
        found = self._network.host_of(address)
        return None if found is None else self._network.mac_of(found)

    def connect(self, port: int, peer: Peer) -> int:
        network = self._network
        host = network.hosts.get(port)
        if host is None:
            raise InternalError(f"port {port} has no address to open a stream from")
        near, far = network.number(), network.number()
        network.ends[near] = _End(port, far, 0)
        own = (host.services.address.ip, _FIRST_DYNAMIC + self._next_dynamic % _DYNAMIC)
        self._next_dynamic += 1
        network.post(port, lambda now: self._arrives(near, far, own, peer, now), self._clock())
        return near

    def _arrives(self, near: int, far: int, own: Peer, peer: Peer, now: int) -> None:
        """A request for a stream comes to its station."""
        network = self._network
        end = network.ends.get(near)
        port = network.host_of(peer[0])
        if end is None or port is None or not network.reach(end.port, port):
            return
        host = network.hosts[port]
        open_now = sum(other.port == port for other in network.ends.values())
        if (
            host.refuses
            or peer[1] not in host.services.streams
            or open_now >= host.services.sessions
            or len(network.ends) > MOST_STREAMS
        ):
            host.sockets.counters.dropped["stream-refused"] += 1
            network.post(port, lambda then: self.closes(near, then), now)
            return
        network.ends[far] = _End(port, near, peer[1], end.port)
        end.beyond = port

        def opened(then: int) -> None:
            if near in network.ends:
                self.tell(StreamOpened(end.port, near, 0, peer), then)

        network.post(port, opened, now)
        host.sockets.tell(StreamOpened(port, far, peer[1], own), now)

    def closes(self, number: int, now: int) -> None:
        """A stream's closing arrives at its end here."""
        end = self._network.ends.pop(number, None)
        if end is not None:
            self.tell(StreamClosed(end.port, number), now)

    def act(self, port: int, action: SocketAction) -> None:
        if isinstance(action, Datagram):
            self._send(port, action)
            return
        end = self._network.ends.get(action.stream)
        if end is None or end.port != port:
            self.counters.dropped["stream-closed"] += 1
        elif isinstance(action, StreamData):
            self._pass(action.stream, end, action.data)
        else:
            self._finish(action.stream, end)

    def _pass(self, number: int, end: _End, data: bytes) -> None:
        network = self._network
        port = end.port

        def arrives(now: int) -> None:
            other = network.ends.get(end.other)
            if other is None:
                self._unknown(number, end, now)
            elif not network.reach(port, other.port):
                self._wait(number, other, arrives, len(data), now)
            else:
                network.hosts[other.port].sockets.tell(StreamReceived(other.port, end.other, data), now)

        if data:
            network.post(port, arrives, self._clock())

    def _unknown(self, number: int, end: _End, now: int) -> None:
        """Octets came to a station that does not know the stream: it resets it, if it is there at all."""
        network = self._network
        if end.beyond in network.hosts and network.reach(end.port, end.beyond):
            network.post(end.port, lambda then: self.closes(number, then), now)

    def _wait(self, number: int, other: _End, arrives: Callable[[int], None], size: int, now: int) -> None:
        other.octets += size
        if other.octets > MOST_OCTETS:
            self.counters.dropped["slow-reader"] += 1
            self.closes(number, now)
            return
        other.waiting.append(arrives)

    def _finish(self, number: int, end: _End) -> None:
        network = self._network
        network.ends.pop(number, None)

        def arrives(now: int) -> None:
            other = network.ends.get(end.other)
            if other is None:
                return
            if not network.reach(end.port, other.port):
                other.waiting.append(arrives)
                return
            network.hosts[other.port].sockets.closes(end.other, now)

        network.post(end.port, arrives, self._clock())

    def _send(self, port: int, action: Datagram) -> None:
        network = self._network
        host = network.hosts.get(port)
        if host is None:
            self.counters.dropped["no-address"] += 1
            return
        to, service = action.peer
        own = (host.services.address.ip, action.service)

        def arrives(now: int) -> None:
            for index, other in list(network.hosts.items()):
                known = other.services
                wanted = to in {known.address.ip, _LIMITED_BROADCAST, known.address.network.broadcast_address}
                if index == port or not wanted or service not in known.datagrams or not network.reach(port, index):
                    continue
                other.sockets.tell(DatagramReceived(index, service, own, action.data, to != known.address.ip), now)

        network.post(port, arrives, self._clock())
