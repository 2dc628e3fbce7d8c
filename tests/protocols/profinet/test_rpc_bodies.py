"""The bodies of control PDUs."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.rpc.bodies import (
    CancelAckBody,
    CancelBody,
    parse_cancel,
    parse_cancel_ack,
    parse_fack,
)

ids = st.integers(0, 0xFFFFFFFF)


@given(ids, st.booleans())
def test_cancels_are_read_back(cancel_id, little):
    body = CancelBody(cancel_id).emit(little_endian=little)
    assert len(body) == 8
    assert parse_cancel(body, little_endian=little) == CancelBody(cancel_id)


@given(ids, st.booleans(), st.booleans())
def test_cancel_acknowledgements_are_read_back_padded_or_not(cancel_id, accepting, little):
    ack = CancelAckBody(cancel_id, accepting)
    body = ack.emit(little_endian=little)
    assert len(body) == 9
    for octets in (body, body + bytes(3)):
        assert parse_cancel_ack(octets, little_endian=little) == ack


def test_a_boolean_of_four_octets_counts_in_either_order():
    for word in (b"\1\0\0\0", b"\0\0\0\1"):
        assert parse_cancel_ack(bytes(8) + word, little_endian=True) == CancelAckBody(0, accepting=True)


def test_no_body_is_an_orphan():
    assert parse_cancel(b"", little_endian=True) is None
    assert parse_cancel_ack(b"", little_endian=True) is None


@pytest.mark.parametrize(
    ("body", "reason"), [(b"\0", "short"), (b"\1" + bytes(7), "bad-version"), (bytes(14), "trailing")]
)
def test_other_shapes_are_refused(body, reason):
    for parse in (parse_cancel, parse_cancel_ack):
        with pytest.raises(DecodeError) as caught:
            parse(body, little_endian=True)
        assert caught.value.reason == reason


@given(st.binary(max_size=40), st.booleans())
def test_any_octets_give_a_value_or_a_decode_error(octets, little):
    for parse in (parse_cancel, parse_cancel_ack, parse_fack):
        with suppress(DecodeError):
            parse(octets, little_endian=little)
