"""SNMP messages and their BER: octets of net-snmp's tools, pyasn1's and scapy's opinion, and what no one may send."""

from __future__ import annotations

import contextlib

import pytest
import snmp_asn1
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.snmp import ber
from pnfarm.protocols.profinet.wire.snmp import message as snmp
from pnfarm.protocols.profinet.wire.snmp.message import (
    GET,
    GET_BULK,
    GET_NEXT,
    RESPONSE,
    SET,
    VERSION_1,
    VERSION_2C,
    OtherPdu,
    Pdu,
    SnmpMessage,
    Value,
    VarBind,
    emit_snmp,
    parse_snmp,
)

small = st.integers(0, 300)
arc = small | st.integers(0, 2**32 - 1)
oids = st.builds(
    lambda head, rest: (*head, *rest),
    st.tuples(st.integers(0, 1), st.integers(0, 39)) | st.tuples(st.just(2), arc),
    st.lists(arc, max_size=20) | st.lists(small, min_size=120, max_size=126),
)
int32 = st.integers(-(2**31), 2**31 - 1) | st.integers(-300, 300)
unsigned32 = st.sampled_from([snmp.COUNTER32, snmp.GAUGE32, snmp.TIME_TICKS])
values = st.one_of(
    st.builds(Value, st.just(snmp.INTEGER), int32),
    st.builds(Value, st.sampled_from([snmp.OCTET_STRING, snmp.OPAQUE]), st.binary(max_size=300)),
    st.builds(Value, st.just(snmp.OBJECT_IDENTIFIER), oids),
    st.builds(Value, st.just(snmp.IP_ADDRESS), st.binary(min_size=4, max_size=4)),
    st.builds(Value, unsigned32, arc),
    st.builds(Value, st.just(snmp.COUNTER64), st.integers(0, 2**64 - 1) | small),
    st.builds(Value, st.sampled_from([snmp.NULL, snmp.NO_SUCH_OBJECT, snmp.NO_SUCH_INSTANCE, snmp.END_OF_MIB_VIEW])),
)
#: Tags of one octet that no type of ours has.
strange = st.integers(0, 255).filter(lambda tag: tag & 0x1F != 0x1F and tag not in snmp_asn1.TYPES)
strange_values = st.builds(Value, strange, st.binary(max_size=20))
versions = st.sampled_from([VERSION_1, VERSION_2C])


def messages(value, names=oids):
    varbinds = st.lists(st.builds(VarBind, names, value), max_size=5).map(tuple)
    pdus = st.builds(Pdu, st.sampled_from([GET, GET_NEXT, RESPONSE, SET, GET_BULK]), int32, int32, int32, varbinds)
    return st.builds(SnmpMessage, versions, st.binary(max_size=140), pdus)


others = st.integers(0, 255).filter(lambda tag: tag & 0x1F != 0x1F and tag not in snmp_asn1.PDUS)
other_messages = st.builds(
    SnmpMessage, versions, st.binary(max_size=10), st.builds(OtherPdu, others, st.binary(max_size=300))
)

#: What snmpget, snmpbulkget, snmptrap of net-snmp 5.9.3 sent.
GET_V1 = bytes.fromhex(
    "303f02010004067075626c6963a032020458e2d5d90201000201003024300c06082b0601020101030005003014061028c46201010201059d"
    "4f0102010106010500"
)
BULK = bytes.fromhex(
    "303702010104067075626c6963a52a020462dc245a020101020103301c300b06072b0601020101070500300d06092b06010201020201020500"
)
TRAP_V1 = bytes.fromhex("302802010004067075626c6963a41b06082b0601040181c06e40040a0102030201020201004301073000")
DISCOVERY_V3 = bytes.fromhex(
    "303e020103301102040c79fe34020300ffe30401040201030410300e0400020100020100040004000400301404000400a00e02047297e736"
    "0201000201003000"
)


def test_messages_of_net_snmp_are_read_as_they_were_meant():
    assert parse_snmp(GET_V1) == SnmpMessage(
        VERSION_1,
        b"public",
        Pdu(
            GET,
            0x58E2D5D9,
            varbinds=(
                VarBind((1, 3, 6, 1, 2, 1, 1, 3, 0)),
                VarBind((1, 0, 8802, 1, 1, 2, 1, 5, 3791, 1, 2, 1, 1, 6, 1)),
            ),
        ),
    )
    bulk = parse_snmp(BULK)
    assert (bulk.version, bulk.pdu.tag, bulk.pdu.non_repeaters, bulk.pdu.max_repetitions) == (1, GET_BULK, 1, 3)
    assert [varbind.name for varbind in bulk.pdu.varbinds] == [
        (1, 3, 6, 1, 2, 1, 1, 7),
        (1, 3, 6, 1, 2, 1, 2, 2, 1, 2),
    ]
    trap = parse_snmp(TRAP_V1)
    assert (trap.pdu.tag, len(trap.pdu.body)) == (0xA4, 27)
    for data in (GET_V1, BULK, TRAP_V1):
        assert emit_snmp(parse_snmp(data)) == data


