from ipaddress import IPv4Address, IPv4Interface

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.inet import ICMP, IP, UDP
from scapy.layers.l2 import ARP, Ether
from scapy.packet import Raw

from pnfarm.protocols.ip.claim import RECHECK_NS, SPREAD_NS, WAIT_NS, AddressClaim, ClaimSign, ClaimState
from pnfarm.protocols.ip.host import (
    ARP_INTERVAL_NS,
    DEFEND_INTERVAL_NS,
    MAXIMUM_DATA,
    QUEUE_LIMIT,
    AddressConflict,
    AddressProbed,
    AddressRefused,
    AddressSettled,
    DatagramReceived,
    IpHost,
)
from pnfarm.protocols.ip.neighbours import CAPACITY, LIFETIME_NS, NeighbourTable
from pnfarm.wire.ethernet import EthernetFrame, parse_ethernet
from pnfarm.wire.mac import format_mac

SECOND = 10**9
MAC_A = bytes.fromhex("020000000001")
MAC_B = bytes.fromhex("020000000002")
MAC_C = bytes.fromhex("020000000003")
A = IPv4Address("10.0.0.1")
B = IPv4Address("10.0.0.2")
FAR = IPv4Address("192.168.7.7")


def host(mac: bytes = MAC_A, address: str | None = "10.0.0.1/24", gateway: IPv4Address | None = None) -> IpHost:
    made = IpHost(mac)
    made.open_ports.add(34964)
    if address is not None:
        made.set_address(IPv4Interface(address), gateway)
        made.to_send(0)  # the announcement
    return made


def sent(machine: IpHost, now: int = 0) -> list[Ether]:
    return [Ether(frame) for frame in machine.to_send(now)]


def feed(machine: IpHost, packet, now: int = 0) -> None:
    machine.receive(parse_ethernet(bytes(packet)), now)


def from_b(layer, destination: bytes = MAC_A) -> Ether:
    return Ether(src=format_mac(MAC_B), dst=format_mac(destination)) / layer


def join(*machines: IpHost, now: int = 0) -> None:
    """Carry frames until everybody is silent."""
    for _ in range(50):
        frames = [(machine, frame) for machine in machines for frame in machine.to_send(now)]
        if not frames:
            return
        for origin, frame in frames:
            for machine in machines:
                if machine is not origin:
                    machine.receive(parse_ethernet(frame), now)
    raise AssertionError("the machines never fall silent")


# -- UDP between two hosts ---------------------------------------------------------------------------------------------


@given(st.integers(0, 9000))
def test_a_datagram_of_any_length_arrives_as_it_was_sent(length):
    one, two = host(), host(MAC_B, "10.0.0.2/24")
    data = bytes(index % 251 for index in range(length))
    one.send(5000, B, 34964, data, 0)
    join(one, two)
    assert two.events() == [DatagramReceived(A, 5000, 34964, data, MAC_A)]
    assert not two.dropped


def test_the_longest_datagram_arrives_and_a_longer_one_is_our_own_mistake():
    one, two = host(), host(MAC_B, "10.0.0.2/24")
    one.send(5000, B, 34964, b"x" * MAXIMUM_DATA, 0)
    join(one, two)
    (event,) = two.events()
    assert len(event.data) == MAXIMUM_DATA
    with pytest.raises(ValueError, match="65507"):
        one.send(5000, B, 34964, b"x" * (MAXIMUM_DATA + 1), 0)


def test_fragments_fit_in_frames_and_scapy_accepts_them():
    one, two = host(), host(MAC_B, "10.0.0.2/24")
    join(one, two)
    one.send(5000, B, 34964, b"", 0)
    join(one, two)
    one.send(5000, B, 34964, bytes(4000), 0)
    frames = sent(one)
    assert [len(frame) for frame in frames] == [1514, 1514, 14 + 20 + 4008 - 2 * 1480]
    assert {frame[IP].id for frame in frames} == {frames[0][IP].id}
    assert [int(frame[IP].flags) for frame in frames] == [1, 1, 0]


def test_a_closed_port_is_silent_and_counted():
    one, two = host(), host(MAC_B, "10.0.0.2/24")
    one.send(5000, B, 9, b"discard", 0)
    join(one, two)
    assert two.events() == []
    assert two.dropped == {"closed-port": 1}


