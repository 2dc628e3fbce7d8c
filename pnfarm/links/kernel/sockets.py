"""Streams and datagrams of stations over sockets of the kernel's, each bound to the station's interface and address.

Sockets are read and written in the event loop's callbacks.  A withdrawn station is silent at once: its address goes
first (:mod:`pnfarm.links.kernel.network`), so that the kernel answers nothing more, then each stream is closed in
repair mode (``TCP_REPAIR``), which sends neither FIN nor RST.  Its peers notice by their own time-outs, or by a reset
once the address is there again.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import fcntl
import socket
import struct
import time
from dataclasses import dataclass, field
from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.links.kernel import network
from pnfarm.links.sockets import MOST_OCTETS, MOST_STREAMS
from pnfarm.wire.endpoint import (
    Datagram,
    DatagramReceived,
    StreamClosed,
    StreamData,
    StreamOpened,
    StreamReceived,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.links.base import LinkCounters, Port
    from pnfarm.links.sockets import SocketUser
    from pnfarm.wire.endpoint import Peer, Services, SocketAction, SocketEvent

__all__ = ["KernelSockets"]

# linux/in.h, linux/tcp.h, linux/sockios.h
_IP_FREEBIND = 15
_IP_PKTINFO = 8
_TCP_REPAIR = 19
_SIOCGARP = 0x8954
_ATF_COM = 0x02
#: Interface, local address, and that of the header.
_PKTINFO = struct.Struct("=i4s4s")
_MEMBERSHIP = struct.Struct("=4s4si")  # ip_mreqn
_TOLD = socket.CMSG_SPACE(_PKTINFO.size)

#: Octets read of one stream, and datagrams of one socket, before the others have their turn.
_AT_ONCE = 16384
_DATAGRAMS = 32
_LARGEST = 65536
#: How long a peer may take to acknowledge what was sent, or to make room for it; then the stream is lost.
_UNANSWERED_MS = 20_000
#: Streams that the kernel keeps for a listener before they are accepted.
_BACKLOG = 32
#: Errors of one connection or datagram, not of the socket.
_PASSING = (BlockingIOError, InterruptedError, ConnectionError)


@dataclass(slots=True, eq=False)
class _Stream:
    port: int
    socket: socket.socket
    peer: Peer
    opening: bool = False
    ending: bool = False
    writing: bool = False
    out: bytearray = field(default_factory=bytearray)


@dataclass(slots=True, eq=False)
class _Host:
    name: str
    services: Services
    #: Whether the address is given and taken here.
    attached: bool
    listeners: list[socket.socket] = field(default_factory=list)
    datagrams: dict[int, socket.socket] = field(default_factory=dict)
    silent: list[socket.socket] = field(default_factory=list)
    streams: set[int] = field(default_factory=set)
    #: One socket for each group: the kernel bounds the groups of a socket.
    groups: dict[IPv4Address, socket.socket] = field(default_factory=dict)


def _unopened(host: _Host, exc: OSError) -> EnvironmentError_:
    where = f"{host.services.address.ip} at {host.name}"
    return EnvironmentError_(f"a port of {where} cannot be opened: {exc.strerror}; is it another program's?")


def _require(address: IPv4Address, interface: str) -> None:
    """Raises :class:`~pnfarm.errors.EnvironmentError_` where the kernel does not have this address."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.bind((str(address), 0))
    except OSError as exc:
        if exc.errno != errno.EADDRNOTAVAIL:
            raise EnvironmentError_(f"{address} at {interface} cannot be tried: {exc.strerror}") from exc
        raise EnvironmentError_(
            f"{address} is no address of this machine, and {interface} is not changed: `ip addr add "
            f"{address}/PREFIX dev {interface}`, or take the address that it has"
        ) from exc