def test_a_message_of_version_3_is_distinguished_from_a_broken_one():
    with pytest.raises(DecodeError) as error:
        parse_snmp(DISCOVERY_V3)
    assert error.value.reason == "bad-version"


@given(messages(values | strange_values) | other_messages)
def test_what_is_emitted_is_parsed_back(message):
    assert parse_snmp(emit_snmp(message)) == message


@given(messages(values))
def test_pyasn1_reads_what_we_write_and_the_other_way_round(message):
    data = emit_snmp(message)
    assert snmp_asn1.decode(data) == message
    theirs = snmp_asn1.encode(message)
    assert parse_snmp(theirs) == message
    # pyasn1 puts a sign octet too many before the least number of each size
    assert len(theirs) >= len(data)
    least = {-(2**bits) for bits in (7, 15, 23, 31)}
    numbers = {message.pdu.request_id, message.pdu.error_status, message.pdu.error_index}
    if not least & (numbers | {varbind.value.content for varbind in message.pdu.varbinds}):
        assert theirs == data


@given(
    messages(
        values.filter(lambda value: value.tag not in {snmp.OPAQUE, snmp.COUNTER64}),
        # scapy takes the first octet apart as if the second arc were always below 40
        oids.filter(lambda oid: oid[0] < 2 or oid[1] < 40),
    )
)
def test_scapy_reads_the_same_names_and_numbers(message):
    from scapy.layers.snmp import SNMP

    seen = SNMP(emit_snmp(message))
    assert seen.version.val == message.version
    assert bytes(seen.community.val) == message.community
    assert seen.PDU.id.val == message.pdu.request_id
    assert [item.oid.val for item in seen.PDU.varbindlist] == [
        ".".join(map(str, varbind.name)) for varbind in message.pdu.varbinds
    ]
    for item, varbind in zip(seen.PDU.varbindlist, message.pdu.varbinds, strict=True):
        if isinstance(varbind.value.content, int):
            assert item.value.val == varbind.value.content


@given(st.binary(max_size=200))
def test_any_octets_are_a_value_or_a_decode_error(data):
    for parse in (parse_snmp, ber.parse_oid, ber.parse_integer):
        with contextlib.suppress(DecodeError):
            parse(data)


@given(messages(values | strange_values), st.data())
def test_a_damaged_message_is_a_value_or_a_decode_error(message, data):
    octets = bytearray(emit_snmp(message))
    for _ in range(data.draw(st.integers(1, 3))):
        octets[data.draw(st.integers(0, len(octets) - 1))] = data.draw(st.integers(0, 255))
    del octets[data.draw(st.integers(0, len(octets))) :]
    try:
        found = parse_snmp(bytes(octets))
    except DecodeError:
        return
    assert parse_snmp(emit_snmp(found)) == found


@given(oids)
def test_every_object_identifier_is_parsed_back(oid):
    assert ber.parse_oid(ber.emit_oid(oid)) == oid


def message_with(varbind: str) -> bytes:
    """A Get with these octets in place of its list of variables' content."""
    inside = bytes.fromhex(varbind)
    numbers = bytes.fromhex("020101 020100 020100")
    pdu = ber.emit_tlv(GET, numbers + ber.emit_tlv(0x30, inside))
    return ber.emit_tlv(0x30, bytes.fromhex("020101 0406 7075626c6963") + pdu)


@pytest.mark.parametrize(
    ("varbind", "content"),
    [
        ("3007 0602 2b06 0201 05", 5),
        ("3007 0602 2b06 0201 fb", -5),
        ("3009 0602 2b06 0203 000005", 5),
        ("3009 0602 2b06 0203 fffffb", -5),
        ("300b 0602 2b06 0205 ff80000000", -(2**31)),  # as pysnmp writes it
        ("300b 0602 2b06 4105 00ffffffff", 0xFFFF_FFFF),
        ("3008 0602 2b06 02810105", 5),
        ("30820007 0602 2b06 0201 05", 5),
        ("308400000007 0602 2b06 0201 05", 5),
    ],
)
def test_numbers_and_lengths_may_have_more_octets_than_they_need(varbind, content):
    assert parse_snmp(message_with(varbind)).pdu.varbinds[0].value.content == content


