"""The two halves of a fragmented transfer."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.profinet.rpc.fragments import FRAGMENTS_MAX, FragmentSender, Reassembly, fack_body, is_newer
from pnfarm.protocols.profinet.wire.rpc.bodies import FackBody
from pnfarm.protocols.profinet.wire.rpc.pdu import FRAGMENT_NONE, Flags1


@given(st.binary(max_size=400), st.integers(1, 64), st.randoms(use_true_random=False))
def test_fragments_in_any_order_join_to_what_was_cut(stub, size, random):
    sender = FragmentSender(stub, size)
    fragments = []
    while not sender.delivered:
        burst = list(sender.due())
        fragments += burst
        sender.acknowledge(burst[-1].number, FackBody(64, 65536, 1464, 0))
    if len(fragments) > FRAGMENTS_MAX:
        return
    random.shuffle(fragments)
    whole = Reassembly(1_000)
    for fragment in fragments:
        last = not sender.fragmented or bool(fragment.flags1 & Flags1.LAST_FRAGMENT)
        assert whole.add(fragment.number, fragment.body, last=last) is None
        assert whole.add(fragment.number, b"other", last=last) == "duplicate-fragment"
    assert whole.complete
    assert whole.stub() == stub


def test_only_the_last_fragment_of_a_burst_asks_for_acknowledgement():
    sender = FragmentSender(bytes(100), 10)
    list(sender.due())
    for _ in range(3):
        sender.acknowledge(sender.next - 1, FackBody(8, 65536, 1464, 0))
        burst = list(sender.due())
    assert [bool(fragment.flags1 & Flags1.NO_FACK) for fragment in burst] == [True, True, True, False]


def test_the_window_stays_shut_for_receivers_that_advertise_none():
    sender = FragmentSender(bytes(100), 10)
    for number in range(10):
        assert [fragment.number for fragment in sender.due()] == [number]
        assert sender.acknowledge(number, None)
    assert sender.delivered


def test_an_acknowledgement_out_of_reach_is_ignored():
    sender = FragmentSender(bytes(100), 10)
    list(sender.due())
    for number in (1, 9, FRAGMENT_NONE):
        assert not sender.acknowledge(number, None)
    assert sender.acknowledge(0, None)
    assert not sender.acknowledge(0, None)


def test_a_late_acknowledgement_of_what_was_sent_before_a_step_back_counts():
    sender = FragmentSender(bytes(30), 10)
    list(sender.due())
    sender.acknowledge(0, fack_body(0))
    assert [fragment.number for fragment in sender.due()] == [1, 2]
    sender.rewind()
    assert sender.acknowledge(2, None)
    assert sender.delivered


@pytest.mark.parametrize(
    ("number", "last", "reason"),
    [(FRAGMENTS_MAX, False, "fragment-number"), (3, False, "fragment-number"), (0, True, "fragment-number")],
)
def test_fragments_beyond_the_end_or_the_bound_are_refused(number, last, reason):
    whole = Reassembly(100)
    whole.add(1, b"x", last=False)
    whole.add(2, b"y", last=True)
    assert whole.add(number, b"z", last=last) == reason


def test_octets_beyond_the_bound_are_refused():
    whole = Reassembly(10)
    assert whole.add(0, bytes(10), last=False) is None
    assert whole.add(1, b"x", last=True) == "too-long"


def test_sequence_numbers_wrap_in_comparisons():
    assert is_newer(1, 0)
    assert is_newer(0, 0xFFFFFFFF)
    assert not is_newer(0, 0)
    assert not is_newer(0, 1)
