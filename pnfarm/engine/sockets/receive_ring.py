"""Frames received into memory that the kernel shares: no system call, and no copy by the engine.

TPACKET_V2 (Documentation/networking/packet_mmap.rst): the kernel puts each frame that the socket's filter lets through
into the next slot of a ring, with its interface and its arrival, and sets the slot's status; the engine reads the
frame where it is and gives the slot back.  What finds no free slot is dropped and counted by the kernel.

A slot is short, and the ring no longer than it has to be, so that the ring stays in the processor's cache: with slots
for the longest frame and for 32 cycles, a frame cost a fifth more.  A frame that is too long for its slot is also in
the socket's queue, whole.

A slot, as in linux/if_packet.h; all numbers are the machine's own::

    status  length  captured  mac | net << 16  seconds  nanoseconds  tag  -     words of 32 bits
    family | protocol << 16  interface  ...                                     struct sockaddr_ll
    frame                                                                       at offset mac

The tag of a frame with a VLAN tag is not in the frame.
"""

from __future__ import annotations

import mmap
import socket
import struct
from typing import Any, NamedTuple

import numpy as np

from pnfarm.engine.columns import RX_BATCH, Columns
from pnfarm.engine.memory_order import acquire, release
from pnfarm.engine.sockets.libc import MSG_DONTWAIT, recv
from pnfarm.errors import EnvironmentError_
from pnfarm.table.channel import FRAME_SLOT
from pnfarm.table.compiling.compiled import inlined

__all__ = ["SLOT", "SLOT_WORDS", "ReceiveRing", "give_back", "open_receive_ring", "receive_ring", "take_batch"]

# linux/if_packet.h
_SOL_PACKET = 263
_PACKET_RX_RING = 5
_PACKET_COPY_THRESH = 7
_PACKET_VERSION = 10
_TPACKET_V2 = 1

#: Octets of a slot: header, address and a frame of some 180 octets, which no telegram of a drive fills.
SLOT = 256
SLOT_WORDS = SLOT // 4
#: Octets that the kernel allocates at once.
BLOCK = 64 * 1024
#: Slots for each channel, so that a machine that stalls for three cycles loses nothing, and the limits of all.
SLOTS_PER_CHANNEL = 4
FEWEST_SLOTS = 1024
MOST_SLOTS = 16_384

STATUS, LENGTH, CAPTURED, OFFSETS, SECONDS, NANOSECONDS = range(6)
INTERFACE = 9
#: Where a frame may begin at the earliest: after header and address.
HEAD = 52
STATUS_KERNEL, STATUS_USER, STATUS_COPY = 0, 1, 2


class ReceiveRing(NamedTuple):
    """``octets`` uint8 and ``words`` int32 are the same memory, slot after slot; ``next_slot`` int64[1].

    ``descriptor`` is the socket's, -1 without one.
    """

    octets: Any
    words: Any
    next_slot: Any
    descriptor: int


def receive_ring(slots: int) -> ReceiveRing:
    """A ring in memory of this process, into which nothing comes; 0 slots: none."""
    return _over(np.zeros(slots * SLOT, np.uint8), -1)


def open_receive_ring(packet_socket: socket.socket, channels: int) -> ReceiveRing:
    """The ring of an AF_PACKET socket for so many channels; it lives as long as these arrays and the socket.

    Raises :class:`EnvironmentError_` where the kernel has no memory for it.
    """
    slots = FEWEST_SLOTS
    while slots < min(channels * SLOTS_PER_CHANNEL, MOST_SLOTS):
        slots *= 2
    size = slots * SLOT
    try:
        packet_socket.setsockopt(_SOL_PACKET, _PACKET_VERSION, _TPACKET_V2)
        packet_socket.setsockopt(_SOL_PACKET, _PACKET_COPY_THRESH, 1)
        packet_socket.setsockopt(_SOL_PACKET, _PACKET_RX_RING, struct.pack("4I", BLOCK, size // BLOCK, SLOT, slots))
        memory = mmap.mmap(packet_socket.fileno(), size)
    except OSError as exc:
        raise EnvironmentError_(
            f"the kernel gave no ring of {size // 1_000_000} MB for received frames: {exc.strerror}"
        ) from exc
    return _over(np.frombuffer(memory, np.uint8), packet_socket.fileno())


def _over(octets: Any, descriptor: int) -> ReceiveRing:
    return ReceiveRing(octets, octets.view(np.int32), np.zeros(1, np.int64), descriptor)


@inlined
def _take_whole(columns: Columns, descriptor: int, count: int, length: int) -> int:
    """Read the frame that was too long for its slot into the ``count``-th receive slot; its length, 0: not there."""
    # one that is too long for that as well is read all the same, so that the next one is not taken for it
    got = recv(descriptor, columns.rx_octets.ctypes.data + count * FRAME_SLOT, FRAME_SLOT, MSG_DONTWAIT)
    return length if got == length else 0


@inlined
def take_batch(columns: Columns, ring: ReceiveRing, now: int, offset: int) -> int:
    """Note place, length, port and arrival of up to RX_BATCH frames that are there; returns their number.

    A place below 0 is in the receive slots, from -1 on downwards: a frame too long for the ring.  ``offset`` from wall
    clock, by which the kernel stamps, to the engine's time.  A frame that is not whole, or whose place is impossible,
    has length 0.
    """
    words = ring.words
    slots = words.shape[0] // SLOT_WORDS
    slot = ring.next_slot[0]
    count = 0
    while count < min(RX_BATCH, slots):
        head = slot * SLOT_WORDS
        if words[head + STATUS] & STATUS_USER == 0:
            break
        acquire()
        length = int(words[head + LENGTH])
        begin = int(words[head + OFFSETS]) & 0xFFFF
        place = slot * SLOT + begin
        if words[head + STATUS] & STATUS_COPY != 0:
            length = _take_whole(columns, ring.descriptor, count, length)
            place = -1 - count * FRAME_SLOT
        elif length != words[head + CAPTURED] or begin < HEAD or begin + length > SLOT:
            length = 0
            place = slot * SLOT + HEAD
        stamp = int(words[head + SECONDS]) * 1_000_000_000 + int(words[head + NANOSECONDS])
        columns.rx_place[count] = place
        columns.rx_length[count] = length
        columns.rx_port[count] = words[head + INTERFACE]
        columns.rx_ns[count] = min(stamp + offset, now)
        count += 1
        slot += 1
        if slot == slots:
            slot = 0
    return count


@inlined
def give_back(ring: ReceiveRing, count: int) -> None:
    """Return the first ``count`` slots to the kernel."""
    words = ring.words
    slots = words.shape[0] // SLOT_WORDS
    slot = ring.next_slot[0]
    release()
    for _ in range(count):
        words[slot * SLOT_WORDS + STATUS] = STATUS_KERNEL
        slot += 1
        if slot == slots:
            slot = 0
    ring.next_slot[0] = slot
