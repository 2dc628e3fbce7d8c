import contextlib
import socket
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.links.kernel import bpf
from pnfarm.links.kernel.packet import open_packet_socket

HERE = bytes.fromhex("02aa00000001")
THERE = bytes.fromhex("02aa00000002")


def frame(frame_id, destination=HERE, ethertype=0x8892):
    return destination + THERE + struct.pack(">HH", ethertype, frame_id) + bytes(44)


@pytest.fixture
def wire(ip):
    """Two ends of a cable: (name, index) of each; ``here`` has the address HERE."""
    ip("link", "add", "here", "address", HERE.hex(":"), "type", "veth", "peer", "name", "there")
    for end in ("here", "there"):
        ip("link", "set", end, "addrgenmode", "none")
        ip("link", "set", end, "up")
    return socket.if_nametoindex("here"), socket.if_nametoindex("there")


def received(sock):
    frames = []
    with contextlib.suppress(BlockingIOError):
        while True:
            frames.append(sock.recv(2048))
    return frames


def frame_ids(sock):
    return [int.from_bytes(f[14:16], "big") for f in received(sock)]


IDS = [0x0000, 0x8000, 0xBBF0, 0xC001, 0xFBFF, 0xFC00, 0xFC01, 0xFE01, 0xFEFE, 0xFFFF]


def test_profinet_frames_are_split_by_frame_id_between_the_two_sockets(wire, raw):
    here, _ = wire
    with (
        contextlib.closing(open_packet_socket(0x8892, bpf.acyclic_filter(here, here))) as acyclic,
        contextlib.closing(open_packet_socket(0x8892, bpf.cyclic_filter(here, here))) as cyclic,
        raw("there") as peer,
    ):
        for frame_id in IDS:
            peer.send(frame(frame_id))
        assert frame_ids(acyclic) == [i for i in IDS if i >= 0xFC00]
        assert frame_ids(cyclic) == [i for i in IDS if i < 0xFC00]


def test_frames_of_other_interfaces_and_other_stations_are_dropped(wire, raw):
    here, there = wire
    with (
        contextlib.closing(open_packet_socket(0x8892, bpf.acyclic_filter(there, there))) as elsewhere,
        contextlib.closing(open_packet_socket(0x8892, bpf.acyclic_filter(here, here))) as sock,
        raw("there") as peer,
    ):
        peer.send(frame(0xFEFE, destination=b"\x02\xaa\x00\x00\x00\x77"))
        peer.send(frame(0xFEFE, destination=b"\xff" * 6))
        peer.send(frame(0xFEFE, destination=bytes.fromhex("010ecf000000")))
        peer.send(frame(0xFEFE))
        assert [f[:6] for f in received(sock)] == [b"\xff" * 6, bytes.fromhex("010ecf000000"), HERE]
        assert received(elsewhere) == []


@pytest.mark.parametrize("vlan", [1, 4, 0x0FFF])
def test_cyclic_frames_and_alarms_pass_with_any_vlan_id_and_nothing_else_does(wire, raw, vlan):
    here, _ = wire
    with (
        contextlib.closing(open_packet_socket(0x8892, bpf.acyclic_filter(here, here))) as acyclic,
        contextlib.closing(open_packet_socket(0x8892, bpf.cyclic_filter(here, here))) as cyclic,
        raw("there") as peer,
    ):
        for frame_id in IDS:
            peer.send(HERE + THERE + struct.pack(">HH", 0x8100, 6 << 13 | vlan) + frame(frame_id)[12:])
        assert frame_ids(acyclic) == [0xFC01, 0xFE01]
        assert frame_ids(cyclic) == [i for i in IDS if i < 0xFC00]


def test_own_frames_do_not_come_back(wire, raw):
    here, _ = wire
    with (
        contextlib.closing(open_packet_socket(0x0003, bpf.ethertype_filter(here, here))) as everything,
        raw("here") as own,
        raw("there") as peer,
    ):
        own.send(frame(0xFEFE, destination=THERE))
        peer.send(frame(0xFEFF))
        assert frame_ids(everything) == [0xFEFF]


def test_a_priority_tagged_frame_arrives_without_its_tag(wire, raw):
    here, _ = wire
    tagged = HERE + THERE + struct.pack(">HH", 0x8100, 6 << 13) + frame(0xFEFD)[12:]
    with (
        contextlib.closing(open_packet_socket(0x8892, bpf.acyclic_filter(here, here))) as sock,
        raw("there") as peer,
    ):
        peer.send(tagged)
        assert frame_ids(sock) == [0xFEFD]


def test_a_frame_too_short_for_a_frame_id_is_dropped(wire, raw):
    here, _ = wire
    with (
        contextlib.closing(open_packet_socket(0x8892, bpf.acyclic_filter(here, here))) as acyclic,
        contextlib.closing(open_packet_socket(0x8892, bpf.cyclic_filter(here, here))) as cyclic,
        raw("there") as peer,
    ):
        peer.send(HERE + THERE + b"\x88\x92\xfe")
        peer.send(HERE + THERE + b"\x88\x92")
        assert received(acyclic) == []
        assert received(cyclic) == []


@given(st.integers(1, 2**31 - 1), st.integers(0, 10_000))
def test_every_program_is_a_whole_number_of_instructions_that_stays_inside_itself(lowest, width):
    for build in (bpf.acyclic_filter, bpf.cyclic_filter, bpf.ethertype_filter):
        code = build(lowest, lowest + width)
        program = list(struct.iter_unpack("=HBBI", code))
        for place, (code_, jump_true, jump_false, _k) in enumerate(program):
            if code_ & 0x07 == 0x05:
                assert place + 1 + max(jump_true, jump_false) < len(program)
        assert program[-2][3] > 0
        assert program[-1][3] == 0


def test_a_jump_that_does_not_fit_is_refused():
    far = [bpf.Instruction(0x15, 0, "drop")] + [bpf.Instruction(0x20, 0)] * 300
    with pytest.raises(ValueError, match="255"):
        bpf.assemble(far)
    with pytest.raises(ValueError, match="more than"):
        bpf.assemble([bpf.Instruction(0x20, 0)] * 5000)
