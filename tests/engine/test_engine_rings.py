"""Batches of frames through the kernel, compiled and (in the inner run of the hostile tests) interpreted."""

import socket

from virtual_pair import Pair

from pnfarm.engine.columns import allocate
from pnfarm.engine.rings import make_ring, receive_batch, send_batch
from pnfarm.engine.tick import tick


def test_all_due_frames_go_out_and_come_in_as_they_were():
    pair = Pair(drives=3)
    farm, receiver = pair.farm, allocate(stations=1, channels=1)
    # a sequenced local socket takes the same batches as a packet socket and looks at no address
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with near, far:
        sender_ring = make_ring(farm, near, timestamps=False)
        receiver_ring = make_ring(receiver, far, timestamps=False)
        count, now = 0, pair.now
        while count == 0:  # the grid of their cycle says when the first are due
            now += 31_250
            count = tick(farm, 0, now)
        sent = [bytes(farm.frames[row][: farm.ppm[row].length]) for row in farm.tx_row[:count]]
        send_batch(farm, sender_ring, count)
        assert farm.engine[0].send_errors == 0
        assert receive_batch(receiver, receiver_ring, receiver_ring.descriptor, now) == count
        received = [bytes(receiver.rx_frames[i][: receiver.rx_length[i]]) for i in range(count)]
        assert received == sent
        assert receive_batch(receiver, receiver_ring, receiver_ring.descriptor, now) == 0