class KernelSockets:
    """See :class:`pnfarm.links.sockets.SocketCarrier`.

    ``own``: whether the ports' interfaces are the link's own; on another's the address is the kernel's already.
    """

    answers_arp = True

    def __init__(self, counters: LinkCounters, *, own: bool = True) -> None:
        self._counters = counters
        self._own = own
        self._ports: dict[int, Port] = {}
        self._hosts: dict[int, _Host] = {}
        self._streams: dict[int, _Stream] = {}
        self._last = 0
        self._user: SocketUser | None = None
        self._asker: socket.socket | None = None
        #: For how many seconds the kernel has an address unless it is renewed; 0: for ever.
        self._lifetime = 0

    def open(self, ports: Sequence[Port]) -> None:
        """These ports may have addresses."""
        self._ports = {port.index: port for port in ports}

    def close(self) -> None:
        """The link closes: streams end in order, then the addresses go."""
        for port in list(self._hosts):
            self._remove(port, silent=False)
        if self._asker is not None:
            self._asker.close()
            self._asker = None

    def restore(self, port: int) -> None:
        """The interface was down and is up again: the kernel forgot the routes of its address."""
        host = self._hosts.get(port)
        if host is not None and host.attached:
            services = host.services
            network.attach(port, host.name, services.address, services.gateway, self._lifetime)

    def set_lifetime(self, seconds: int) -> None:
        """Let every address end by itself in so many seconds, unless this is called again before."""
        self._lifetime = seconds
        own = [(port, host.services.address) for port, host in self._hosts.items() if host.attached]
        if own and (refused := network.renew(own, seconds)):
            # the interface is down, or was removed under the running farm, which its link reports
            self._counters.dropped["address-not-renewed"] += refused

    def set_user(self, user: SocketUser) -> None:
        self._user = user

    # -- a station comes and goes

    def serve(self, port: int, services: Services) -> None:
        self.withdraw(port)
        known = self._ports.get(port)
        if known is None:
            raise InternalError(f"this link has no port {port}")
        if self._own:
            network.attach(port, known.name, services.address, services.gateway, self._lifetime)
        else:
            _require(services.address.ip, known.name)
        host = self._hosts[port] = _Host(known.name, services, self._own)
        try:
            self._listen(port, host)
        except OSError as exc:
            self.withdraw(port)
            raise _unopened(host, exc) from exc

    def _listen(self, port: int, host: _Host) -> None:
        loop = asyncio.get_running_loop()
        services = host.services
        self._listen_for_streams(port, host)
        for service in services.datagrams:
            # any address of the interface: broadcasts, too
            sock = host.datagrams[service] = self._socket(socket.SOCK_DGRAM, host)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            sock.setsockopt(socket.IPPROTO_IP, _IP_PKTINFO, 1)
            sock.bind(("", service))
            loop.add_reader(sock, self._read_datagrams, port, sock, service, services.address.ip.packed)
        for service in services.silent:
            sock = self._socket(socket.SOCK_DGRAM, host)
            host.silent.append(sock)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
            sock.bind(("", service))

    def _listen_for_streams(self, port: int, host: _Host) -> None:
        for service in host.services.streams:
            sock = self._socket(socket.SOCK_STREAM, host)
            host.listeners.append(sock)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            sock.bind((str(host.services.address.ip), service))
            sock.listen(_BACKLOG)
            asyncio.get_running_loop().add_reader(sock, self._accept, port, host, sock, service)

    def refuse(self, port: int, *, refused: bool) -> None:
        """Without a listener, the kernel answers with a reset."""
        host = self._hosts.get(port)
        if host is None:
            return
        for sock in host.listeners:
            asyncio.get_running_loop().remove_reader(sock)
            sock.close()
        host.listeners.clear()
        if refused:
            return
        try:
            self._listen_for_streams(port, host)
        except OSError as exc:
            raise _unopened(host, exc) from exc

    def serves(self, port: int) -> bool:
        return port in self._hosts

    @staticmethod
    def _socket(kind: int, host: _Host) -> socket.socket:
        sock = socket.socket(socket.AF_INET, kind | socket.SOCK_NONBLOCK)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, host.name.encode())
        sock.setsockopt(socket.IPPROTO_IP, _IP_FREEBIND, 1)
        return sock

    def withdraw(self, port: int) -> None:
        self._remove(port, silent=True)

    def _remove(self, port: int, *, silent: bool) -> None:
        host = self._hosts.pop(port, None)
        if host is None:
            return
        if silent and host.attached:
            self._detach(port, host)
        loop = asyncio.get_running_loop()
        for number in list(host.streams):
            self._drop(number, host, silent=silent)
        for sock in (*host.listeners, *host.datagrams.values(), *host.silent, *host.groups.values()):
            loop.remove_reader(sock)
            sock.close()
        if not silent and host.attached:
            self._detach(port, host)

    def _detach(self, port: int, host: _Host) -> None:
        try:
            network.detach(port, host.name, host.services.address)
        except EnvironmentError_:
            # the interface was removed under the running farm, which its link reports
            self._counters.dropped["address-stays"] += 1

    def _drop(self, number: int, host: _Host | None, *, silent: bool = False) -> None:
        stream = self._streams.pop(number, None)
        if stream is None:
            return
        if host is not None:
            host.streams.discard(number)
        loop = asyncio.get_running_loop()
        loop.remove_reader(stream.socket)
        loop.remove_writer(stream.socket)
        if silent:
            # a stream that is not open yet has nothing to repair
            with contextlib.suppress(OSError):
                stream.socket.setsockopt(socket.IPPROTO_TCP, _TCP_REPAIR, 1)
        stream.socket.close()

    # -- streams

    def _add(self, port: int, host: _Host, sock: socket.socket, peer: Peer, *, opening: bool) -> int:
        self._last += 1
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # the kernel's own patience is a quarter of an hour, and without end for a peer that only does not read
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED_MS)
        self._streams[self._last] = _Stream(port, sock, peer, opening)
        host.streams.add(self._last)
        return self._last

    def _accept(self, port: int, host: _Host, listener: socket.socket, service: int) -> None:
        for _ in range(_BACKLOG):
            try:
                sock, (address, number) = listener.accept()
            except _PASSING:
                return
            except OSError as exc:
                # no file or memory left: the others wait in the kernel
                self._counters.dropped[f"accept-{errno.errorcode.get(exc.errno or 0, 'failed').lower()}"] += 1
                return
            if len(host.streams) >= host.services.sessions or len(self._streams) >= MOST_STREAMS:
                self._counters.dropped["stream-refused"] += 1
                sock.close()
                continue
            sock.setblocking(False)
            peer = (IPv4Address(address), int(number))
            stream = self._add(port, host, sock, peer, opening=False)
            asyncio.get_running_loop().add_reader(sock, self._read, stream)
            self._tell(StreamOpened(port, stream, service, peer))

    def connect(self, port: int, peer: Peer) -> int:
        host = self._hosts.get(port)
        if host is None:
            raise InternalError(f"port {port} has no address to open a stream from")
        loop = asyncio.get_running_loop()
        try:
            sock = self._socket(socket.SOCK_STREAM, host)
        except OSError as exc:
            # no file or memory left
            self._counters.dropped[f"connect-{errno.errorcode.get(exc.errno or 0, 'failed').lower()}"] += 1
            self._last += 1
            loop.call_soon(self._tell, StreamClosed(port, self._last))
            return self._last
        number = self._add(port, host, sock, peer, opening=True)
        try:
            sock.bind((str(host.services.address.ip), 0))
            sock.connect((str(peer[0]), peer[1]))
        except OSError as exc:
            if exc.errno != errno.EINPROGRESS:
                loop.call_soon(self._lost, number)
                return number
        loop.add_writer(sock, self._connected, number)
        return number

    def _connected(self, number: int) -> None:
        stream = self._streams.get(number)
        if stream is None:
            return
        loop = asyncio.get_running_loop()
        loop.remove_writer(stream.socket)
        if stream.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            self._lost(number)
            return
        stream.opening = False
        if not stream.ending:
            loop.add_reader(stream.socket, self._read, number)
            self._tell(StreamOpened(stream.port, number, 0, stream.peer))
        self._write(number)

    def _lost(self, number: int) -> None:
        stream = self._streams.get(number)
        if stream is None:
            return
        self._drop(number, self._hosts.get(stream.port))
        if not stream.ending:
            self._tell(StreamClosed(stream.port, number))

    def _broke(self, number: int, error: OSError) -> None:
        if error.errno == errno.ETIMEDOUT:
            self._counters.dropped["unanswered"] += 1
        self._lost(number)

    def _read(self, number: int) -> None:
        stream = self._streams.get(number)
        if stream is None:
            return
        try:
            data = stream.socket.recv(_AT_ONCE)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as exc:
            self._broke(number, exc)
            return
        if not data:
            self._lost(number)
        elif not stream.ending:
            self._tell(StreamReceived(stream.port, number, data))

    def _write(self, number: int) -> None:
        """Send what waits; what is left waits for room in the kernel's buffer."""
        stream = self._streams.get(number)
        if stream is None or stream.opening:
            return
        try:
            while stream.out:
                del stream.out[: stream.socket.send(stream.out)]
        except (BlockingIOError, InterruptedError):
            pass
        except OSError as exc:
            self._broke(number, exc)
            return
        if stream.ending and not stream.out:
            self._drop(number, self._hosts.get(stream.port))
            return
        if bool(stream.out) == stream.writing:
            return
        stream.writing = bool(stream.out)
        loop = asyncio.get_running_loop()
        if stream.writing:
            loop.add_writer(stream.socket, self._write, number)
        else:
            loop.remove_writer(stream.socket)

    # -- what a station sends

    def act(self, port: int, action: SocketAction) -> None:
        if isinstance(action, Datagram):
            self._send(port, action)
            return
        stream = self._streams.get(action.stream)
        if stream is None or stream.port != port or stream.ending:
            self._counters.dropped["stream-closed"] += 1
            return
        if isinstance(action, StreamData):
            if len(stream.out) + len(action.data) > MOST_OCTETS:
                self._counters.dropped["slow-reader"] += 1
                asyncio.get_running_loop().call_soon(self._lost, action.stream)
                return
            stream.out += action.data
        else:
            stream.ending = True
        self._write(action.stream)

    def _send(self, port: int, action: Datagram) -> None:
        host = self._hosts.get(port)
        sock = None if host is None else host.datagrams.get(action.service)
        if host is None or sock is None:
            self._counters.dropped["no-address"] += 1
            return
        # the source address chooses the route
        source = _PKTINFO.pack(0, host.services.address.ip.packed, bytes(4))
        try:
            sock.sendmsg(
                [action.data], [(socket.IPPROTO_IP, _IP_PKTINFO, source)], 0, (str(action.peer[0]), action.peer[1])
            )
        except OSError as exc:
            self._counters.dropped[f"datagram-{errno.errorcode.get(exc.errno or 0, 'refused').lower()}"] += 1

    def _read_datagrams(self, port: int, sock: socket.socket, service: int, own: bytes) -> None:
        for _ in range(_DATAGRAMS):
            try:
                data, told, _, (address, number) = sock.recvmsg(_LARGEST, _TOLD)
            except _PASSING:
                return
            except OSError as exc:
                self._counters.dropped[f"datagram-{errno.errorcode.get(exc.errno or 0, 'refused').lower()}"] += 1
                return
            broadcast = any(kind == _IP_PKTINFO and _PKTINFO.unpack(info)[2] != own for _, kind, info in told)
            peer = (IPv4Address(address), int(number))
            self._tell(DatagramReceived(port, service, peer, data, broadcast))
            if sock.fileno() < 0:
                # its station lost its supply over what it received
                return

    def _tell(self, event: SocketEvent) -> None:
        if self._user is not None:
            self._user(event, time.monotonic_ns())

    # -- groups and neighbours

    def join(self, port: int, group: IPv4Address) -> None:
        host = self._hosts.get(port)
        if host is None:
            self._counters.dropped["no-address"] += 1
            return
        if group in host.groups:
            return
        request = _MEMBERSHIP.pack(group.packed, host.services.address.ip.packed, port)
        sock: socket.socket | None = None
        try:
            sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            sock.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, request)
        except OSError as exc:
            if sock is not None:
                sock.close()
            self._counters.dropped[f"group-{errno.errorcode.get(exc.errno or 0, 'refused').lower()}"] += 1
            return
        host.groups[group] = sock

    def leave(self, port: int, group: IPv4Address) -> None:
        host = self._hosts.get(port)
        sock = None if host is None else host.groups.pop(group, None)
        if sock is not None:
            sock.close()

    def next_hop(self, port: int, address: IPv4Address) -> bytes | None:
        host = self._hosts.get(port)
        if host is None:
            return None
        services = host.services
        if address not in services.address.network:
            if services.gateway is None:
                return None
            address = services.gateway
        request = struct.pack("=HH4s8s", socket.AF_INET, 0, address.packed, bytes(8)) + bytes(16 + 4 + 16)
        request += host.name.encode().ljust(16, b"\0")
        try:
            if self._asker is None:
                self._asker = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            answer = fcntl.ioctl(self._asker, _SIOCGARP, request)
        except OSError:
            return None
        flags = int.from_bytes(answer[32:36], "little")
        return bytes(answer[18:24]) if flags & _ATF_COM else None
