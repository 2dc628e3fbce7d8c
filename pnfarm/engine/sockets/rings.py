"""Batches of frames over AF_PACKET sockets: received from a ring in shared memory, sent by one ``sendmmsg``.

Frames of another EtherType arrive at a socket of their own, with a ring of its own; all leave through the first.

A ``struct mmsghdr`` of 64-bit Linux is eight 64-bit words::

    name  namelen  iov  iovlen  control  controllen  flags  length

The interface travels in each message's ``sockaddr_ll``, so one unbound socket serves every interface of a
network namespace.  Messages are laid out when they are sent: a table has room for many more frames than a tick sends,
and memory that nobody writes is none of the process's.
"""

from __future__ import annotations

import socket
from typing import Any, NamedTuple

import numpy as np

from pnfarm.engine.channels.delay_queue import sent_length, sent_port
from pnfarm.engine.columns import Columns
from pnfarm.engine.sockets.libc import CLOCK_BOOTTIME, MSG_DONTWAIT, sendmmsg, time_ns
from pnfarm.engine.sockets.receive_ring import ReceiveRing, open_receive_ring, receive_ring
from pnfarm.engine.sockets.xdp import XdpSocket, forget_placed, no_xdp, place_frame, room, send_placed
from pnfarm.errors import EnvironmentError_
from pnfarm.table.channel import FRAME_SLOT
from pnfarm.table.compiling.compiled import inlined

__all__ = ["Ring", "make_ring", "send_batch"]

NAME, NAME_LENGTH, IOV, IOV_LENGTH, CONTROL, CONTROL_LENGTH, FLAGS, LENGTH = range(8)
#: Octets of a sockaddr_ll, in its slot of 24.
SOCKADDR_LL = 20
ADDRESS_SLOT = 24


class Ring(NamedTuple):
    """A socket's rings and message vectors; see the module's docstring.  All arrays belong to the engine's thread."""

    descriptor: int
    received: ReceiveRing
    #: What a second socket receives; no slots without one.
    beside: ReceiveRing
    #: 1: frames count as arrived when the kernel stamped them, 0: when the engine looks.
    stamped: int
    #: What leaves through one interface may have a way of its own.
    xdp: XdpSocket
    tx_vector: Any
    tx_iov: Any
    tx_address: Any
    clock: Any
    #: The time at which the loop goes on, as the kernel is told it.
    target: Any


def make_ring(
    columns: Columns,
    channel_socket: socket.socket,
    beside: socket.socket | None = None,
    *,
    xdp: XdpSocket | None = None,
    timestamps: bool = True,
) -> Ring:
    """Lay out the vectors for ``columns`` over an open, bound AF_PACKET socket, and one more to receive from.

    With ``timestamps`` a frame arrives when the kernel stamps it, so that intervals are the controller's and not the
    engine's.  A socket of another family only sends.
    Raises :class:`EnvironmentError_` on a machine whose ``struct msghdr`` is not the 64-bit one.
    """
    if np.dtype(np.intp).itemsize != 8:
        raise EnvironmentError_("the engine needs a 64-bit Linux: this one's pointers have 32 bits")
    messages, channels = columns.tx_row.shape[0], columns.cpm.shape[0]
    return Ring(
        descriptor=channel_socket.fileno(),
        received=_received(channel_socket, channels),
        beside=_received(beside, channels),
        stamped=1 if timestamps else 0,
        xdp=xdp or no_xdp(),
        tx_vector=np.zeros((messages, 8), np.int64),
        tx_iov=np.zeros((messages, 2), np.int64),
        tx_address=np.zeros((messages, ADDRESS_SLOT // 4), np.int32),
        clock=np.zeros(2, np.int64),
        target=np.zeros(2, np.int64),
    )


def _received(packet_socket: socket.socket | None, channels: int) -> ReceiveRing:
    if packet_socket is None or packet_socket.family != socket.AF_PACKET:
        return receive_ring(0)
    return open_receive_ring(packet_socket, channels)


#: Family and EtherType of a sockaddr_ll as its first 32-bit word; every supported machine is little-endian.
_IPV4 = socket.AF_PACKET | 0x0008 << 16
_REAL_TIME = np.int32(socket.AF_PACKET | 0x9288 - 0x10000 << 16)


@inlined
def send_batch(columns: Columns, ring: Ring, count: int) -> None:
    """Hand ``count`` frames of ``tx_row`` to the kernel; what it refuses is counted and dropped.

    After the end of a lease nothing is sent.
    """
    engine = columns.engine[0]
    vector, iov, addresses = ring.tx_vector, ring.tx_iov, ring.tx_address
    frame_base, iov_base, address_base = columns.frames.ctypes.data, iov.ctypes.data, addresses.ctypes.data
    xdp = ring.xdp
    places = room(xdp) if xdp.interface >= 0 else 0
    number = 0
    for k in range(count):
        # a plain integer: interpreted, address arithmetic with the array's int32 would overflow
        row = int(columns.tx_row[k])
        length, port = sent_length(columns.ppm, columns.held, row), sent_port(columns.ppm, columns.held, row)
        if places > 0 and port == xdp.interface:
            place_frame(xdp, columns.frames[row], length)
            places -= 1
            continue
        i = number
        number += 1
        iov[i, 0] = frame_base + row * FRAME_SLOT
        iov[i, 1] = length
        # the EtherType, for what looks at a frame on its way; a tagged frame is PROFINET's
        addresses[i, 0] = _IPV4 if columns.frames[row, 12] == 0x08 else _REAL_TIME
        addresses[i, 1] = port
        vector[i, NAME] = address_base + i * ADDRESS_SLOT
        vector[i, NAME_LENGTH] = SOCKADDR_LL
        vector[i, IOV] = iov_base + i * 16
        vector[i, IOV_LENGTH] = 1
    # looked at last: the process may have been frozen since the tick began
    if engine.lease_until_ns != 0 and time_ns(CLOCK_BOOTTIME, ring.clock) >= engine.lease_until_ns:
        engine.muted += count
        if xdp.interface >= 0:
            forget_placed(xdp)
        return
    if xdp.interface >= 0:
        engine.send_errors += send_placed(xdp)
    done = 0
    while done < number:
        sent = sendmmsg(ring.descriptor, vector.ctypes.data + done * 64, number - done, MSG_DONTWAIT)
        if sent <= 0:
            # the first frame of the rest was refused (interface down, queue full): skip it, try the others
            engine.send_errors += 1
            done += 1
        else:
            done += sent
