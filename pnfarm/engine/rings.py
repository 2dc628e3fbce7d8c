"""Batches of frames over AF_PACKET sockets: one ``recvmmsg``, one ``sendmmsg`` for the whole farm.

Frames of another EtherType arrive at a socket of their own, which costs a second ``recvmmsg`` for farms that have it;
all leave through the first.

The message vectors are laid out once.  A ``struct mmsghdr`` of 64-bit Linux is eight 64-bit words::

    name  namelen  iov  iovlen  control  controllen  flags  length

The interface travels in each message's ``sockaddr_ll``, so one unbound socket serves every interface of a
network namespace.
"""

from __future__ import annotations

import socket
from typing import Any, NamedTuple

import numpy as np

from pnfarm.engine.columns import RX_BATCH, Columns
from pnfarm.engine.held import sent_length, sent_port
from pnfarm.engine.libc import (
    CLOCK_BOOTTIME,
    CLOCK_MONOTONIC,
    CLOCK_REALTIME,
    MSG_DONTWAIT,
    recvmmsg,
    sendmmsg,
    time_ns,
)
from pnfarm.errors import EnvironmentError_
from pnfarm.table.channel import FRAME_SLOT
from pnfarm.table.compiled import compiled

__all__ = ["Ring", "make_ring", "receive_batch", "send_batch"]

NAME, NAME_LENGTH, IOV, IOV_LENGTH, CONTROL, CONTROL_LENGTH, FLAGS, LENGTH = range(8)
#: Octets of a sockaddr_ll, in its slot of 24.
SOCKADDR_LL = 20
ADDRESS_SLOT = 24
#: Control message with one SCM_TIMESTAMPNS: header 16, timespec 16, rounded up.
CONTROL_SLOT = 64
SO_TIMESTAMPNS = 35
#: ``cmsg_level << 32 ... `` as the second word of the control message: level 1 (SOL_SOCKET), type 35.
TIMESTAMP_KIND = (SO_TIMESTAMPNS << 32) | 1


class Ring(NamedTuple):
    """A socket's message vectors; see the module's docstring.  All arrays belong to the engine's thread."""

    descriptor: int
    #: A second socket to receive from, -1: none.
    beside: int
    rx_vector: Any
    rx_iov: Any
    rx_address: Any
    rx_control: Any
    tx_vector: Any
    tx_iov: Any
    tx_address: Any
    clock: Any


