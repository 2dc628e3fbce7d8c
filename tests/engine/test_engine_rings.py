"""Batches of frames through the kernel, compiled and (in the inner run of the hostile tests) interpreted.

A ring is in memory of the test, which writes slots as the kernel does.
"""

import socket

import numpy as np
import pytest
from from_python import called
from virtual_pair import Pair

from pnfarm.engine.channels.delay_queue import sent_port
from pnfarm.engine.channels.schedule import ChannelTable, ProviderPlan
from pnfarm.engine.columns import RX_BATCH, allocate
from pnfarm.engine.realtime import offset_of_stamps
from pnfarm.engine.sockets.receive_ring import (
    HEAD,
    SLOT,
    SLOT_WORDS,
    STATUS_COPY,
    STATUS_USER,
    give_back,
    receive_ring,
    take_batch,
)
from pnfarm.engine.sockets.rings import make_ring, send_batch
from pnfarm.engine.tick import receive_from, tick
from pnfarm.table.channel import FRAME_SLOT

#: Where the kernel puts a frame of Ethernet in a slot.
BEGIN = 66
MS = 1_000_000
#: The engine's time and the wall clock.
NOW, WALL = 5_000 * MS, 1_800_000_000_000 * MS


def put(ring, slot, frame, *, port=7, when=0, begin=BEGIN, length=None, captured=None):
    """What the kernel does with a frame."""
    words, size = ring.words[slot * SLOT_WORDS : (slot + 1) * SLOT_WORDS], len(frame)
    words[1], words[2] = size if length is None else length, size if captured is None else captured
    words[3], words[4], words[5], words[9] = begin | (begin + 14) << 16, when // 10**9, when % 10**9, port
    ring.octets[slot * SLOT + begin : slot * SLOT + begin + size] = np.frombuffer(frame, np.uint8)
    words[0] = STATUS_USER


def frames_of(columns, ring, count):
    return [bytes(ring.octets[columns.rx_place[i] : columns.rx_place[i] + columns.rx_length[i]]) for i in range(count)]


def test_all_due_frames_go_out_as_they_are_in_the_frame_store():
    pair = Pair(drives=3)
    farm = pair.farm
    # a sequenced local socket takes the same batches as a packet socket and looks at no address
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with near, far:
        ring = make_ring(farm, near)
        count, now = 0, pair.now
        while count == 0:  # the grid of their cycle says when the first are due
            now += 31_250
            count = tick(farm, 0, now)
        sent = [bytes(farm.frames[row][: farm.ppm[row].length]) for row in farm.tx_row[:count]]
        ports = [int(farm.ppm[row].port) for row in farm.tx_row[:count]]
        called(send_batch)(farm, ring, count)
        assert farm.engine[0].send_errors == 0
        assert [far.recv(2048) for _ in range(count)] == sent
        addresses = ring.tx_address[:count]
        assert [(bytes(address[:1]), int(address[1])) for address in addresses] == [
            (b"\x11\x00\x88\x92", port) for port in ports
        ]


def test_frames_of_a_ring_are_taken_in_order_with_port_and_arrival():
    columns, ring = allocate(images=1), receive_ring(8)
    sent = [bytes([n]) * (60 + n) for n in range(5)]
    for n, frame in enumerate(sent):
        put(ring, n, frame, port=20 + n, when=1_000_000_000_000 + n)
    assert called(take_batch)(columns, ring, 5_000, -1_000_000_000_000) == 5
    assert frames_of(columns, ring, 5) == sent
    assert list(columns.rx_port[:5]) == [20, 21, 22, 23, 24]
    assert list(columns.rx_ns[:5]) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("stepped_ns", "arrival"),
    [
        # right, slewed, and set back: 10 ms ago as stamped, or at once
        (0, NOW - 10 * MS), (50_000, NOW - 10 * MS - 50_000), (-3_600_000 * MS, NOW),
        # set forward: a frame from before the step is not older by that
        (MS, NOW), (3_600_000 * MS, NOW),
    ],
)  # fmt: skip
def test_a_frame_from_before_a_step_of_the_wall_clock_arrives_when_it_is_taken(stepped_ns, arrival):
    columns, ring = allocate(images=1), receive_ring(8)
    put(ring, 0, bytes(60), when=WALL - 10 * MS)
    offset = offset_of_stamps(NOW - (WALL + stepped_ns), NOW - WALL)
    assert called(take_batch)(columns, ring, NOW, offset) == 1
    assert columns.rx_ns[0] == arrival


def test_a_frame_that_was_stamped_later_than_now_arrives_now():
    columns, ring = allocate(images=1), receive_ring(8)
    put(ring, 0, bytes(64), when=9_000)
    assert called(take_batch)(columns, ring, 5_000, 0) == 1
    assert columns.rx_ns[0] == 5_000


