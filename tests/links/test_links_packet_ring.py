"""The capture's socket: both directions, the kinds that are wanted, tags as they were on the wire."""

from __future__ import annotations

import socket
import time
from ipaddress import IPv4Address

import numpy as np
import pytest
from scapy.utils import RawPcapNgReader

from pnfarm.engine.sockets.capture import ROOM_FACTOR, pack_block
from pnfarm.links.capture.pcap import interface_description, section_header
from pnfarm.links.kernel.bpf_capture import ATOMS, KINDS, atoms_of, capture_filter
from pnfarm.links.kernel.packet_ring import BLOCK, PacketRing
from pnfarm.wire.ethernet import EthernetFrame, VlanTag, emit_ethernet
from pnfarm.wire.ipv4 import PROTOCOL_ICMP, PROTOCOL_UDP, Ipv4Packet, emit_ipv4
from pnfarm.wire.udp import UdpDatagram, emit_udp

DRIVE, PLC = b"\x02\0\0\0\0\x01", b"\x02\0\0\0\0\x02"
HERE, THERE = IPv4Address("10.0.0.1"), IPv4Address("10.0.0.2")


def ip(protocol: int, payload: bytes, **fields) -> bytes:
    return emit_ipv4(Ipv4Packet(HERE, THERE, protocol, payload, **fields))


def udp(source: int, destination: int, data: bytes = b"\x04" * 90) -> bytes:
    return ip(PROTOCOL_UDP, emit_udp(UdpDatagram(source, destination, data), HERE, THERE))


#: kind -> (EtherType, payload) of frames that are of this kind.
FRAMES = {
    "cyclic": [
        (0x8892, b"\x80\x01" + bytes(44)),
        (0x8892, b"\xfb\xff" + bytes(44)),
        (0x0800, udp(2222, 2222, bytes(90))),
    ],
    "dcp": [(0x8892, b"\xfe\xfe" + bytes(44)), (0x8892, b"\xfe\xfd" + bytes(44))],
    "alarm": [(0x8892, b"\xfe\x01" + bytes(44)), (0x8892, b"\xfc\x01" + bytes(44))],
    "rpc": [
        (0x0800, udp(0x8894, 49152)),
        (0x0800, udp(50000, 50001)),
        (0x0800, ip(PROTOCOL_UDP, bytes(80), fragment_offset=1480)),
    ],
    "snmp": [(0x0800, udp(161, 40000)), (0x0800, udp(40000, 162))],
    "enip": [
        (0x0800, udp(44818, 40000)),
        (0x0800, udp(40000, 44818)),
        (0x0800, ip(6, bytes.fromhex("af12c350") + bytes(60))),
        (0x0800, ip(6, bytes.fromhex("c350af12") + bytes(60))),
    ],
    "arp": [(0x0806, bytes(46))],
    "icmp": [(0x0800, ip(PROTOCOL_ICMP, bytes(60)))],
    "lldp": [(0x88CC, bytes(46))],
    "ptcp": [(0x8892, bytes.fromhex(frame_id) + bytes(44)) for frame_id in ("0020", "0081", "ff00", "ff20", "ff43")],
    "other": [
        (0x0800, ip(6, bytes(60))),
        (0x0800, udp(137, 137, bytes(90))),
        *(
            (0x8892, bytes.fromhex(frame_id) + bytes(44))
            for frame_id in ("0000", "00ff", "fc02", "ff02", "ff80", "ffff")
        ),
        (0x86DD, bytes(60)),
    ],
}


def emitted(ethertype: int, payload: bytes, tag: VlanTag | None = None, to: bytes = PLC) -> bytes:
    return emit_ethernet(EthernetFrame(to, DRIVE, ethertype, payload, tag))


EVERY = [(kind, emitted(*shape, tag)) for kind, shapes in FRAMES.items() for shape in shapes
         for tag in (None, VlanTag(priority=6))]  # fmt: skip


def captured(ring: PacketRing, tmp_path, indexes: list[int], *, far_end: bool = False) -> list[tuple[bytes, int, str]]:
    """What came in until now, by way of a file: (frame, direction, interface)."""
    memory = np.frombuffer(ring.memory, np.uint8)
    out = np.zeros(BLOCK * ROOM_FACTOR, np.uint8)
    numbers = np.full(max(indexes) - min(indexes) + 1, -1, np.int32)
    head = section_header()
    for number, index in enumerate(indexes):
        numbers[index - min(indexes)] = number
        head += interface_description(f"axis-{number}", mac=DRIVE)
    counts = np.zeros(len(indexes) + 1, np.int64)
    blocks = b""
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        ring.wait(50)
        for start in ring.take():
            length = pack_block(
                memory, memory.view(np.int32), start, numbers, min(indexes), far_end, out, out.view(np.uint32), counts
            )
            blocks += out[:length].tobytes()
    del memory
    path = tmp_path / "seen.pcapng"
    path.write_bytes(head + blocks)
    with RawPcapNgReader(str(path)) as reader:
        found = [(data, meta.direction, meta.ifname.decode()) for data, meta in reader]
    assert counts[-1] == 0
    assert counts.sum() == len(found)
    return found


