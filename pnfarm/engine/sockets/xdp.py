"""Frames sent past the kernel's queueing and its captures: an AF_XDP socket on one interface.

The kernel copies each frame from memory that both share (*umem*), makes a packet of it and hands that to the
interface's driver (Documentation/networking/af_xdp.rst, copy mode: any interface, no program is loaded).  What a packet
socket does besides is left out: a message's header, routing, the queueing discipline, and the copies for those who
capture.  A frame costs two thirds.  For the same reason ``tcpdump`` on that interface does not show it.

A frame's place in umem is that of its descriptor.  All indexes are the kernel's: 32 bits, counted on for ever::

    descriptor (struct xdp_desc): address of the frame in umem    length | options << 32
"""

from __future__ import annotations

import ctypes
import mmap
import os
import socket
import struct
from typing import Any, NamedTuple

import numpy as np

from pnfarm.engine.memory_order import acquire, release
from pnfarm.engine.sockets.libc import MSG_DONTWAIT, sendto
from pnfarm.errors import EnvironmentError_
from pnfarm.table.compiling.compiled import inlined

__all__ = ["XdpSocket", "forget_placed", "no_xdp", "open_xdp", "place_frame", "room", "send_placed"]

# linux/if_xdp.h
_AF_XDP = 44
_SOL_XDP = 283
_MMAP_OFFSETS, _TX_RING, _UMEM_REG, _UMEM_FILL_RING, _UMEM_COMPLETION_RING = 1, 3, 4, 5, 6
_COPY = 1 << 1
_PLACE_OF_TX, _PLACE_OF_COMPLETION = 0x8000_0000, 0x1_8000_0000
#: The least that the kernel takes.
CHUNK = 2048
FEWEST_PLACES, MOST_PLACES = 64, 8192
#: Frames that the kernel sends for one call at most (TX_BATCH_SIZE).
BATCH = 32


class XdpSocket(NamedTuple):
    """A socket and its rings; without one all arrays are of one element and ``interface`` is -1."""

    descriptor: int
    #: The index of the interface that frames leave through.
    interface: int
    memory: Any
    descriptors: Any
    #: Indexes of one element each: what was given to the kernel, what it took, what has left, what was seen of that.
    given: Any
    taken: Any
    left: Any
    seen: Any
    #: Index after the frames that were placed.
    placed: Any


def no_xdp() -> XdpSocket:
    """For an engine that sends by packet sockets alone."""
    index = np.zeros(1, np.uint32)
    return XdpSocket(
        -1, -1, np.zeros((1, CHUNK), np.uint8), np.zeros((1, 2), np.uint64), index, index, index, index,
        index,
    )  # fmt: skip


def open_xdp(interface: int, rows: int) -> tuple[XdpSocket, socket.socket]:
    """A socket for the frames of so many rows; the caller closes it.

    Raises :class:`EnvironmentError_` where the kernel has no AF_XDP or does not permit it.
    """
    places = min(MOST_PLACES, max(FEWEST_PLACES, 1 << (2 * rows - 1).bit_length()))
    try:
        opened = socket.socket(_AF_XDP, socket.SOCK_RAW | socket.SOCK_CLOEXEC, 0)
    except OSError as exc:
        raise EnvironmentError_(f"`send: xdp` needs AF_XDP, which this machine does not give: {exc.strerror}") from exc
    try:
        return _laid_out(opened, interface, places), opened
    except OSError as exc:
        opened.close()
        raise EnvironmentError_(f"`send: xdp` cannot be prepared for interface {interface}: {exc.strerror}") from exc
    except BaseException:
        opened.close()
        raise


