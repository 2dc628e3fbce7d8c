import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.wire.mac import BROADCAST, format_mac, is_group, mac_from_int, mac_to_int, parse_mac

macs = st.binary(min_size=6, max_size=6)


@given(macs)
def test_text_and_number_lead_back_to_the_same_address(mac):
    assert parse_mac(format_mac(mac)) == mac
    assert mac_from_int(mac_to_int(mac)) == mac


def test_hyphens_and_capitals_are_understood():
    assert parse_mac("02-AB-00-00-00-01") == bytes.fromhex("02ab00000001")


@pytest.mark.parametrize(
    "text", ["", "02:00:00:00:00", "02:00:00:00:00:0g", "02:00-00:00:00:00", "020000000001", "a:b"]
)
def test_anything_else_is_refused_with_an_example_of_what_is_right(text):
    with pytest.raises(ValueError, match="02:00:00:00:00:01"):
        parse_mac(text)


def test_a_number_beyond_48_bits_is_refused():
    with pytest.raises(ValueError, match="48 bits"):
        mac_from_int(1 << 48)


def test_a_group_address_is_recognised():
    assert is_group(BROADCAST)
    assert is_group(parse_mac("01:0e:cf:00:00:00"))
    assert not is_group(parse_mac("02:00:00:00:00:01"))