@pytest.fixture
def send(cable):
    """Sends a frame out of one end of the cable."""
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as sock:
        yield lambda interface, frame: sock.sendto(frame, (interface, 0))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_filter_lets_its_kind_through_in_both_directions(cable, send, tmp_path, kind):
    index = socket.if_nametoindex(cable[0])
    ring = PacketRing(capture_filter([index], atoms_of([kind]), others=True))
    try:
        for end in cable:
            for _, frame in EVERY:
                send(end, frame)
        found = captured(ring, tmp_path, [index])
    finally:
        ring.close()
    # a message of CIP is inside of one of the encapsulation
    kinds = KINDS[kind] | ({"enip"} if "cip" in KINDS[kind] else set())
    wanted = [frame for atom, frame in EVERY if atom in kinds]
    for direction in (1, 2):
        assert [data for data, way, _ in found if way == direction] == wanted


def test_without_kinds_everything_passes_with_its_tag(cable, send, tmp_path):
    index = socket.if_nametoindex(cable[0])
    ring = PacketRing(capture_filter([index], ATOMS, others=True))
    try:
        for _, frame in EVERY:
            send(cable[1], frame)
        found = captured(ring, tmp_path, [index])
    finally:
        ring.close()
    assert [data for data, _, _ in found] == [frame for _, frame in EVERY]


def test_frames_for_other_hosts_and_of_other_interfaces_are_left_out(ip, cable, send, tmp_path):
    index = socket.if_nametoindex(cable[0])
    mine = bytes.fromhex(ip("-o", "link", "show", cable[0]).split("link/ether ")[1].split()[0].replace(":", ""))
    ring = PacketRing(capture_filter([index], ATOMS))
    try:
        send(cable[1], emitted(0x8892, b"\x80\x01" + bytes(44), to=PLC))
        send(cable[1], emitted(0x8892, b"\x80\x02" + bytes(44), to=mine))
        found = captured(ring, tmp_path, [index])
    finally:
        ring.close()
    assert [data[14:16] for data, _, _ in found] == [b"\x80\x02"]


def test_at_the_far_end_of_the_cable_directions_turn_round(cable, send, tmp_path):
    index = socket.if_nametoindex(cable[1])
    ring = PacketRing(capture_filter([index], ATOMS, others=True))
    try:
        send(cable[0], emitted(0x0806, bytes(46)))
        found = captured(ring, tmp_path, [index], far_end=True)
    finally:
        ring.close()
    assert [way for _, way, _ in found] == [2]


def test_an_interface_that_goes_and_comes_stays_captured(ip, cable, send, frames_pass, tmp_path):
    index = socket.if_nametoindex(cable[0])
    ring = PacketRing(capture_filter([index], ATOMS, others=True))
    try:
        ip("link", "set", cable[0], "down")
        ip("link", "set", cable[0], "up")
        frames_pass(*cable)
        send(cable[1], emitted(0x0806, bytes(46)))
        found = captured(ring, tmp_path, [index])
    finally:
        ring.close()
    assert emitted(0x0806, bytes(46)) in [data for data, _, _ in found]


def test_what_finds_no_room_is_counted(cable, send, tmp_path):
    index = socket.if_nametoindex(cable[0])
    ring = PacketRing(capture_filter([index], ATOMS, others=True), size=2 * BLOCK)
    frame = emitted(0x8892, b"\x80\x01" + bytes(1400))
    try:
        for _ in range(2000):
            send(cable[1], frame)
        lost = ring.lost()
        found = captured(ring, tmp_path, [index])
    finally:
        ring.close()
    assert lost > 0
    assert len(found) + lost == 2000


def test_the_kernel_takes_a_filter_of_scattered_interfaces(cable, send, tmp_path):
    index = socket.if_nametoindex(cable[0])
    ring = PacketRing(capture_filter([index, *range(1001, 2600, 2)], ATOMS, others=True))
    try:
        send(cable[1], emitted(0x0806, bytes(46)))
        found = captured(ring, tmp_path, [index])
    finally:
        ring.close()
    assert len(found) == 1


def test_more_runs_than_a_filter_takes_become_one_range():
    assert len(capture_filter(range(1, 9000, 2), ATOMS)) == len(capture_filter([1, 2], ATOMS))


def test_an_interface_between_two_captured_ones_is_left_out(cable, send, tmp_path):
    first, last = sorted(socket.if_nametoindex(end) for end in cable)
    ring = PacketRing(capture_filter([1, last], ATOMS, others=True))
    try:
        assert first > 1
        send(cable[0], emitted(0x0806, bytes(46)))
        found = captured(ring, tmp_path, [1, last])
    finally:
        ring.close()
    assert [name for _, _, name in found] == ["axis-1"]