def test_a_datagram_whose_checksum_a_network_card_should_have_finished_is_taken():
    machine = host()
    frame = bytearray(
        bytes(from_b(IP(src="10.0.0.2", dst="10.0.0.1") / UDP(sport=1, dport=34964, chksum=0x1429) / b"abc"))
    )
    # 0x1429 is the sum of the pseudo header alone: 0a00 + 0002 + 0a00 + 0001 + 0011 + 000b + carry
    frame[40:42] = (0x0A00 + 2 + 0x0A00 + 1 + 17 + 11).to_bytes(2, "big")
    machine.receive(parse_ethernet(bytes(frame)), 0)
    assert [event.data for event in machine.events()] == [b"abc"]


def test_a_damaged_datagram_is_dropped():
    machine = host()
    feed(machine, from_b(IP(src="10.0.0.2", dst="10.0.0.1") / UDP(sport=1, dport=34964, chksum=0x1234) / b"abc"))
    feed(machine, from_b(IP(src="10.0.0.2", dst="10.0.0.1", chksum=1) / UDP(sport=1, dport=34964) / b"abc"))
    assert machine.events() == []
    assert machine.dropped == {"udp-bad-checksum": 1, "ipv4-bad-checksum": 1}


@pytest.mark.parametrize("destination", ["10.0.0.255", "255.255.255.255"])
def test_broadcasts_reach_an_open_port(destination):
    machine = host()
    feed(machine, from_b(IP(src="10.0.0.2", dst=destination) / UDP(sport=1, dport=34964) / b"all", b"\xff" * 6))
    assert [event.data for event in machine.events()] == [b"all"]


@pytest.mark.parametrize(
    ("address", "mac"), [("10.0.0.255", "ff:ff:ff:ff:ff:ff"), ("239.129.1.2", "01:00:5e:01:01:02")]
)
def test_broadcasts_and_multicasts_go_out_without_arp(address, mac):
    machine = host()
    machine.send(1, IPv4Address(address), 2, b"", 0)
    (frame,) = sent(machine)
    assert frame.dst == mac


# -- next hop ----------------------------------------------------------------------------------------------------------


def test_an_unknown_neighbour_is_asked_for_three_times_then_given_up():
    machine = host()
    machine.send(1, B, 2, b"one", 0)
    machine.send(1, B, 2, b"two", 0)
    asked = sent(machine)
    assert [(frame.dst, frame[ARP].op, frame[ARP].pdst) for frame in asked] == [("ff:ff:ff:ff:ff:ff", 1, "10.0.0.2")]
    for now in (SECOND, 2 * SECOND):
        assert machine.next_deadline() == now
        assert len(sent(machine, now)) == 1
    assert sent(machine, 3 * ARP_INTERVAL_NS) == []
    assert machine.dropped == {"unresolved": 2}
    assert machine.next_deadline() is None


def test_what_waited_for_an_address_goes_out_in_order_once_it_is_known():
    machine = host()
    for text in (b"one", b"two"):
        machine.send(1, B, 2, text, 0)
    sent(machine)
    feed(machine, from_b(ARP(op=2, hwsrc=format_mac(MAC_B), psrc="10.0.0.2", hwdst=format_mac(MAC_A), pdst="10.0.0.1")))
    frames = sent(machine)
    assert [(frame.dst, frame[UDP].payload.load[:3]) for frame in frames] == [
        (format_mac(MAC_B), b"one"),
        (format_mac(MAC_B), b"two"),
    ]


def test_the_queue_for_an_unknown_neighbour_is_bounded():
    machine = host()
    for index in range(QUEUE_LIMIT + 3):
        machine.send(1, B, 2, bytes([index]), 0)
    assert machine.dropped == {"queue-full": 3}
    for index in range(100):
        machine.send(1, IPv4Address(f"10.0.0.{index + 100}"), 2, b"", 0)
    assert machine.dropped["queue-full"] > 80


def test_an_answer_goes_to_the_address_a_datagram_came_from_even_off_the_subnet():
    machine = host()
    feed(machine, from_b(IP(src=str(FAR), dst="10.0.0.1") / UDP(sport=7, dport=34964) / b"ask"))
    machine.send(34964, FAR, 7, b"answer", 0)
    (frame,) = sent(machine)
    assert (frame.dst, frame[IP].dst) == (format_mac(MAC_B), str(FAR))


