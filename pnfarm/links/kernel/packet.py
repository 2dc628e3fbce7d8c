"""AF_PACKET sockets of a whole farm: one per ethertype, for all interfaces of the namespace.

A socket per interface would cost one wake-up per drive and frame; these are bound to no interface,
their filter (:mod:`pnfarm.links.kernel.bpf`) keeps the farm's interfaces, and the index in each message's
``sockaddr_ll`` says which drive a frame is for.  One ``recvmmsg`` takes a batch; the batch is bounded, so that a
storm on one ethertype does not starve the event loop: what is left waits in the kernel's queue.

A macvlan receives only multicast addresses that were joined: the memberships are held by a socket here, and go with it.

Interfaces that share a cable (macvlans on a NIC) get a copy of each group-addressed frame.  One of them is the farm's
group receiver: the filter drops the copies of all others, and what it hears is handed only to the ports that it can
concern (:meth:`PacketSockets.set_audience`).  What a port sends to a group never comes back to its interface, so that
the others get it here; the filter knows the kernel's copy by the mark of the sending socket.

LLDP is between two ends of one cable.  Drives that share an interface (macvlans on a NIC) have one cable together: its
LLDP is received once, on that interface, and handed to each of them; they do not receive each other's, as behind a
real switch.  Drives with their own cables (veth) receive what comes through, but not each other where a bridge forwards
LLDP: the filter drops what carries the sending socket's mark, and what lost it on its way is dropped by its address.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import errno
import fcntl
import os
import socket
import struct
import time
from typing import TYPE_CHECKING

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.links.base import MULTICAST_DCP_IDENTIFY, MULTICAST_LLDP, Audience, LinkCounters, Port, Receiver
from pnfarm.links.kernel import bpf
from pnfarm.wire.ethernet import ETHERTYPE_ARP, ETHERTYPE_IPV4, ETHERTYPE_LLDP, ETHERTYPE_PROFINET

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

__all__ = ["BATCH", "MULTICAST_GROUPS", "PacketSockets", "bind_socket", "open_packet_socket"]

# linux/if_packet.h
_SOL_PACKET = 263
_PACKET_ADD_MEMBERSHIP = 1
_PACKET_STATISTICS = 6
_SIOCGIFNAME = 0x8910  # linux/sockios.h
_PACKET_IGNORE_OUTGOING = 23
_PACKET_MR_MULTICAST = 0
_SO_RCVBUFFORCE = 33
_SO_MARK = 36

#: Frames taken per socket and wake-up of the event loop.
BATCH = 64
#: Octets of receive queue per socket: a DCP Identify reaches each of 1,024 drives as a copy of its own, 800 octets.
RECEIVE_BUFFER = 16 * 1024 * 1024
#: The multicast address that every port joins; LLDP is handled apart.
MULTICAST_GROUPS = (MULTICAST_DCP_IDENTIFY,)

#: Ethertypes as in a frame.
_IPV4, _LLDP = (ethertype.to_bytes(2, "big") for ethertype in (ETHERTYPE_IPV4, ETHERTYPE_LLDP))
_SLOT = 2048
_ADDRESS_SLOT = 32
_SOCKADDR_LL = struct.Struct("=HHiHBB8s")
_SOCKADDR_LL_IFINDEX = struct.Struct("=i")

_SEND_REASONS = {
    errno.ENETDOWN: "interface-down",
    errno.ENXIO: "interface-down",
    errno.ENODEV: "interface-down",
    errno.EAGAIN: "queue-full",
    errno.ENOBUFS: "queue-full",
    errno.EMSGSIZE: "too-long",
}

_libc = ctypes.CDLL(None, use_errno=True)


class _Iovec(ctypes.Structure):
    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _Msghdr(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint32),
        ("iov", ctypes.POINTER(_Iovec)),
        ("iov_length", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _Mmsghdr(ctypes.Structure):
    _fields_ = (("header", _Msghdr), ("length", ctypes.c_uint))


def _raw_socket() -> socket.socket:
    """A non-blocking raw socket that receives nothing yet.  Raises :class:`EnvironmentError_` without CAP_NET_RAW."""
    try:
        return socket.socket(socket.AF_PACKET, socket.SOCK_RAW | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC, 0)
    except PermissionError as exc:
        raise EnvironmentError_(
            "raw Ethernet sockets need CAP_NET_RAW in this network namespace: run as root, or try `pnfarm demo`, "
            "which brings a namespace of its own"
        ) from exc


def bind_socket(sock: socket.socket, ethertype: int, index: int = 0) -> None:
    """Receive from now on; Python's own bind() asks for an interface's name, ``index`` 0 is all of them."""
    address = _SOCKADDR_LL.pack(socket.AF_PACKET, socket.htons(ethertype), index, 0, 0, 0, bytes(8))
    if _libc.bind(sock.fileno(), address, len(address)) != 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


def open_packet_socket(ethertype: int, filter_code: bytes, *, index: int = 0) -> socket.socket:
    """A non-blocking raw socket that receives ``ethertype`` through ``filter_code``.

    ``index`` is the only interface that it receives from; 0 means all, which costs time for every frame of the
    namespace.

    It is bound only after the filter is in place, so no foreign frame ever enters its queue.
    Raises :class:`~pnfarm.errors.EnvironmentError_` without CAP_NET_RAW.
    """
    sock = _raw_socket()
    try:
        bpf.attach(sock, filter_code)
        with contextlib.suppress(OSError):  # before Linux 4.20: the filter drops outgoing frames as well
            sock.setsockopt(_SOL_PACKET, _PACKET_IGNORE_OUTGOING, 1)
        try:
            sock.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, RECEIVE_BUFFER)
        except PermissionError:  # in a user namespace only as much as net.core.rmem_max allows
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        bind_socket(sock, ethertype, index)
    except OSError as exc:
        sock.close()
        raise EnvironmentError_(f"the packet socket for ethertype 0x{ethertype:04X} failed: {exc.strerror}") from exc
    return sock


#: Errors of a read that has nothing to give now: the next one may.
_NOTHING_NOW = frozenset({errno.EAGAIN, errno.EINTR, errno.ENETDOWN, errno.ENOBUFS, errno.ENOMEM})


class _BatchReader:
    """``recvmmsg`` into fixed slots; one per socket."""

    def __init__(self, sock: socket.socket, batch: int) -> None:
        self._fd = sock.fileno()
        self._batch = batch
        self._data = (ctypes.c_char * (_SLOT * batch))()
        self._names = (ctypes.c_char * (_ADDRESS_SLOT * batch))()
        self._iovecs = (_Iovec * batch)()
        self._headers = (_Mmsghdr * batch)()
        data, names = ctypes.addressof(self._data), ctypes.addressof(self._names)
        for i in range(batch):
            self._iovecs[i] = _Iovec(data + i * _SLOT, _SLOT)
            header = self._headers[i].header
            header.name = names + i * _ADDRESS_SLOT
            header.name_length = _ADDRESS_SLOT
            header.iov = ctypes.pointer(self._iovecs[i])
            header.iov_length = 1

    def read(self) -> list[tuple[int, bytes | None]]:
        """(interface index, frame) of what waits, at most one batch; None for a frame longer than a slot."""
        count = _libc.recvmmsg(self._fd, self._headers, self._batch, socket.MSG_DONTWAIT, None)
        if count < 0:
            code = ctypes.get_errno()
            if code in _NOTHING_NOW:
                return []
            raise OSError(code, os.strerror(code))
        data, names = memoryview(self._data), memoryview(self._names)
        frames: list[tuple[int, bytes | None]] = []
        for i in range(count):
            message = self._headers[i]
            (index,) = _SOCKADDR_LL_IFINDEX.unpack_from(names, i * _ADDRESS_SLOT + 4)
            if message.header.flags & socket.MSG_TRUNC:
                frames.append((index, None))
            else:
                frames.append((index, bytes(data[i * _SLOT : i * _SLOT + message.length])))
        return frames


class PacketSockets:
    """Receives and sends the acyclic frames of a set of ports.

    ``counters`` is written here.
    """

    def __init__(self, counters: LinkCounters) -> None:
        self._counters = counters
        self._names: dict[int, str] = {}
        self._receiver: Receiver | None = None
        self._sockets: list[socket.socket] = []
        #: The engine's, which closes them: here they are only asked what they lost.
        self._engines: list[socket.socket] = []
        self._profinet: socket.socket | None = None
        self._sender: socket.socket | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._macs: dict[int, bytes] = {}
        self._pulled: set[int] = set()
        self._kernel: frozenset[int] = frozenset()
        #: The interface that hears group-addressed frames for all, None where each hears its own.
        self._group_receiver: bpf.GroupReceiver | None = None
        self._audience: Audience | None = None
        #: Sockets whose filter names the group receiver, each with what makes its filter.
        self._filters: list[tuple[socket.socket, Callable[[bpf.GroupReceiver | None], bytes]]] = []

    def set_audience(self, audience: Audience | None) -> None:
        """Ask ``audience`` which ports a group-addressed frame of the shared cable goes to; None: to all of them."""
        self._audience = audience

    def set_receiver(self, receiver: Receiver) -> None:
        self._receiver = receiver

    def open(self, ports: Sequence[Port], *, shared: int | None = None, kernel: Collection[int] = ()) -> None:
        """Open the sockets and watch them in the running event loop.

        ``shared`` is the index of the interface that all ports have in common: their one cable.  IPv4 of the ports
        ``kernel`` is the kernel's own, which also answers ARP there.
        """
        self._kernel = frozenset(kernel)
        self._names = {port.index: port.name for port in ports}
        self._macs = {port.index: port.mac for port in ports}
        lowest, highest = min(self._names), max(self._names)
        try:
            # protocol 0: this one never receives
            self._sender = _raw_socket()
            self._choose_group_receiver(shared)
            self._profinet = profinet = self._watch(
                ETHERTYPE_PROFINET, lambda group_receiver: bpf.acyclic_filter(lowest, highest, group_receiver)
            )
            runs = bpf.runs_of(self._kernel, self._names)
            self._watch(
                ETHERTYPE_ARP,
                lambda group_receiver: bpf.ethertype_filter(lowest, highest, group_receiver=group_receiver),
            )
            if self._kernel < self._names.keys():
                self._watch(
                    ETHERTYPE_IPV4,
                    lambda group_receiver: bpf.ethertype_filter(
                        lowest, highest, without=runs, group_receiver=group_receiver
                    ),
                    self._hand_over_unless,
                )
            for index in self._names:
                for group in MULTICAST_GROUPS:
                    _join(profinet, index, group)
            self._open_lldp(self._sender, shared)
        except BaseException:
            self.close()
            raise

    def _open_lldp(self, sender: socket.socket, shared: int | None) -> None:
        if shared is not None:
            sock = open_packet_socket(ETHERTYPE_LLDP, bpf.ethertype_filter(shared, shared), index=shared)
            self._read_from(sock, self._deliver_shared_cable)
            _join(sock, shared, MULTICAST_LLDP)
            return
        # without CAP_NET_ADMIN siblings are distinguished by address only
        mark = _mark(sender) if len(self._names) > 1 else 0
        code = bpf.ethertype_filter(min(self._names), max(self._names), mark=mark)
        sock = open_packet_socket(ETHERTYPE_LLDP, code, index=self._only_port)
        self._read_from(sock, self._deliver_own_cable)
        for index in self._names:
            _join(sock, index, MULTICAST_LLDP)

    def _choose_group_receiver(self, shared: int | None) -> None:
        """One interface hears for all that share a cable, unless the kernel speaks there, too: its ARP has no mark."""
        able = [index for index in self._names if index not in self._kernel]
        if shared is None or len(able) < 2 or self._sender is None:
            return
        if mark := _mark(self._sender):
            self._group_receiver = bpf.GroupReceiver(able[0], mark)

    def _move_group_receiver(self) -> None:
        """The group receiver lost its carrier, or has it again while no other one has it."""
        if self._group_receiver is None or self._group_receiver.index not in self._pulled:
            return
        able = [index for index in self._names if index not in self._kernel and index not in self._pulled]
        if able:
            self._group_receiver = bpf.GroupReceiver(able[0], self._group_receiver.mark)
            for sock, filter_of in self._filters:
                bpf.attach(sock, filter_of(self._group_receiver))

    def _watch(
        self,
        ethertype: int,
        filter_of: Callable[[bpf.GroupReceiver | None], bytes],
        hand_over: Callable[[int, bytes | None, int], None] | None = None,
    ) -> socket.socket:
        sock = open_packet_socket(ethertype, filter_of(self._group_receiver), index=self._only_port)
        self._filters.append((sock, filter_of))
        return self._read_from(sock, hand_over or self._hand_over)

    def _read_from(self, sock: socket.socket, hand_over: Callable[[int, bytes | None, int], None]) -> socket.socket:
        self._sockets.append(sock)
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sock.fileno(), self._reader_of(_BatchReader(sock, BATCH), hand_over))
        return sock

    def _reader_of(
        self, reader: _BatchReader, hand_over: Callable[[int, bytes | None, int], None]
    ) -> Callable[[], None]:
        def receive_batch() -> None:
            now = time.monotonic_ns()
            for index, frame in reader.read():
                hand_over(index, frame, now)

        return receive_batch

    def _hand_over(self, index: int, frame: bytes | None, now: int) -> None:
        # an interface of someone else may lie between the farm's first and last index
        if index not in self._names:
            return
        if frame is None:
            self._counters.dropped["too-long"] += 1
            return
        if self._group_receiver is not None and frame[0] & 1:
            self._share(frame, now)
        else:
            self._deliver(index, frame, now)

    def _deliver(self, index: int, frame: bytes, now: int) -> None:
        """A frame for this port."""
        self._counters.received += 1
        if self._receiver is not None:
            self._receiver(index, frame, now)

    def _share(self, frame: bytes, now: int, sender: int | None = None) -> None:
        """Hand a group-addressed frame of the one cable to the ports that it concerns, but not to its ``sender``."""
        audience = None if self._audience is None else self._audience(frame)
        kernels = self._kernel if frame[12:14] == _IPV4 else ()
        source = frame[6:12]
        for index in list(self._names) if audience is None else audience:
            # the kernel of a drive with sockets sends there itself, under the drive's address
            if index == sender or index in self._pulled or index in kernels or self._macs.get(index) == source:
                continue
            self._deliver(index, frame, now)

    def _send_to_siblings(self, frame: bytes, sender: int) -> None:
        """The other ports of the cable hear what one of them sent to a group."""
        if self._sender is not None:
            self._share(frame, time.monotonic_ns(), sender)

    def _hand_over_unless(self, index: int, frame: bytes | None, now: int) -> None:
        """A frame that may be the kernel's."""
        if index not in self._kernel:
            self._hand_over(index, frame, now)

    def _deliver_own_cable(self, index: int, frame: bytes | None, now: int) -> None:
        """An LLDP frame of a port's own cable."""
        if frame is not None and frame[6:12] in self._macs.values():
            self._counters.dropped["own-lldp"] += 1
        else:
            self._hand_over(index, frame, now)

    def _deliver_shared_cable(self, _shared: int, frame: bytes | None, now: int) -> None:
        """An LLDP frame of the one cable that all ports have in common."""
        if frame is None:
            self._counters.dropped["too-long"] += 1
            return
        for index in list(self._names):
            if index not in self._pulled:
                self._deliver(index, frame, now)

    def set_pulled(self, index: int, pulled: bool) -> None:
        """A port without carrier gets nothing of a shared cable, and does not hear for others."""
        if pulled:
            self._pulled.add(index)
        else:
            self._pulled.discard(index)
        self._move_group_receiver()

    def set_mac(self, index: int, mac: bytes) -> None:
        """Set the port's address."""
        self._macs[index] = mac

    def has_interface(self, index: int) -> bool:
        """Whether the kernel still has this interface; asked by an open socket, so that it takes no further file."""
        if self._sender is None:
            return False
        try:
            fcntl.ioctl(self._sender, _SIOCGIFNAME, struct.pack("16si20x", b"", index))
        except OSError as exc:
            # other shortages of the kernel say nothing about the interface
            return exc.errno not in {errno.ENODEV, errno.ENXIO}
        return True

    def send(self, port_index: int, frame: bytes, through: str | None = None) -> None:
        """Send now or count why not; ``through``: an interface other than the port's own."""
        name = self._names.get(port_index)
        if name is None or self._sender is None:
            self._counters.dropped["unknown-port"] += 1
            return
        try:
            self._sender.sendto(frame, (through or name, 0))
        except OSError as exc:
            if through is not None:
                # it may have another name by now
                self.send(port_index, frame)
                return
            self._counters.dropped[_SEND_REASONS.get(exc.errno or 0, "refused")] += 1
        else:
            self._counters.sent += 1
            if self._group_receiver is not None and frame[0] & 1 and frame[12:14] != _LLDP and self._loop is not None:
                # not at once: what it causes must not begin before the sender has finished
                self._loop.call_soon(self._send_to_siblings, frame, port_index)

    def engine_socket(self) -> socket.socket:
        """See :meth:`pnfarm.links.base.EngineLink.engine_socket`."""
        if self._profinet is None:
            raise InternalError("the engine's socket can be opened only after the link's ports are up")
        filter_code = bpf.cyclic_filter(min(self._names), max(self._names))
        sock = open_packet_socket(ETHERTYPE_PROFINET, filter_code, index=self._only_port)
        with contextlib.suppress(OSError):  # without fanout both sockets filter each frame: correct, but slower
            bpf.join_fanout(self._profinet, sock)
        self._engines.append(sock)
        return sock

    def engine_datagrams(self, service: int) -> socket.socket | None:
        """A second socket for the engine: datagrams to a UDP port of the ports ``kernel``; None without such ports."""
        if not self._kernel:
            return None
        code = bpf.datagram_filter(min(self._kernel), max(self._kernel), service)
        sock = open_packet_socket(ETHERTYPE_IPV4, code, index=self._only_port)
        self._engines.append(sock)
        return sock

    @property
    def _only_port(self) -> int:
        """The interface index of a link with a single port, 0 for several."""
        return next(iter(self._names)) if len(self._names) == 1 else 0

    def collect_overflows(self) -> None:
        """Add frames that the kernel dropped because a receive queue or ring was full to the counters."""
        self._engines = [sock for sock in self._engines if sock.fileno() >= 0]
        for sock in (*self._sockets, *self._engines):
            _packets, drops = struct.unpack("II", sock.getsockopt(_SOL_PACKET, _PACKET_STATISTICS, 8))
            if drops:
                self._counters.dropped["receive-overflow"] += drops

    def close(self) -> None:
        for sock in self._sockets:
            if self._loop is not None and not self._loop.is_closed():
                self._loop.remove_reader(sock.fileno())
            sock.close()
        self._sockets.clear()
        self._engines.clear()
        self._filters.clear()
        self._group_receiver = None
        self._profinet = None
        if self._sender is not None:
            self._sender.close()
            self._sender = None
        self._names = {}
        self._macs = {}
        self._pulled.clear()
        self._kernel = frozenset()


def _mark(sender: socket.socket) -> int:
    """Mark what this socket sends, by a number of its own; 0 where the kernel does not permit it."""
    wanted = int.from_bytes(os.urandom(4), "little") | 1
    try:
        sender.setsockopt(socket.SOL_SOCKET, _SO_MARK, struct.pack("=I", wanted))
    except OSError:
        return 0
    return wanted


def _join(sock: socket.socket, index: int, group: bytes) -> None:
    request = struct.pack("=iHH8s", index, _PACKET_MR_MULTICAST, len(group), group)
    try:
        sock.setsockopt(_SOL_PACKET, _PACKET_ADD_MEMBERSHIP, request)
    except OSError as exc:
        raise EnvironmentError_(
            f"multicast group {group.hex(':')} at interface {index} was refused by the kernel: {exc.strerror}"
        ) from exc