def _laid_out(opened: socket.socket, interface: int, places: int) -> XdpSocket:
    umem = mmap.mmap(-1, places * CHUNK, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    memory = np.frombuffer(umem, np.uint8).reshape(places, CHUNK)
    opened.setsockopt(_SOL_XDP, _UMEM_REG, struct.pack("QQIIII", memory.ctypes.data, len(umem), CHUNK, 0, 0, 0))
    for ring in (_UMEM_FILL_RING, _UMEM_COMPLETION_RING, _TX_RING):
        opened.setsockopt(_SOL_XDP, ring, places)
    # struct xdp_mmap_offsets: producer, consumer, descriptors and flags of the rings rx, tx, fill and completion
    offsets = struct.unpack("16Q", opened.getsockopt(_SOL_XDP, _MMAP_OFFSETS, 128))
    tx, completion = offsets[4:8], offsets[12:16]
    given, taken, descriptors = _ring(opened, _PLACE_OF_TX, tx, np.uint64, (places, 2))
    left, seen, _ = _ring(opened, _PLACE_OF_COMPLETION, completion, np.uint64, (places,))
    _bind(opened, interface)
    return XdpSocket(opened.fileno(), interface, memory, descriptors, given, taken, left, seen, np.zeros(1, np.uint32))


def _ring(opened: socket.socket, place: int, offsets: tuple[int, ...], kind: Any, shape: tuple[int, ...]) -> Any:
    """Producer's index, consumer's index and entries of a ring."""
    producer, consumer, entries, _ = offsets
    count = int(np.prod(shape))
    octets = mmap.mmap(
        opened.fileno(), entries + count * np.dtype(kind).itemsize, flags=mmap.MAP_SHARED | mmap.MAP_POPULATE,
        offset=place,
    )  # fmt: skip
    return (
        np.frombuffer(octets, np.uint32, 1, producer),
        np.frombuffer(octets, np.uint32, 1, consumer),
        np.frombuffer(octets, kind, count, entries).reshape(shape),
    )


def _bind(opened: socket.socket, interface: int) -> None:
    # struct sockaddr_xdp, which Python's own bind does not know
    address = struct.pack("HHIII", _AF_XDP, _COPY, interface, 0, 0)
    if ctypes.CDLL(None, use_errno=True).bind(opened.fileno(), address, len(address)):
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


@inlined
def room(xdp: XdpSocket) -> int:
    """How many frames can be placed now; none while the kernel does not take those before."""
    if xdp.taken[0] != xdp.given[0]:
        sendto(xdp.descriptor, 0, 0, MSG_DONTWAIT, 0, 0)
        acquire()
        if xdp.taken[0] != xdp.given[0]:
            return 0
    left = xdp.left[0]
    acquire()
    xdp.seen[0] = left
    under_way = (np.int64(xdp.given[0]) - np.int64(left)) & 0xFFFF_FFFF
    return len(xdp.descriptors) - int(under_way)


@inlined
def place_frame(xdp: XdpSocket, frame: Any, length: int) -> None:
    """Copy one frame to where the kernel will find it; there is room."""
    placed = np.int64(xdp.placed[0])
    place = placed & (len(xdp.descriptors) - 1)
    memory = xdp.memory[place]
    for k in range(length):
        memory[k] = frame[k]
    xdp.descriptors[place, 0] = place * CHUNK
    xdp.descriptors[place, 1] = length
    xdp.placed[0] = (placed + 1) & 0xFFFF_FFFF


@inlined
def forget_placed(xdp: XdpSocket) -> None:
    """What was placed since the last :func:`send_placed` is not sent."""
    xdp.placed[0] = xdp.given[0]


@inlined
def send_placed(xdp: XdpSocket) -> int:
    """Have the kernel send what was placed; returns how many frames it did not take.

    Those leave when it takes frames again, once: an interface that was set down sends them when it is up.
    """
    placed = np.int64(xdp.placed[0])
    taken = np.int64(xdp.taken[0])
    # none was placed while older ones wait
    waiting = (placed - np.int64(xdp.given[0])) & 0xFFFF_FFFF
    if waiting == 0:
        return 0
    release()
    xdp.given[0] = placed
    for _ in range(waiting // BATCH + 1):
        before = taken
        sendto(xdp.descriptor, 0, 0, MSG_DONTWAIT, 0, 0)
        acquire()
        taken = np.int64(xdp.taken[0])
        if taken == before:
            break
    return int((placed - taken) & 0xFFFF_FFFF)