def test_beyond_the_subnet_the_gateway_is_asked_for():
    machine = host(gateway=B)
    machine.send(1, FAR, 2, b"far", 0)
    (ask,) = sent(machine)
    assert ask[ARP].pdst == "10.0.0.2"


@pytest.mark.parametrize("gateway", [None, A])
def test_without_a_gateway_there_is_no_way_out(gateway):
    machine = host(gateway=gateway)
    machine.send(1, FAR, 2, b"far", 0)
    assert sent(machine) == []
    assert machine.dropped == {"no-route": 1}


def test_an_old_neighbour_is_asked_for_again():
    one, two = host(), host(MAC_B, "10.0.0.2/24")
    one.send(1, B, 34964, b"", 0)
    join(one, two)
    later = LIFETIME_NS + 1
    one.send(1, B, 34964, b"", later)
    (ask,) = sent(one, later)
    assert ask[ARP].op == 1


def test_a_neighbour_that_announces_a_new_mac_address_is_followed():
    one, two = host(), host(MAC_B, "10.0.0.2/24")
    one.send(1, B, 34964, b"", 0)
    join(one, two)
    replacement = host(MAC_C, None)
    replacement.set_address(IPv4Interface("10.0.0.2/24"))
    join(one, replacement)
    one.send(1, B, 34964, b"", 0)
    (frame,) = sent(one)
    assert frame.dst == format_mac(MAC_C)


def test_the_neighbour_table_is_bounded():
    table = NeighbourTable()
    for index in range(CAPACITY + 10):
        table.learn(IPv4Address(index + 1), MAC_B, index)
    assert len(table) == CAPACITY
    assert table.lookup(IPv4Address(1), 0) is None
    assert table.lookup(IPv4Address(CAPACITY + 10), CAPACITY + 10) == MAC_B


# -- answers -----------------------------------------------------------------------------------------------------------


def test_an_arp_request_for_the_own_address_is_answered():
    machine = host()
    ask = ARP(op=1, hwsrc=format_mac(MAC_B), psrc="10.0.0.2", pdst="10.0.0.1")
    feed(machine, from_b(ask, b"\xff" * 6))
    (reply,) = sent(machine)
    seen = reply[ARP]
    assert (reply.dst, seen.op, seen.hwsrc, seen.psrc, seen.hwdst, seen.pdst) == (
        format_mac(MAC_B), 2, format_mac(MAC_A), "10.0.0.1", format_mac(MAC_B), "10.0.0.2",
    )  # fmt: skip


