"""The floor: the lowest cost of one batch in and one batch out on this machine, compiled like the engine.

No channels, no firmware, no counters: received frames are dropped, and the same frames are sent again
every period.  The benchmarks divide by it.  It receives by ``recvmmsg``, or out of a ring as the engine does, which
shows what that gives.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pnfarm.engine.sockets.libc import (
    CLOCK_MONOTONIC,
    MSG_DONTWAIT,
    TIMER_ABSTIME,
    clock_nanosleep,
    recvmmsg,
    sendmmsg,
    time_ns,
)
from pnfarm.engine.sockets.receive_ring import SLOT, SLOT_WORDS, ReceiveRing
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.engine_row import LATENESS_EDGES_NS

__all__ = ["FloorVectors", "copy_floor", "make_vectors", "run_floor"]

BATCH = 256
RX_SLOT = 1536
FRAME = 64
_EDGES = np.array(LATENESS_EDGES_NS, np.int64)


class FloorVectors:
    """Message vectors for ``count`` frames of ``octets``; the arrays live as long as this object."""

    def __init__(self, count: int, octets: int = FRAME) -> None:
        self.rx = np.zeros((BATCH, 8), np.int64)
        self.rx_iov = np.zeros((BATCH, 2), np.int64)
        self.rx_frames = np.zeros((BATCH, RX_SLOT), np.uint8)
        self.rx_address = np.zeros((BATCH, 24), np.uint8)
        self.tx = np.zeros((count, 8), np.int64)
        self.tx_iov = np.zeros((count, 2), np.int64)
        self.tx_frames = np.zeros((count, octets), np.uint8)
        self.tx_address = np.zeros((count, 24), np.uint8)
        #: Frames received, frames sent, a sum of octets.
        self.counts = np.zeros(3, np.int64)
        self.lateness = np.zeros(len(LATENESS_EDGES_NS) + 1, np.int64)
        #: For the kernel: the time now, and when the loop goes on.
        self.times = np.zeros((2, 2), np.int64)


def make_vectors(addresses: list[tuple[int, bytes, bytes]], packet: bytes = b"") -> FloorVectors:
    """One frame for each (interface index, source, destination).

    ``packet`` is what follows the addresses, from the EtherType on; without one it is an RT frame of 64 octets.
    """
    vectors = FloorVectors(len(addresses), 12 + len(packet) if packet else FRAME)
    octets = vectors.tx_frames.shape[1]
    for i in range(BATCH):
        vectors.rx_iov[i] = (vectors.rx_frames.ctypes.data + i * RX_SLOT, RX_SLOT)
        vectors.rx[i] = (
            vectors.rx_address.ctypes.data + i * 24,
            20,
            vectors.rx_iov.ctypes.data + i * 16,
            1,
            0,
            0,
            0,
            0,
        )
    for i, (index, source, destination) in enumerate(addresses):
        vectors.tx_frames[i, :6] = list(destination)
        vectors.tx_frames[i, 6:12] = list(source)
        if packet:
            vectors.tx_frames[i, 12:] = list(packet)
        else:
            vectors.tx_frames[i, 12:20] = (0x81, 0x00, 0xC0, 0x00, 0x88, 0x92, 0x80 + (i >> 8), i & 0xFF)
        vectors.tx_iov[i] = (vectors.tx_frames.ctypes.data + i * octets, octets)
        vectors.tx_address[i, :4] = (17, 0, *(packet[:2] or (0x88, 0x92)))
        vectors.tx_address[i, 4:8] = list(index.to_bytes(4, "little"))
        vectors.tx[i] = (
            vectors.tx_address.ctypes.data + i * 24,
            20,
            vectors.tx_iov.ctypes.data + i * 16,
            1,
            0,
            0,
            0,
            0,
        )
    return vectors


@inlined
def _empty(ring: ReceiveRing, counts: Any) -> None:
    """Look at each frame of a ring, as the engine has to, and give it back."""
    slots = ring.words.shape[0] // SLOT_WORDS
    slot = ring.next_slot[0]
    count = 0
    while count < slots and ring.words[slot * SLOT_WORDS] & 1:
        # summed, so that the look is not left out
        counts[2] += ring.octets[slot * SLOT + (int(ring.words[slot * SLOT_WORDS + 3]) & 0xFFFF)]
        ring.words[slot * SLOT_WORDS] = 0
        count += 1
        slot += 1
        if slot == slots:
            slot = 0
    ring.next_slot[0] = slot
    counts[0] += count


@compiled
def run_floor(
    descriptor: int,
    ring: ReceiveRing,
    rx: Any,
    tx: Any,
    groups: int,
    counts: Any,
    lateness: Any,
    times: Any,
    period: int,
    until: int,
) -> None:
    """Every ``period`` ns receive all frames and send the next of ``groups`` parts of the frames, to time ``until``.

    Frames are received from ``ring``, if it has slots.
    """
    clock, target = times[0], times[1]
    now = time_ns(CLOCK_MONOTONIC, clock)
    due = now - now % period + period
    turn = 0
    size = (tx.shape[0] + groups - 1) // groups
    while now < until:
        target[0] = due // 1_000_000_000
        target[1] = due % 1_000_000_000
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, target.ctypes.data, 0)
        now = time_ns(CLOCK_MONOTONIC, clock)
        late = now - due
        bucket = 0
        while bucket < lateness.shape[0] - 1 and late > _EDGES[bucket]:
            bucket += 1
        lateness[bucket] += 1
        count = BATCH
        if ring.words.shape[0] > 0:
            _empty(ring, counts)
            count = 0
        while count == BATCH:
            for i in range(BATCH):
                rx[i, 1] = 20
            count = recvmmsg(descriptor, rx.ctypes.data, BATCH, MSG_DONTWAIT, 0)
            if count > 0:
                counts[0] += count
        first = turn * size
        last = min(first + size, tx.shape[0])
        while first < last:
            sent = sendmmsg(descriptor, tx.ctypes.data + first * 64, last - first, MSG_DONTWAIT)
            if sent <= 0:
                break
            first += sent
            counts[1] += sent
        turn = (turn + 1) % groups
        due += period
        if due < now:
            due = now - now % period + period


@compiled
def copy_floor(sent: Any, taken: Any, rounds: int) -> int:
    """Copy each frame of ``sent`` (frames, octets) to its place in ``taken`` and read it there, ``rounds`` times."""
    total = 0
    for _ in range(rounds):
        for i in range(sent.shape[0]):
            for k in range(sent.shape[1]):
                taken[i, k] = sent[i, k]
            for k in range(sent.shape[1]):
                total += taken[i, k]
            sent[i, 0] = total & 0xFF
    return total
