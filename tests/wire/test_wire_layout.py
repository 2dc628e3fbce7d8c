"""Layouts as classes: what a declaration means on the wire."""

import inspect
from dataclasses import FrozenInstanceError, replace
from ipaddress import IPv4Address
from typing import Annotated
from uuid import UUID

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import DecodeError
from pnfarm.wire.layout import (
    Align,
    Count,
    Fixed,
    Ip,
    Length,
    List8,
    List16,
    ListOfRest,
    Mac,
    Octets8,
    Outside,
    Pad,
    Rest,
    RestBut,
    Structure,
    UInt8,
    UInt16,
    UInt32,
    Uuid,
    When,
    octets,
    padded,
)


class Point(Structure):
    x: UInt16
    y: UInt8 = 7


class Everything(Structure, wire="kind point uuid mac ip name words points pairs more tail last"):
    point: Point
    uuid: Uuid
    mac: Mac
    ip: Ip
    kind: Annotated[UInt8, Pad(1)]
    name: Annotated[bytes, padded(4)]
    words: Annotated[bytes, Length("Bx", unit=2)]
    points: List16[Point]
    pairs: Annotated[tuple[tuple[UInt8, UInt16], ...], Count(lambda read: read["kind"] & 1)]
    more: Annotated[UInt32, When(lambda read: read["kind"] > 1, 0)] = 0
    tail: Annotated[bytes, RestBut(1)] = b""
    last: UInt8 = 0
    version: Outside[int] = 3


VALUE = Everything(
    Point(1, 2), UUID(int=5), b"abcdef", IPv4Address("10.0.0.1"), 3, b"ab  ", b"wxyz", (Point(3),), ((4, 5),), 6, b"tt"
)
BIG = "0003 0001 02" + "00" * 15 + "05 616263646566 0a000001 61622020 0200 7778797a 0001 000307 040005 00000006 7474 00"


def test_fields_stand_on_the_wire_as_they_are_annotated():
    assert VALUE.emit() == bytes.fromhex(BIG)
    assert Everything.parse(bytes.fromhex(BIG)) == VALUE
    assert Everything.parse(bytes.fromhex(BIG), version=9) == replace(VALUE, version=9)
    assert list(inspect.signature(Everything).parameters)[:2] == ["point", "uuid"]


def test_numbers_and_uuids_follow_the_byte_order_that_is_asked_for():
    little = VALUE.emit(little_endian=True)
    assert little[:21].hex() == "0003" + "010002" + UUID(int=5).bytes_le.hex()
    assert Everything.parse(little, little_endian=True) == VALUE

    class Little(Structure, little=True):
        points: ListOfRest[Point]

    assert Little((Point(1),)).emit() == b"\1\0\7"


@given(st.binary(max_size=90), st.booleans())
def test_any_octets_are_a_value_that_is_sent_again_or_a_decode_error(data, little):
    try:
        value = Everything.parse(data, little_endian=little)
    except DecodeError:
        return
    assert Everything.parse(value.emit(little_endian=little), little_endian=little) == value


def test_errors_are_those_of_reading_one_value_after_the_other():
    for size, message in ((1, "2 octets needed, 1 left"), (2, "1 octets needed, 0 left")):
        with pytest.raises(DecodeError, match=message):
            Point.parse(bytes(size))
    with pytest.raises(DecodeError, match="trailing"):
        Point.parse(bytes(4))
    with pytest.raises(DecodeError, match="1 octets needed, 0 left"):
        Everything.parse(bytes.fromhex(BIG)[:45])
    with pytest.raises(ValueError, match="70000 does not fit in 2 octets"):
        Point(70_000).emit()
    for wrong in (replace(VALUE, mac=b""), replace(VALUE, words=b"odd"), replace(VALUE, pairs=((1, 1 << 16),))):
        with pytest.raises(ValueError, match=r"six octets|whole words|does not fit"):
            wrong.emit()


def test_padding_up_to_a_multiple_counts_from_the_origin_and_may_be_missing_at_the_end():
    class Aligned(Structure):
        name: Octets8
        items: Annotated[tuple[UInt8, ...], Count("B", Align(4, 2))]
        rest: Annotated[Rest, Align(4, 2)] = b""

    value = Aligned(b"a", (1, 2))
    assert value.emit() == bytes.fromhex("01 61 02 000000 0102 0000")
    assert Aligned.parse(bytes.fromhex("01 61 02 ffffff 0102")) == value


def test_a_structure_cannot_be_changed_and_matches_by_its_fields():
    with pytest.raises(FrozenInstanceError):
        VALUE.kind = 1
    match Point(1):
        case Point(x, y):
            assert (x, y) == (1, 7)
    assert hash(Point(1)) == hash(Point.parse(b"\0\1\7"))


def test_an_annotation_that_says_nothing_about_the_wire_is_refused():
    with pytest.raises(TypeError, match="does not say how it stands on the wire"):

        class Wrong(Structure):
            number: int


def test_conversions_and_exact_sizes():
    class Flags(Structure):
        on: Annotated[bool, Fixed("B", bool, int)]
        key: Annotated[bytes, octets(2)]
        rest: List8[Annotated[bool, Fixed("B", bool, int)]] = ()

    assert Flags.parse(b"\2ab\2\0\1") == Flags(on=True, key=b"ab", rest=(False, True))
    assert Flags(on=True, key=b"ab", rest=(True,)).emit() == b"\1ab\1\1"
    with pytest.raises(ValueError, match="3 octets where 2 are expected"):
        Flags(on=True, key=b"abc").emit()
