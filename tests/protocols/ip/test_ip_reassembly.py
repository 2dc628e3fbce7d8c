from collections import Counter
from ipaddress import IPv4Address

from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.ip.reassembly import MAXIMUM_FRAGMENTS, MAXIMUM_PACKETS, TIMEOUT_NS, Reassembler
from pnfarm.wire.ipv4 import Ipv4Packet

A = IPv4Address("10.0.0.1")
B = IPv4Address("10.0.0.2")


def piece(offset: int, data: bytes, *, more: bool, identification: int = 1) -> Ipv4Packet:
    return Ipv4Packet(A, B, 17, data, identification=identification, more_fragments=more, fragment_offset=offset)


def pieces_of(payload: bytes, step: int) -> list[Ipv4Packet]:
    return [
        piece(offset, payload[offset : offset + step], more=offset + step < len(payload))
        for offset in range(0, len(payload), step)
    ]


@given(st.binary(min_size=9, max_size=400), st.randoms(use_true_random=False))
def test_pieces_in_any_order_and_twice_become_the_packet_once(payload, random):
    pieces = pieces_of(payload, 8)
    shuffled = pieces + pieces[: len(pieces) // 2]
    random.shuffle(shuffled)
    reassembler = Reassembler(Counter())
    whole = [packet for packet in (reassembler.receive(item, 0) for item in shuffled) if packet is not None]
    assert [packet.payload for packet in whole] == [payload]
    assert not whole[0].more_fragments
    assert whole[0].fragment_offset == 0


def test_an_unfragmented_packet_passes_untouched():
    packet = Ipv4Packet(A, B, 17, b"whole")
    assert Reassembler(Counter()).receive(packet, 0) is packet


def test_overlapping_pieces_give_the_packet_up():
    dropped = Counter()
    reassembler = Reassembler(dropped)
    assert reassembler.receive(piece(0, b"a" * 16, more=True), 0) is None
    assert reassembler.receive(piece(8, b"b" * 16, more=True), 0) is None
    assert dropped == {"fragment-overlap": 1}
    assert reassembler.next_deadline() is None


def test_fragments_beyond_the_last_one_discard_the_packet():
    dropped = Counter()
    reassembler = Reassembler(dropped)
    reassembler.receive(piece(8, b"end", more=False), 0)
    reassembler.receive(piece(16, b"b" * 8, more=True), 0)
    reassembler.receive(piece(16, b"c" * 8, more=True, identification=2), 0)
    reassembler.receive(piece(8, b"end", more=False, identification=2), 0)
    assert dropped == {"fragment-overlap": 2}


def test_a_piece_of_a_wrong_length_is_refused():
    dropped = Counter()
    reassembler = Reassembler(dropped)
    reassembler.receive(piece(0, b"seven..", more=True), 0)
    reassembler.receive(piece(65528, b"beyond the longest packet", more=False), 0)
    reassembler.receive(piece(8, b"", more=False), 0)
    assert dropped == {"fragment-bad-length": 3}


def test_only_a_few_packets_are_in_progress_and_each_has_a_time_limit():
    dropped = Counter()
    reassembler = Reassembler(dropped)
    for identification in range(MAXIMUM_PACKETS + 1):
        reassembler.receive(piece(0, b"x" * 8, more=True, identification=identification), identification)
    assert dropped == {"fragment-displaced": 1}
    assert reassembler.next_deadline() == 1 + TIMEOUT_NS
    reassembler.handle_timeout(MAXIMUM_PACKETS + TIMEOUT_NS)
    assert dropped["fragment-timeout"] == MAXIMUM_PACKETS
    assert reassembler.next_deadline() is None


def test_tiny_pieces_without_end_are_given_up():
    dropped = Counter()
    reassembler = Reassembler(dropped)
    for index in range(MAXIMUM_FRAGMENTS + 1):
        reassembler.receive(piece(16 * index, b"x" * 8, more=True), 0)
    assert dropped == {"fragment-overlap": 1}


@given(st.lists(st.tuples(st.integers(0, 20), st.binary(max_size=24), st.booleans(), st.integers(0, 6)), max_size=60))
def test_any_pieces_are_survived_within_bounds(items):
    reassembler = Reassembler(Counter())
    for now, (units, data, more, identification) in enumerate(items):
        packet = piece(units * 8, data, more=more, identification=identification)
        reassembler.receive(packet, now)
        assert len(reassembler._partials) <= MAXIMUM_PACKETS


def test_a_sender_of_many_pieces_displaces_its_own_packets():
    dropped = Counter()
    reassembler = Reassembler(dropped)
    whole = b"first half" + b"      " + b"second half"
    first, second = pieces_of(whole, 16)
    reassembler.receive(first, 0)
    for identification in range(50):
        stranger = Ipv4Packet(B, A, 17, b"x" * 8, identification=identification, more_fragments=True)
        reassembler.receive(stranger, identification)
    assert dropped["fragment-displaced"] == 50 - (MAXIMUM_PACKETS - 1)
    packet = reassembler.receive(second, 100)
    assert packet is not None
    assert packet.payload == whole


def test_a_piece_within_another_gives_the_packet_up():
    """The teardrop: a second piece that ends before the first one does."""
    dropped = Counter()
    reassembler = Reassembler(dropped)
    reassembler.receive(piece(0, b"a" * 64, more=True), 0)
    assert reassembler.receive(piece(24, b"b" * 4, more=False), 0) is None
    assert dropped == {"fragment-overlap": 1}
    assert reassembler.next_deadline() is None


def test_the_octets_held_are_bounded():
    reassembler = Reassembler(Counter())
    for identification in range(100):
        for index in range(MAXIMUM_FRAGMENTS):
            reassembler.receive(piece(512 * index, b"x" * 512, more=True, identification=identification), 0)
    held = sum(len(data) for partial in reassembler._partials.values() for _, data in partial.pieces)
    assert held <= MAXIMUM_PACKETS * 65_535
