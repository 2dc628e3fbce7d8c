"""The engine's ring of received frames, as this kernel fills it, in a namespace of the test's own."""

import socket

from from_python import called

from pnfarm.engine.columns import allocate
from pnfarm.engine.sockets.receive_ring import give_back, open_receive_ring, take_batch

ETHERTYPE = 0x88B5  # for local experiments (IEEE 802)
FOREVER = 1 << 62


def octets_of(columns, ring, n):
    place, length = int(columns.rx_place[n]), int(columns.rx_length[n])
    if place < 0:
        return bytes(columns.rx_octets[-1 - place : -1 - place + length])
    return bytes(ring.octets[place : place + length])


def test_short_and_long_frames_arrive_whole_and_in_order_round_the_ring(cable):
    near, far = cable
    columns = allocate(images=1)
    with (
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as receiver,
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as sender,
    ):
        ring = open_receive_ring(receiver, 1)
        receiver.bind((near, ETHERTYPE))
        sender.bind((far, 0))
        for turn in range(300):
            head = b"\xff" * 6 + b"\x02\0\0\0\0\1" + ETHERTYPE.to_bytes(2, "big")
            frames = [head + bytes([turn & 0xFF, n]) * (size // 2) for n, size in enumerate((46, 1400, 150, 300, 1024))]
            for frame in frames:
                sender.send(frame)
            count = called(take_batch)(columns, ring, FOREVER, 0)
            assert [octets_of(columns, ring, n) for n in range(count)] == frames
            called(give_back)(ring, count)
        assert int(columns.rx_port[0]) == socket.if_nametoindex(near)
