"""RTA-PDUs and alarm blocks: round trips, any octets, and the bytes of a captured S7-1500."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scapy.contrib.pnio_rpc import AlarmNotification_Low
from scapy.layers.l2 import Ether
from scapy.utils import PcapReader, wrpcap
from wireshark import tshark

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import ErrorCode, describe_status, pnio_error
from pnfarm.protocols.profinet.wire.alarms import rta
from pnfarm.protocols.profinet.wire.alarms.notification import (
    SEQUENCE_MASK,
    AlarmAck,
    AlarmItem,
    AlarmNotification,
    AlarmSpecifier,
    AlarmType,
    acknowledge,
    alarm_type_text,
    describe_alarm,
    emit_alarm_items,
    parse_alarm,
    parse_alarm_items,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import OK, PnioStatus
from pnfarm.wire.ethernet import parse_ethernet

CAPTURE = Path(__file__).resolve().parents[3].parent / "shared" / "captures" / "pnio-rs_s7-1515_golden.pcap"
U8, U16, U32 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)

statuses = st.builds(PnioStatus.from_int, U32)
pdus = st.builds(
    rta.RtaPdu,
    frame_id=st.sampled_from((0xFC01, 0xFE01)),
    destination=U16,
    source=U16,
    pdu_type=U8,
    add_flags=U8,
    send_sequence=U16,
    ack_sequence=U16,
    body=st.binary(max_size=64),
)
single_items = st.one_of(
    st.builds(AlarmItem, st.just(0x8000), st.binary(min_size=6, max_size=6)),
    st.builds(AlarmItem, st.just(0x8002), st.binary(min_size=12, max_size=12)),
    st.builds(AlarmItem, st.just(0x8003), st.binary(min_size=16, max_size=16)),
    st.builds(AlarmItem, st.just(0x8100), st.binary(min_size=12, max_size=12)),
)
last_items = st.builds(
    AlarmItem, st.sampled_from((0x8001, 0x8200, 0x8201, 0x8300, 0x8310, 0x8320)), st.binary(max_size=40)
)
manufacturer_items = st.builds(AlarmItem, st.integers(0, 0x7FFF), st.binary(max_size=40))
items = st.one_of(
    st.tuples(),
    st.tuples(manufacturer_items),
    st.lists(single_items, max_size=6).map(tuple),
    st.tuples(st.lists(single_items, max_size=4), last_items).map(lambda pair: (*pair[0], pair[1])),
)
notifications = st.builds(
    AlarmNotification,
    alarm_type=U16,
    api=U32,
    slot=U16,
    subslot=U16,
    module_ident=U32,
    submodule_ident=U32,
    specifier=U16,
    items=items,
    high=st.booleans(),
    version=U16,
)
acks = st.builds(
    AlarmAck,
    alarm_type=U16,
    api=U32,
    slot=U16,
    subslot=U16,
    specifier=U16,
    status=statuses,
    high=st.booleans(),
    version=U16,
)


# RTA-PDU


@given(pdus, st.binary(max_size=40))
def test_an_rta_pdu_survives_the_wire_and_the_padding_after_it(pdu, padding):
    octets = pdu.emit()
    assert rta.parse_rta(octets) == pdu
    assert rta.parse_rta(octets + padding) == pdu


@given(st.one_of(st.binary(max_size=60), st.binary(max_size=60).map(lambda tail: b"\xfe\x01" + tail)))
def test_any_octets_give_an_rta_pdu_or_a_decode_error(data):
    try:
        pdu = rta.parse_rta(data)
    except DecodeError:
        return
    assert data.startswith(pdu.emit())


def test_a_pdu_of_a_reserved_type_and_version_keeps_its_numbers():
    pdu = rta.parse_rta(bytes.fromhex("fc01 0001 0002 2d 31 0003 0004 0001 aa"))
    assert (pdu.type, pdu.version, pdu.tack, pdu.body) == (0xD, 2, True, b"\xaa")


def test_a_var_part_that_claims_more_than_there_is_is_short():
    with pytest.raises(DecodeError, match="short"):
        rta.parse_rta(bytes.fromhex("fe01 0000 0000 1301 ffff ffff 0001"))


def test_sequence_numbers_start_at_ffff_and_run_to_7fff():
    assert [rta.next_sequence(n) for n in (0xFFFF, 0, 1, 0x7FFE, 0x7FFF)] == [0, 1, 2, 0x7FFF, 0]


# Alarm blocks


@given(st.one_of(notifications, acks))
def test_an_alarm_block_survives_the_wire(alarm):
    assert parse_alarm(alarm.emit()) == alarm


@given(
    st.one_of(
        st.binary(max_size=80),
        st.binary(max_size=60).map(lambda tail: AlarmNotification(1, 0, 1, 1).emit() + tail),
        st.tuples(notifications, st.integers(0, 80)).map(lambda pair: pair[0].emit()[: pair[1]]),
    )
)
def test_any_octets_give_an_alarm_block_or_a_decode_error(data):
    try:
        alarm = parse_alarm(data)
    except DecodeError:
        return
    assert alarm.emit() == data


@given(st.binary(max_size=90))
def test_any_octets_give_items_that_are_these_octets_again_or_a_decode_error(data):
    try:
        found = parse_alarm_items(data)
    except DecodeError:
        return
    assert emit_alarm_items(found) == data


def test_several_entries_under_one_identifier_stay_together():
    entries = bytes.fromhex("0001 2801 0001  0002 2801 0006")
    assert parse_alarm_items(b"\x80\x00" + entries) == (AlarmItem(0x8000, entries),)
    maintenance = AlarmItem(0x8100, bytes.fromhex("0f00 0008 0100 0000 00000001"))
    assert parse_alarm_items(emit_alarm_items((maintenance, AlarmItem(0x8000, entries)))) == (
        maintenance,
        AlarmItem(0x8000, entries),
    )


def test_entries_of_the_whole_submodule_look_like_items_only_where_they_come_out_even():
    # channel number 0x8000 is the identifier 0x8000 as well
    two = bytes.fromhex("8000 0801 0001 8000 0801 0002")
    assert parse_alarm_items(b"\x80\x00" + two) == (AlarmItem(0x8000, two),)


def test_an_unknown_block_is_no_alarm():
    with pytest.raises(DecodeError, match="bad-type"):
        parse_alarm(bytes.fromhex("0101 0002 0100"))
    with pytest.raises(DecodeError, match="trailing"):
        parse_alarm(AlarmAck(1, 0, 1, 1).emit() + b"\0")


# Words


def test_every_alarm_type_has_its_words():
    assert len({alarm_type_text(kind) for kind in AlarmType}) == len(AlarmType)
    assert alarm_type_text(0x30) == "manufacturer's alarm 0x0030"
    assert alarm_type_text(0x80) == "profile's alarm 0x0080"
    assert alarm_type_text(0x1234) == "alarm of reserved type 0x1234"


def test_an_alarm_reads_as_a_sentence():
    alarm = AlarmNotification(1, 0, 1, 2, items=(AlarmItem(0x8000, bytes.fromhex("800008000010")), AlarmItem(7, b"")))
    assert (
        describe_alarm(alarm)
        == "diagnosis appears on slot 1 subslot 0x0002: channel diagnosis 8000 0800 0010; USI 0x0007"
    )
    assert describe_alarm(replace(alarm, alarm_type=3, subslot=0x8001, items=())) == (
        "submodule pulled on slot 1 subslot 0x8001"
    )
    for kind in (AlarmType.PULL, AlarmType.PULL_MODULE):
        assert describe_alarm(replace(alarm, alarm_type=kind, subslot=0, items=())) == "module pulled on slot 1"
    assert describe_alarm(alarm, lambda item: f"{item.usi}").endswith(": 32768; 7")


def test_a_refused_alarm_names_its_reason():
    assert describe_status(pnio_error(ErrorCode.ALARM_ACK, 0x3C, 0)) == (
        "AlarmAck: ALARM_ACK: alarm type not supported (DA 81 3C 00)"
    )


# Captured bytes, and another implementation


def captured() -> list[bytes]:
    if not CAPTURE.exists():
        pytest.skip("the captures are not beside the project")
    with PcapReader(str(CAPTURE)) as reader:
        frames = [parse_ethernet(bytes(packet)) for packet in reader]
    return [f.payload for f in frames if f.ethertype == 0x8892 and f.payload[:2] in {b"\xfc\x01", b"\xfe\x01"}]


def test_captured_alarms_are_parsed_and_built_again_octet_by_octet():
    alarms = []
    for octets in captured():
        pdu = rta.parse_rta(octets)
        assert octets.startswith(pdu.emit())
        if pdu.type == rta.RtaType.DATA:
            alarms.append(parse_alarm(pdu.body))
            assert alarms[-1].emit() == pdu.body
        elif pdu.type == rta.RtaType.ERR:
            assert pdu.body == rta.error_status(pdu).emit()
    process, process_ack, diagnosis, diagnosis_ack, gone, submodule = alarms
    assert process == AlarmNotification(
        AlarmType.PROCESS, 0, 1, 1, 0x30, 0x130, 0, (AlarmItem(0x0010, b"\x01"),), high=True
    )
    assert process_ack == acknowledge(process)
    assert (process_ack.status, process_ack.high) == (OK, True)
    assert describe_alarm(diagnosis) == (
        "diagnosis appears on slot 1 subslot 0x0001: ext channel diagnosis 0004 2801 0001 0000 0000 0000"
    )
    assert diagnosis.specifier & ~SEQUENCE_MASK == (
        AlarmSpecifier.CHANNEL_DIAGNOSIS | AlarmSpecifier.SUBMODULE_DIAGNOSIS_STATE | AlarmSpecifier.AR_DIAGNOSIS_STATE
    )
    assert diagnosis_ack == acknowledge(diagnosis)
    assert gone.alarm_type == AlarmType.DIAGNOSIS_DISAPPEARS
    assert (gone.sequence_number, submodule.sequence_number) == (5, 6)


@given(st.one_of(st.tuples(), st.lists(single_items, max_size=4).map(tuple)), notifications)
def test_scapy_reads_what_is_built(entries, alarm):
    alarm = replace(alarm, items=entries, high=False, version=0x0100)
    packet = AlarmNotification_Low(alarm.emit())
    assert (packet.AlarmType, packet.API, packet.SlotNumber, packet.SubslotNumber, packet.AlarmSpecifier) == (
        alarm.alarm_type,
        alarm.api,
        alarm.slot,
        alarm.subslot,
        alarm.specifier,
    )
    assert packet.ModuleIdentNumber == alarm.module_ident
    assert b"".join(bytes(item) for item in packet.AlarmPayload) == emit_alarm_items(entries)
    assert [item.UserStructureIdentifier for item in packet.AlarmPayload] == [item.usi for item in entries]


def test_a_dissector_reads_what_is_built(tmp_path):
    maintenance = AlarmItem(0x8100, bytes.fromhex("0f00 0008 0100 0000 00000003"))
    channel = AlarmItem(0x8000, bytes.fromhex("8000 0800 0010"))
    alarm = AlarmNotification(AlarmType.DIAGNOSIS, 0x3A00, 1, 2, 0x100, 0x68, 0xA805, (maintenance, channel))
    refused = pnio_error(ErrorCode.ALARM_ACK, 0x3C, 1)
    vars_ = [alarm.emit(), acknowledge(replace(alarm, high=True), refused).emit()]
    packets = [
        Ether(type=0x8892) / rta.RtaPdu(frame_id, 1, 2, 0x11, 0x11, 3, 4, body).emit()
        for frame_id, body in zip((0xFE01, 0xFC01), vars_, strict=True)
    ]
    path = tmp_path / "alarms.pcap"
    wrpcap(str(path), packets)
    text = tshark(path, "-V")
    assert "Malformed" not in text
    for words in (
        "AlarmDstEndpoint: 0x0001", "Type: Data-RTA-PDU (0x1)", "TACK: 0x1", "SendSeqNum: 0x0003",
        "AlarmType: Diagnosis (0x0001)", "SequenceNumber: 0x005", "UserStructureIdentifier: Maintenance (0x8100)",
        "UserStructureIdentifier: ChannelDiagnosis (0x8000)", "BlockType: Alarm Ack High (0x8001)",
        "ErrorCode: AlarmAck (0xda)", "Wrong Submodule State",
    ):  # fmt: skip
        assert words in text, words