def test_a_slot_is_the_kernel_s_again_once_it_was_given_back_and_the_ring_goes_round():
    columns, ring = allocate(images=1), receive_ring(8)
    for turn in range(20):
        frames = [bytes([turn, n]) * 40 for n in range(3)]
        for n, frame in enumerate(frames):
            put(ring, (turn * 3 + n) % 8, frame)
        assert called(take_batch)(columns, ring, 0, 0) == 3
        assert frames_of(columns, ring, 3) == frames
        called(give_back)(ring, 3)
        assert not ring.words[::SLOT_WORDS].any()
        assert called(take_batch)(columns, ring, 0, 0) == 0


def test_a_full_ring_is_taken_once_and_no_batch_is_larger_than_the_receive_slots():
    columns = allocate(images=1)
    for slots, expected in ((8, 8), (512, RX_BATCH)):
        ring = receive_ring(slots)
        for n in range(slots):
            put(ring, n, bytes(60))
        assert called(take_batch)(columns, ring, 0, 0) == expected


def test_a_frame_that_was_cut_or_lies_outside_of_its_slot_has_no_octets():
    columns, ring = allocate(images=1), receive_ring(8)
    put(ring, 0, bytes(100), length=4000)
    put(ring, 1, bytes(60), begin=HEAD - 4)
    put(ring, 2, bytes(60), length=SLOT, captured=SLOT)
    put(ring, 3, bytes(60), length=-5, captured=-5)
    assert called(take_batch)(columns, ring, 0, 0) == 4
    assert list(columns.rx_length[:3]) == [0, 0, 0]
    called(receive_from)(columns, ring.octets, columns.rx_place, 4)
    assert columns.engine[0].malformed == 4


def test_a_frame_too_long_for_its_slot_is_taken_whole_and_in_its_order():
    columns = allocate(images=1)
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with near, far:
        ring = receive_ring(8)._replace(descriptor=near.fileno())
        long = [bytes([n]) * size for n, size in ((1, 600), (2, FRAME_SLOT), (3, FRAME_SLOT + 80))]
        for slot, frame in zip((1, 2, 4), long, strict=True):
            far.send(frame)
            put(ring, slot, frame[: SLOT - BEGIN], port=20 + slot, length=len(frame))
            ring.words[slot * SLOT_WORDS] |= STATUS_COPY
        put(ring, 0, bytes(60), port=20)
        put(ring, 3, bytes(60), port=23)
        # the kernel's queue was full
        put(ring, 5, bytes(SLOT - BEGIN), port=25, length=700)
        assert called(take_batch)(columns, ring, 5, 0) == 6
    assert list(columns.rx_port[:6]) == [20, 21, 22, 23, 24, 25]
    assert list(columns.rx_length[:6]) == [60, 600, FRAME_SLOT, 60, 0, 0]
    taken = [-1 - int(place) for place in columns.rx_place[:6]]
    assert [bytes(columns.rx_octets[taken[n] : taken[n] + len(long[n - 1])]) for n in (1, 2)] == long[:2]


def test_no_content_of_a_ring_breaks_the_engine():
    random = np.random.default_rng(11)
    pair = Pair(drives=2)
    ring = receive_ring(16)
    for _ in range(200):
        ring.octets[:] = random.integers(0, 256, ring.octets.shape, dtype=np.uint8)
        # some lengths and places that are possible, so that frames are looked at
        heads = ring.words.reshape(-1, SLOT_WORDS)
        heads[::2, 1] = heads[::2, 2] = random.integers(0, FRAME_SLOT + 80, 8)
        heads[::2, 3] = random.integers(40, 90, 8)
        heads[:, 0] |= STATUS_USER
        assert called(take_batch)(pair.farm, ring, pair.now, 0) == 16
        called(receive_from)(pair.farm, ring.octets, pair.farm.rx_place, 16)
        called(give_back)(ring, 16)
    assert pair.farm.engine[0].received == 3200


def test_a_socket_that_is_no_packet_socket_has_no_ring():
    near, far = socket.socketpair()
    with near, far:
        ring = make_ring(allocate(images=1), near)
        assert ring.received.words.shape == (0,)


def test_frames_leave_through_the_exit_that_their_port_has_for_their_peer():
    asked = {}

    def egress_for(port, destination):
        return asked.setdefault((port, destination), 99)

    columns = allocate(images=1, channels=1)
    table = ChannelTable(columns, egress_for)
    number = table.open_provider(ProviderPlan(0, 7, b"\x0a" * 6, b"\x02" * 6, 0x8000, 40, 32, 1, [], []))
    assert sent_port(columns.ppm, columns.held, number) == 99
    asked[7, b"\x0a" * 6] = 0
    table.choose_egress(7)
    assert sent_port(columns.ppm, columns.held, number) == 7