@pytest.mark.parametrize("size", [0, 1, 56, 1472, 4000])
def test_a_ping_of_any_size_comes_back_whole(size):
    machine = host()
    data = bytes(index % 256 for index in range(size))
    request = bytes(ICMP(id=3, seq=4) / Raw(data))
    for offset in range(0, len(request), 1480):
        more = offset + 1480 < len(request)
        part = IP(src="10.0.0.2", dst="10.0.0.1", proto=1, id=9, flags=int(more), frag=offset // 8)
        feed(machine, from_b(part / Raw(request[offset : offset + 1480])))
    frames = sent(machine)
    payload = b"".join(bytes(frame[IP].payload)[: frame[IP].len - 20] for frame in frames)
    reply = ICMP(payload)
    assert (reply.type, reply.id, reply.seq) == (0, 3, 4)
    assert payload[8:] == data
    assert {frame.dst for frame in frames} == {format_mac(MAC_B)}


def test_other_icmp_and_broadcast_pings_stay_unanswered():
    machine = host()
    feed(machine, from_b(IP(src="10.0.0.2", dst="10.0.0.1") / ICMP(type=3)))
    feed(machine, from_b(IP(src="10.0.0.2", dst="10.0.0.255") / ICMP(), b"\xff" * 6))
    assert sent(machine) == []
    assert machine.dropped == {"icmp-other": 2}


# -- the own address ---------------------------------------------------------------------------------------------------


def test_a_new_address_is_announced():
    machine = IpHost(MAC_A)
    machine.set_address(IPv4Interface("10.0.0.1/24"))
    (frame,) = sent(machine)
    assert (frame.dst, frame[ARP].op, frame[ARP].psrc, frame[ARP].pdst) == (
        "ff:ff:ff:ff:ff:ff",
        1,
        "10.0.0.1",
        "10.0.0.1",
    )
    assert machine.address == IPv4Interface("10.0.0.1/24")


def test_without_an_address_nothing_is_answered_or_sent():
    machine = host(address=None)
    feed(machine, from_b(ARP(op=1, hwsrc=format_mac(MAC_B), psrc="10.0.0.2", pdst="10.0.0.1"), b"\xff" * 6))
    feed(machine, from_b(IP(src="10.0.0.2", dst="10.0.0.1") / ICMP()))
    machine.send(1, B, 2, b"", 0)
    assert sent(machine) == []
    assert machine.dropped == {"no-address": 2}


def test_giving_up_the_address_drops_what_waited():
    machine = host()
    machine.send(1, B, 2, b"", 0)
    machine.set_address(None)
    assert machine.dropped == {"address-changed": 1}
    assert machine.next_deadline() is None


def test_a_conflict_is_reported_and_the_address_defended_once_in_ten_seconds():
    machine = host()
    claim = from_b(ARP(op=1, hwsrc=format_mac(MAC_B), psrc="10.0.0.1", pdst="10.0.0.1"), b"\xff" * 6)
    for now in (0, SECOND, 2 * SECOND):
        feed(machine, claim, now)
    assert machine.events() == [AddressConflict(A, MAC_B)]
    assert [frame[ARP].psrc for frame in sent(machine)] == ["10.0.0.1"]
    feed(machine, claim, DEFEND_INTERVAL_NS)
    assert machine.events() == [AddressConflict(A, MAC_B)]
    assert len(sent(machine)) == 1


def test_a_probe_of_a_free_address_asks_three_times():
    machine = host(address=None)
    machine.probe(B, 0)
    questions = [frame[ARP] for now in range(4) for frame in sent(machine, now * SECOND)]
    assert [(question.psrc, question.pdst) for question in questions] == [("0.0.0.0", "10.0.0.2")] * 3
    assert machine.events() == [AddressProbed(B, None)]
    assert machine.next_deadline() is None


def test_a_probe_finds_the_holder_at_once():
    one, two = host(address=None), host(MAC_B, "10.0.0.2/24")
    one.probe(B, 0)
    join(one, two)
    assert one.events() == [AddressProbed(B, MAC_B)]
    assert two.events() == []  # a probe is no conflict


def test_two_that_probe_for_the_same_address_both_find_a_conflict():
    one, two = host(address=None), host(MAC_B, None)
    one.probe(B, 0)
    two.probe(B, 0)
    join(one, two)
    assert one.events() == [AddressProbed(B, MAC_B)]
    assert two.events() == [AddressProbed(B, MAC_A)]


# -- the right to an address -------------------------------------------------------------------------------------------


def claiming(mac: bytes = MAC_A, now: int = 0) -> IpHost:
    made = IpHost(mac)
    made.claim_address(IPv4Interface("10.0.0.1/24"), None, now)
    return made


def questions(machine: IpHost, now: int = 0) -> list[tuple[str, str]]:
    return [(frame[ARP].psrc, frame[ARP].pdst) for frame in sent(machine, now)]


ASK, ANNOUNCE = ("0.0.0.0", "10.0.0.1"), ("10.0.0.1", "10.0.0.1")
HELD_BY_B = from_b(ARP(op=2, hwsrc=format_mac(MAC_B), psrc="10.0.0.1", pdst="0.0.0.0"))


def test_an_address_that_was_given_is_asked_for_used_at_once_and_announced_after_a_second():
    machine = claiming()
    assert questions(machine) == [ASK]
    feed(machine, from_b(ARP(op=1, hwsrc=format_mac(MAC_B), psrc="10.0.0.2", pdst="10.0.0.1"), b"\xff" * 6))
    assert [frame[ARP].op for frame in sent(machine)] == [2]
    assert machine.next_deadline() == WAIT_NS
    assert questions(machine, WAIT_NS) == [ANNOUNCE]
    assert machine.next_deadline() is None
    assert machine.events() == []


def test_an_address_that_another_station_has_is_left_to_it():
    machine = claiming()
    machine.send(1, B, 2, b"", 0)
    sent(machine)
    feed(machine, HELD_BY_B)
    assert machine.events() == [AddressRefused(A, MAC_B)]
    assert machine.address is None
    assert str(machine.wanted) == "10.0.0.1/24"
    feed(machine, from_b(ARP(op=1, hwsrc=format_mac(MAC_B), psrc="10.0.0.2", pdst="10.0.0.1"), b"\xff" * 6))
    feed(machine, from_b(IP(src="10.0.0.2", dst="10.0.0.1") / ICMP()))
    assert sent(machine) == []
    assert machine.dropped == {"address-refused": 1, "no-address": 1}


def test_a_refused_address_is_asked_for_again_until_it_is_free():
    machine = claiming()
    feed(machine, HELD_BY_B)
    sent(machine)
    first = machine.next_deadline()
    assert RECHECK_NS <= first < RECHECK_NS + SPREAD_NS
    assert questions(machine, first) == [ASK]
    feed(machine, HELD_BY_B, first + 1)
    assert machine.address is None
    second = machine.next_deadline()
    assert questions(machine, second) == [ASK]
    assert questions(machine, second + WAIT_NS) == [ANNOUNCE]
    assert machine.events() == [AddressRefused(A, MAC_B), AddressSettled(A)]
    assert str(machine.address) == "10.0.0.1/24"
    assert machine.next_deadline() is None


def test_a_scanner_that_asks_for_the_address_is_no_objection():
    machine = claiming()
    sent(machine)
    feed(machine, from_b(ARP(op=1, hwsrc=format_mac(MAC_B), psrc="0.0.0.0", pdst="10.0.0.1"), b"\xff" * 6))
    assert [frame[ARP].op for frame in sent(machine)] == [2]
    assert machine.events() == []


def test_a_conflict_ends_when_the_other_station_is_silent():
    machine = host()
    claim = from_b(ARP(op=1, hwsrc=format_mac(MAC_B), psrc="10.0.0.1", pdst="10.0.0.1"), b"\xff" * 6)
    feed(machine, claim)
    assert questions(machine) == [ANNOUNCE]
    due = machine.next_deadline()
    assert questions(machine, due) == [ASK]
    feed(machine, HELD_BY_B, due + 1)
    assert machine.events() == [AddressConflict(A, MAC_B), AddressConflict(A, MAC_B)]
    due = machine.next_deadline()
    assert [q for q in questions(machine, due) if q == ASK] == [ASK]
    assert sent(machine, due + WAIT_NS) == []
    assert machine.events() == [AddressSettled(A)]
    assert machine.next_deadline() is None
    assert str(machine.address) == "10.0.0.1/24"  # it was used all the time


def test_two_that_are_given_one_address_do_not_both_get_it():
    one, two = claiming(MAC_A), claiming(MAC_B)
    join(one, two)
    assert one.events() == [AddressRefused(A, MAC_B)]
    assert two.events() == [AddressRefused(A, MAC_A)]
    for now in range(0, 60 * SECOND, SECOND // 100):
        join(one, two, now=now)
    holders = [machine for machine in (one, two) if machine.address is not None]
    assert len(holders) == 1
    assert AddressSettled(A) in holders[0].events()


def test_two_that_have_one_address_from_the_start_both_know_and_keep_it():
    one, two = host(MAC_A, "10.0.0.1/24"), IpHost(MAC_B)
    two.set_address(IPv4Interface("10.0.0.1/24"))
    frames = 0
    for now in range(0, 60 * SECOND, SECOND):
        for _ in range(10):
            moved = [
                (origin, other, octets) for origin, other in ((one, two), (two, one)) for octets in origin.to_send(now)
            ]
            frames += len(moved)
            for _, other, octets in moved:
                other.receive(parse_ethernet(octets), now)
    assert {type(event) for machine in (one, two) for event in machine.events()} == {AddressConflict}
    assert frames < 40  # they do not shout at each other
    two.set_address(None)
    for now in range(60 * SECOND, 90 * SECOND, SECOND):
        one.to_send(now)
    assert AddressSettled(A) in one.events()


def test_giving_up_a_claimed_address_ends_the_claim():
    machine = claiming()
    machine.set_address(None)
    assert machine.next_deadline() is None
    feed(machine, HELD_BY_B)
    assert machine.events() == []


def test_an_address_given_again_starts_over():
    machine = claiming()
    feed(machine, HELD_BY_B)
    machine.claim_address(IPv4Interface("10.0.0.7/24"), None, SECOND)
    feed(machine, HELD_BY_B, SECOND)
    assert machine.events() == [AddressRefused(A, MAC_B)]
    assert str(machine.address) == "10.0.0.7/24"


@given(st.lists(st.sampled_from(list(ClaimSign))))
def test_every_claim_comes_to_rest_or_waits(signs):
    claim = AddressClaim(MAC_A)
    for now, sign in enumerate(signs):
        claim.sign(sign, now)
        waits = claim.state not in {ClaimState.NONE, ClaimState.BOUND}
        assert (claim.deadline is not None) == waits
        assert claim.deadline is None or claim.deadline > now


# -- strangers ---------------------------------------------------------------------------------------------------------


def test_frames_for_others_are_counted():
    machine = host()
    feed(machine, from_b(IP(src="10.0.0.2", dst="10.0.0.1") / ICMP(), MAC_C))
    feed(machine, from_b(IP(src="10.0.0.2", dst="10.0.0.9") / ICMP()))
    machine.receive(EthernetFrame(MAC_A, MAC_B, 0x8892, b""), 0)
    machine.receive(EthernetFrame(MAC_A, MAC_A, 0x0800, b""), 0)
    assert machine.dropped == {"other-destination": 1, "other-address": 1, "other-protocol": 1, "bad-source": 1}


@pytest.mark.parametrize(
    ("layer", "reason"),
    [
        (ARP(hwtype=6), "arp-bad-type"),
        (ARP(hwsrc=format_mac(MAC_A), psrc="10.0.0.2", pdst="10.0.0.1"), "arp-bad-sender"),
        (IP(src="10.0.0.2", dst="10.0.0.1", proto=6) / Raw(b"tcp"), "ipv4-protocol"),
        (IP(src="10.0.0.1", dst="10.0.0.1") / UDP(dport=34964), "ipv4-bad-source"),
        (IP(src="10.0.0.255", dst="10.0.0.1") / UDP(dport=34964), "ipv4-bad-source"),
        (IP(src="0.0.0.0", dst="10.0.0.1") / UDP(dport=34964), "ipv4-bad-source"),
        (IP(src="10.0.0.2", dst="10.0.0.1", proto=17) / Raw(b"udp"), "udp-short"),
        (IP(src="10.0.0.2", dst="10.0.0.1") / ICMP(chksum=1), "icmp-bad-checksum"),
    ],
)
def test_what_cannot_be_meant_is_dropped_by_reason(layer, reason):
    machine = host()
    feed(machine, from_b(layer))
    assert machine.dropped == {reason: 1}
    assert sent(machine) == []
    assert machine.events() == []


def test_the_gateway_and_the_neighbours_of_a_tiny_subnet_are_reached():
    machine = host(address="10.0.0.1/31", gateway=IPv4Address("10.0.0.0"))
    assert machine.gateway == IPv4Address("10.0.0.0")
    machine.send(1, IPv4Address("10.0.0.0"), 2, b"", 0)
    (ask,) = sent(machine)
    assert ask[ARP].pdst == "10.0.0.0"


def test_an_unfinished_packet_is_given_up_after_thirty_seconds():
    machine = host()
    feed(machine, from_b(IP(src="10.0.0.2", dst="10.0.0.1", flags="MF") / Raw(bytes(8))), 5)
    assert machine.next_deadline() == 5 + 30 * SECOND
    machine.handle_timeout(5 + 30 * SECOND)
    assert machine.dropped == {"fragment-timeout": 1}
    assert machine.next_deadline() is None


@given(st.sampled_from([0x0800, 0x0806]), st.binary(max_size=80), st.booleans())
def test_any_payload_is_survived(ethertype, payload, prefixed):
    machine = host()
    prefix = b"\x45\0\0\x30\0\0\0\0\x40\x11" if prefixed else b""
    machine.receive(EthernetFrame(MAC_A, MAC_B, ethertype, prefix + payload), 0)
    machine.to_send(0)
