"""Frames sent by AF_XDP, as this kernel sends them, in a namespace of the test's own."""

import contextlib
import socket

import numpy as np
import pytest
from from_python import called
from opened_link import opened

from pnfarm.engine.columns import allocate
from pnfarm.engine.sockets.rings import make_ring, send_batch
from pnfarm.engine.sockets.xdp import CHUNK, FEWEST_PLACES, forget_placed, open_xdp, place_frame, room, send_placed
from pnfarm.errors import EnvironmentError_
from pnfarm.links.base import PortSpec
from pnfarm.links.egress import egress_of
from pnfarm.links.macvlan import MacvlanLink

ETHERTYPE = 0x88B5  # for local experiments (IEEE 802)
HEAD = b"\xff" * 6 + b"\x02\0\0\0\0\1" + ETHERTYPE.to_bytes(2, "big")


def frame(number, size=46):
    return HEAD + number.to_bytes(4, "big") + bytes(size - 4)


@contextlib.contextmanager
def xdp(name, rows=8):
    made, opened_socket = open_xdp(socket.if_nametoindex(name), rows)
    with opened_socket:
        yield made


@contextlib.contextmanager
def listener(name):
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as heard:
        heard.bind((name, ETHERTYPE))
        heard.setblocking(False)
        yield heard


def came(heard):
    """All that waits."""
    found = []
    with contextlib.suppress(BlockingIOError):
        while True:
            found.append(heard.recv(2048))
    return found


def place(made, octets):
    called(place_frame)(made, np.frombuffer(octets, np.uint8), len(octets))


def test_frames_of_all_lengths_leave_whole_and_in_order_round_the_ring(cable):
    near, far = cable
    with xdp(near) as made, listener(far) as heard:
        number = 0
        # a round of the ring is nine of these turns
        for _ in range(40):
            sent = [frame(number + k, size) for k, size in enumerate((46, 100, 183, 1400, 60, 47, 512))]
            number += len(sent)
            assert called(room)(made) == FEWEST_PLACES
            for octets in sent:
                place(made, octets)
            assert called(send_placed)(made) == 0
            assert came(heard) == sent
        assert called(room)(made) == FEWEST_PLACES


def test_more_frames_than_the_kernel_takes_at_once_leave_in_one_call(cable):
    near, far = cable
    with xdp(near, rows=300) as made, listener(far) as heard:
        sent = [frame(k) for k in range(200)]
        for octets in sent:
            place(made, octets)
        assert called(send_placed)(made) == 0
        assert came(heard) == sent


def test_while_an_interface_is_down_there_is_no_room_and_what_was_given_to_it_is_counted(cable, ip):
    near, far = cable
    with xdp(near) as made, listener(far) as heard:
        ip("link", "set", near, "down")
        for k in range(3):
            place(made, frame(k))
        assert called(send_placed)(made) == 3
        # each once, however many cycles pass
        assert [(called(room)(made), called(send_placed)(made)) for _ in range(100)] == [(0, 0)] * 100
        ip("link", "set", near, "up")
        # the frames of one cycle leave late
        assert called(room)(made) == FEWEST_PLACES
        assert came(heard) == [frame(k) for k in range(3)]
        place(made, frame(4))
        assert called(send_placed)(made) == 0
        assert came(heard) == [frame(4)]


def test_what_a_lease_forbids_is_forgotten(cable):
    near, far = cable
    with xdp(near) as made, listener(far) as heard:
        place(made, frame(1))
        called(forget_placed)(made)
        place(made, frame(2))
        assert called(send_placed)(made) == 0
        assert came(heard) == [frame(2)]


def provided(columns, count, ports):
    """``count`` rows with a frame each, all due; ``ports`` in turn."""
    for row in range(count):
        octets = frame(row)
        columns.frames[row, : len(octets)] = np.frombuffer(octets, np.uint8)
        columns.ppm[row].length = len(octets)
        columns.ppm[row].port = ports[row % len(ports)]
        columns.tx_row[row] = row


@pytest.mark.parametrize("rows", [8, 100])
def test_a_batch_leaves_by_both_ways_and_what_finds_no_room_by_the_packet_socket(cable, ip, rows):
    near, far = cable
    ip("link", "add", "link", near, "name", "drive", "type", "macvlan", "mode", "bridge")
    ip("link", "set", "drive", "up")
    parent, own = socket.if_nametoindex(near), socket.if_nametoindex("drive")
    columns = allocate(images=rows, channels=rows)
    with (
        xdp(near, rows=1) as made,
        listener(far) as heard,
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as sender,
    ):
        provided(columns, rows, [parent, own, parent])
        ring = make_ring(columns, sender, xdp=made)
        called(send_batch)(columns, ring, rows)
        assert sorted(came(heard)) == [frame(row) for row in range(rows)]
        assert int(columns.engine[0].send_errors) == 0


def test_a_batch_after_the_end_of_a_lease_sends_nothing_by_any_way(cable):
    near, far = cable
    parent = socket.if_nametoindex(near)
    columns = allocate(images=4, channels=4)
    with (
        xdp(near, rows=4) as made,
        listener(far) as heard,
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as sender,
    ):
        provided(columns, 4, [parent])
        ring = make_ring(columns, sender, xdp=made)
        columns.engine[0].lease_until_ns = 1
        called(send_batch)(columns, ring, 4)
        columns.engine[0].lease_until_ns = 0
        provided(columns, 1, [parent])
        called(send_batch)(columns, ring, 1)
        assert came(heard) == [frame(0)]
        assert int(columns.engine[0].muted) == 4


def test_a_machine_without_af_xdp_is_told(monkeypatch):
    def refused(*_, **__):
        raise OSError(97, "Address family not supported by protocol")

    monkeypatch.setattr(socket, "socket", refused)
    with pytest.raises(EnvironmentError_, match="needs AF_XDP, which this machine does not give"):
        open_xdp(1, 1)


def test_an_interface_that_is_gone_is_told(namespace):
    with pytest.raises(EnvironmentError_, match="cannot be prepared for interface 12345: No such device"):
        open_xdp(12345, 1)


def test_a_place_holds_the_longest_frame():
    assert CHUNK >= 1522


@pytest.mark.asyncio
@pytest.mark.parametrize(("choice", "has"), [("xdp", True), ("auto", False), ("parent", False), ("own", False)])
async def test_only_a_farm_that_asks_for_it_sends_so(cable, choice, has):
    near, _ = cable
    link = MacvlanLink("line-1", near, send=choice)
    async with opened(link, [PortSpec("axis-01", bytes.fromhex("020000000001"))]) as (port,):
        parent = socket.if_nametoindex(near)
        assert egress_of(link).xdp_interface == (parent if has else 0)
        assert egress_of(link).egress_for(port.index, bytes.fromhex("0a0000000001")) == (
            0 if choice == "own" else parent
        )
