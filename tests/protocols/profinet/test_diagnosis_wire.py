"""Items of diagnosis: as captured, as a manual prints them, and as any octets."""

import contextlib

import pytest
from block_strategies import item_lists
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import RawBlock
from pnfarm.protocols.profinet.wire.records.diagnosis import (
    ChannelDiagnosis,
    ChannelProperties,
    DiagnosisData,
    ExtChannelDiagnosis,
    MaintenanceItem,
    UserItem,
    emit_items,
    parse_items,
)
from pnfarm.protocols.profinet.wire.records.diagnosis_texts import describe_error_type


@given(item_lists)
def test_items_are_parsed_back(found):
    usi, items = found
    emitted = emit_items(items)
    assert {u for u, _ in emitted} == {usi}
    assert parse_items(b"".join(data for _, data in emitted), usi) == items


@given(st.binary(max_size=60), st.integers(0, 0xFFFF) | st.sampled_from((0x8000, 0x8002, 0x8003, 0x8100)))
def test_any_octets_give_items_or_a_decode_error(data, usi):
    with contextlib.suppress(DecodeError):
        items = parse_items(data, usi)
        assert b"".join(octets for _, octets in emit_items(items)) == data


@given(st.integers(0, 0xFFFF))
def test_channel_properties_keep_every_bit(value):
    assert int(ChannelProperties.from_int(value)) == value


def test_the_item_of_a_captured_alarm():
    (item,) = parse_items(bytes.fromhex("0004 2801 0001 0000 00000000"), 0x8002)
    assert item == ExtChannelDiagnosis(4, ChannelProperties(type=1, specifier=1, direction=1), 1, 0, 0)


def test_a_maintenance_item_is_a_block_of_its_own():
    assert emit_items([MaintenanceItem(3)]) == [(0x8100, bytes.fromhex("0f00 0008 0100 0000 00000003"))]
    assert parse_items(bytes.fromhex("0f00 0008 0100 0f0f 00000003"), 0x8100) == (MaintenanceItem(3),)
    with pytest.raises(DecodeError, match="bad-type"):
        parse_items(bytes.fromhex("0f01 0008 0100 0000 00000003"), 0x8100)


def test_an_item_that_is_cut_off_and_no_item_at_all_are_refused():
    for octets in ("", "8000", "8000 0800 0001 80"):
        with pytest.raises(DecodeError, match="short"):
            parse_items(bytes.fromhex(octets), 0x8000)
    assert parse_items(b"", 0x0005) == (UserItem(5, b""),)


def test_version_1_0_of_the_block_names_no_api():
    item = ChannelDiagnosis(0x8000, ChannelProperties(), 5)
    block = DiagnosisData(0, 1, 2, 0x8000, ChannelProperties(), 0x8000, (item,), 0x0100)
    raw = block.emit()
    assert raw.hex(" ", 2) == "0010 0012 0100 0001 0002 8000 0800 8000 8000 0800 0005"
    assert parse_blocks(raw) == (block,)
    with pytest.raises(ValueError, match="API 0"):
        DiagnosisData(1, 1, 2, 0x8000, ChannelProperties(), 0x8000, (item,), 0x0100).emit()


def test_a_block_holds_items_of_one_usi():
    items = (UserItem(5, b"x"),)
    with pytest.raises(ValueError, match="0x0005"):
        DiagnosisData(0, 1, 2, 0x8000, ChannelProperties(), 0x8000, items).emit()


def test_a_block_of_another_type_is_refused():
    with pytest.raises(DecodeError, match="bad-type"):
        DiagnosisData.of(RawBlock(0x0011, bytes(40)))


def test_error_types_in_words():
    assert describe_error_type(1) == "short circuit"
    assert describe_error_type(0x8001, 0x8005) == "remote mismatch: no peer detected"
    assert describe_error_type(1, 0x8000) == "short circuit: accumulative info"
    assert describe_error_type(0x900F, api=0x3A00) == "external"
    assert describe_error_type(0x900F) == "error type 0x900F"
    assert describe_error_type(5, 0x1234) == "overtemperature: 0x1234"
