"""Which class a PROFINET drive's acyclic frame is of."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.buses.profinet.faults.frame_class import (
    ALARM,
    ALARM_ACK,
    ALARM_ERROR,
    ARP,
    DCP,
    LLDP,
    OTHER,
    RPC,
    acknowledging_nothing,
    frame_class,
)
from pnfarm.protocols.profinet.wire.alarms.rta import FIRST_ACK, RtaPdu, RtaType, parse_rta
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH, ALARM_LOW

MACS = bytes.fromhex("020000000001020000000002")
#: Every class that a frame can have.
CLASSES = {ALARM, ALARM_ACK, ALARM_ERROR, ARP, DCP, LLDP, OTHER, RPC}
TAG = bytes.fromhex("8100c000")


def datagram(source: int, destination: int, *, protocol: int = 17, fragment: int = 0) -> bytes:
    header = bytes([0x45, 0, 0, 40]) + bytes(2) + fragment.to_bytes(2, "big") + bytes([64, protocol]) + bytes(10)
    return MACS + b"\x08\x00" + header + source.to_bytes(2, "big") + destination.to_bytes(2, "big") + bytes(16)


@pytest.mark.parametrize(
    ("frame", "known"),
    [
        (MACS + bytes.fromhex("8892feff") + bytes(40), DCP),
        (MACS + TAG + bytes.fromhex("8892fefe") + bytes(40), DCP),
        (MACS + bytes.fromhex("8892fe01") + bytes(40), OTHER),
        (datagram(49152, 34964), RPC),
        (datagram(161, 50000), OTHER),
        (datagram(0, 0, fragment=185), RPC),
        (datagram(34964, 34964, protocol=1), OTHER),
        (MACS + bytes.fromhex("0806") + bytes(46), ARP),
        (MACS + bytes.fromhex("88cc") + bytes(46), LLDP),
        (MACS, OTHER),
    ],
)
def test_each_frame_has_the_class_of_its_protocol(frame, known):
    assert frame_class(frame) == known


@given(st.binary(max_size=80), st.sampled_from([b"", TAG, b"\x88\x92", b"\x08\x00"]))
def test_any_bytes_are_of_some_class(frame, begin):
    assert frame_class(frame) in CLASSES
    assert frame_class(MACS + begin + frame) in CLASSES
    assert frame_class(MACS + b"\x81\x00" + frame[:5]) == OTHER


def rta(kind: int, body: bytes = b"", *, tag: bytes = TAG, frame_id: int = ALARM_LOW, ack: int = 5) -> bytes:
    pdu = RtaPdu(frame_id, 1, 2, 0x10 | kind, 0x11, 4, ack, body)
    return MACS + tag + b"\x88\x92" + pdu.emit() + bytes(20)


@pytest.mark.parametrize(
    ("frame", "known"),
    [
        (rta(RtaType.DATA), ALARM),
        (rta(RtaType.DATA, tag=b"", frame_id=ALARM_HIGH), ALARM),
        (rta(RtaType.ACK), ALARM_ACK),
        (rta(RtaType.NACK), ALARM_ACK),
        (rta(RtaType.ERR), ALARM_ERROR),
        (rta(9), OTHER),
        (rta(RtaType.DATA)[:24], OTHER),
        (MACS + bytes.fromhex("8892feff") + bytes(40), DCP),
    ],
)
def test_what_can_acknowledge_an_alarm_is_distinguished(frame, known):
    assert frame_class(frame) == known


@given(st.binary(max_size=60), st.integers(0, 0xFFFF), st.sampled_from([b"", TAG]))
def test_of_an_alarm_frame_that_acknowledges_nothing_all_else_is_left(body, ack, tag):
    frame = rta(RtaType.DATA, body, tag=tag, ack=ack)
    left = acknowledging_nothing(frame)
    start = 14 + len(tag)
    assert left[:start] == frame[:start]
    was, now = parse_rta(frame[start:]), parse_rta(left[start:])
    assert (now.body, now.send_sequence, now.frame_id) == (was.body, was.send_sequence, was.frame_id)
    assert now.ack_sequence == FIRST_ACK
    assert acknowledging_nothing(rta(RtaType.ACK)) is None