@pytest.mark.parametrize(
    ("varbind", "reason"),
    [
        ("30 80 0602 2b06 0500 0000", "bad-length"),  # indefinite
        ("30 85 0000000006 0602 2b06 0500", "bad-length"),
        ("30 ff", "bad-length"),
        ("30 84 ffffffff", "short"),
        ("30 06 0602 2b06 05", "short"),
        ("31 06 0602 2b06 0500", "bad-tag"),
        ("30 06 0402 2b06 0500", "bad-tag"),
        ("30 07 0602 2b06 1f8100", "bad-tag"),  # a tag of several octets
        ("30 08 0602 2b06 0500 0500", "trailing"),
        ("30 04 0602 2b06", "short"),
        ("30 07 0602 2b06 050100", "bad-length"),
        ("30 06 0602 2b06 0200", "bad-length"),
        ("30 0b 0602 2b06 0205 0080000000", "bad-value"),
        ("30 0b 0602 2b06 0205 ff7fffffff", "bad-value"),
        ("30 0c 0602 2b06 0206 000000000001", "bad-length"),
        ("30 07 0602 2b06 4101ff", "bad-value"),  # a negative counter
        ("30 0b 0602 2b06 4105 0100000000", "bad-value"),
        ("30 0c 0602 2b06 4106 000000000001", "bad-length"),
        ("30 10 0602 2b06 460a 00000000000000000001", "bad-length"),
        ("30 07 0602 2b06 4001 0a", "bad-length"),
        ("30 04 0600 0500", "bad-length"),
        ("30 06 0602 2b86 0500", "bad-length"),
        ("30 07 0603 2b8006 0500", "bad-value"),
        ("30 0a 0606 2b9080808000 0500", "bad-value"),
        ("30 0c 0608 2bffffffffffff7f 0500", "bad-value"),
        ("30 8186 0681 81 2b" + "01" * 128 + "0500", "bad-length"),
    ],
)
def test_what_is_no_varbind_is_named(varbind, reason):
    with pytest.raises(DecodeError) as error:
        parse_snmp(message_with(varbind))
    assert error.value.reason == reason, error.value


@pytest.mark.parametrize("depth", [10, 1000, 20_000])
def test_nesting_however_deep_costs_no_recursion(depth):
    for data in (b"\x30\x80" * depth, b"\x30\x84\xff\xff\xff\xff" * depth):
        with pytest.raises(DecodeError):
            parse_snmp(data)
    nested = b""
    for _ in range(min(depth, 1000)):
        nested = ber.emit_tlv(0x30, nested)
    with pytest.raises(DecodeError):
        parse_snmp(nested)
    message = SnmpMessage(VERSION_2C, b"", Pdu(SET, 1, varbinds=(VarBind((1, 3), Value(0x30, nested)),)))
    assert parse_snmp(emit_snmp(message)) == message


def test_octets_after_a_message_are_no_part_of_it():
    with pytest.raises(DecodeError) as error:
        parse_snmp(GET_V1 + b"\0")
    assert error.value.reason == "trailing"


@pytest.mark.parametrize(
    "value",
    [
        Value(snmp.INTEGER, 2**31),
        Value(snmp.INTEGER, b"1"),
        Value(snmp.COUNTER32, -1),
        Value(snmp.GAUGE32, 2**32),
        Value(snmp.COUNTER64, 2**64),
        Value(snmp.OCTET_STRING, 5),
        Value(snmp.OCTET_STRING),
        Value(snmp.NULL, b""),
        Value(snmp.IP_ADDRESS, b"123"),
        Value(snmp.OBJECT_IDENTIFIER, (1,)),
        Value(snmp.OBJECT_IDENTIFIER, (1, 40)),
        Value(snmp.OBJECT_IDENTIFIER, (3, 1)),
        Value(snmp.OBJECT_IDENTIFIER, (1, 3, 2**32)),
        Value(snmp.OBJECT_IDENTIFIER, (1, 3, -1)),
        Value(snmp.OBJECT_IDENTIFIER, (1, *[3] * 128)),
    ],
)
def test_a_value_without_its_types_shape_is_our_own_mistake(value):
    with pytest.raises(ValueError):
        emit_snmp(SnmpMessage(VERSION_2C, b"", Pdu(RESPONSE, 1, varbinds=(VarBind((1, 3), value),))))


def test_counters_wrap_and_gauges_stay():
    assert snmp.counter32(2**32 + 5).content == 5
    assert snmp.counter64(2**64 + 5).content == 5
    assert snmp.gauge32(2**32 + 5).content == 2**32 - 1
    assert snmp.time_ticks(10_000_000 * (2**32 + 5)).content == 5