def make_ring(
    columns: Columns, channel_socket: socket.socket, beside: socket.socket | None = None, *, timestamps: bool = True
) -> Ring:
    """Lay out the vectors for ``columns`` over an open, bound AF_PACKET socket, and one more to receive from.

    With ``timestamps`` the kernel stamps every frame, so that intervals are the controller's and not the
    engine's.  Raises :class:`EnvironmentError_` on a machine whose ``struct msghdr`` is not the 64-bit one.
    """
    if np.dtype(np.intp).itemsize != 8:
        raise EnvironmentError_("the engine needs a 64-bit Linux: this one's pointers have 32 bits")
    frames = columns.frames.shape[0]
    ring = Ring(
        descriptor=channel_socket.fileno(),
        beside=-1 if beside is None else beside.fileno(),
        rx_vector=np.zeros((RX_BATCH, 8), np.int64),
        rx_iov=np.zeros((RX_BATCH, 2), np.int64),
        rx_address=np.zeros((RX_BATCH, ADDRESS_SLOT), np.uint8),
        rx_control=np.zeros((RX_BATCH, CONTROL_SLOT // 8), np.int64),
        tx_vector=np.zeros((columns.tx_row.shape[0], 8), np.int64),
        tx_iov=np.zeros((frames, 2), np.int64),
        tx_address=np.zeros((frames, ADDRESS_SLOT), np.uint8),
        clock=np.zeros(2, np.int64),
    )
    for i in range(RX_BATCH):
        ring.rx_iov[i] = (columns.rx_frames.ctypes.data + i * FRAME_SLOT, FRAME_SLOT)
        ring.rx_vector[i, NAME] = ring.rx_address.ctypes.data + i * ADDRESS_SLOT
        ring.rx_vector[i, NAME_LENGTH] = SOCKADDR_LL
        ring.rx_vector[i, IOV] = ring.rx_iov.ctypes.data + i * 16
        ring.rx_vector[i, IOV_LENGTH] = 1
        ring.rx_vector[i, CONTROL] = ring.rx_control.ctypes.data + i * CONTROL_SLOT
        ring.rx_vector[i, CONTROL_LENGTH] = CONTROL_SLOT
    if timestamps:
        channel_socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        if beside is not None:
            beside.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    ring.tx_iov[:, 0] = columns.frames.ctypes.data + np.arange(frames) * FRAME_SLOT
    # sockaddr_ll: family, protocol (network order), interface index (filled per frame)
    ring.tx_address[:, :4] = (socket.AF_PACKET, 0, 0x88, 0x92)
    return ring


@compiled
def receive_batch(columns: Columns, ring: Ring, descriptor: int, now: int) -> int:
    """Receive up to RX_BATCH frames of one socket into the receive slots; returns their number."""
    count = recvmmsg(descriptor, ring.rx_vector.ctypes.data, RX_BATCH, MSG_DONTWAIT, 0)
    if count <= 0:
        return 0
    # kernel stamps are wall clock; the engine uses monotonic time
    offset = time_ns(CLOCK_MONOTONIC, ring.clock) - time_ns(CLOCK_REALTIME, ring.clock)
    for i in range(count):
        columns.rx_length[i] = ring.rx_vector[i, LENGTH] & 0xFFFFFFFF
        address = ring.rx_address[i]
        columns.rx_port[i] = (
            int(address[4]) | int(address[5]) << 8 | int(address[6]) << 16 | int(address[7]) << 24
        )  # ifindex in host order; every supported machine is little-endian
        arrival = now
        control = ring.rx_control[i]
        if ring.rx_vector[i, CONTROL_LENGTH] >= 32 and control[1] == TIMESTAMP_KIND:
            arrival = control[2] * 1_000_000_000 + control[3] + offset
            arrival = min(arrival, now)
        columns.rx_ns[i] = arrival
        # the kernel wrote what it filled of both
        ring.rx_vector[i, NAME_LENGTH] = SOCKADDR_LL
        ring.rx_vector[i, CONTROL_LENGTH] = CONTROL_SLOT
    return count


@compiled
def send_batch(columns: Columns, ring: Ring, count: int) -> None:
    """Hand ``count`` frames of ``tx_row`` to the kernel; what it refuses is counted and dropped.

    After the end of a lease nothing is sent.
    """
    engine = columns.engine[0]
    for i in range(count):
        # a plain integer: interpreted, address arithmetic with the array's int32 would overflow
        row = int(columns.tx_row[i])
        port = sent_port(columns.ppm, columns.held, row)
        ring.tx_iov[row, 1] = sent_length(columns.ppm, columns.held, row)
        address = ring.tx_address[row]
        # the EtherType, for what looks at a frame on its way; a tagged frame is PROFINET's
        plain = columns.frames[row, 12] == 0x08
        address[2] = 0x08 if plain else 0x88
        address[3] = 0x00 if plain else 0x92
        address[4] = port & 0xFF
        address[5] = (port >> 8) & 0xFF
        address[6] = (port >> 16) & 0xFF
        address[7] = (port >> 24) & 0xFF
        ring.tx_vector[i, NAME] = ring.tx_address.ctypes.data + row * ADDRESS_SLOT
        ring.tx_vector[i, NAME_LENGTH] = SOCKADDR_LL
        ring.tx_vector[i, IOV] = ring.tx_iov.ctypes.data + row * 16
        ring.tx_vector[i, IOV_LENGTH] = 1
    # looked at last: the process may have been frozen since the tick began
    if engine.lease_until_ns != 0 and time_ns(CLOCK_BOOTTIME, ring.clock) >= engine.lease_until_ns:
        engine.muted += count
        return
    done = 0
    while done < count:
        sent = sendmmsg(ring.descriptor, ring.tx_vector.ctypes.data + done * 64, count - done, MSG_DONTWAIT)
        if sent <= 0:
            # the first frame of the rest was refused (interface down, queue full): skip it, try the others
            engine.send_errors += 1
            done += 1
        else:
            done += sent
