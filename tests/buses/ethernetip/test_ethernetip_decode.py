"""A capture of EtherNet/IP in words: streams, sessions, services, connections, cyclic data, and any octets at all."""

from __future__ import annotations

import json
import struct

import pytest
from cip_tape import (
    ACK,
    FIN,
    MACS,
    MANAGER,
    RST,
    SYN,
    Tape,
    behind,
    connect,
    described,
    everything,
    forward_open,
    known,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.buses.ethernetip.decode.streams import MOST_EARLY
from pnfarm.buses.registry import decoder as make_decoder
from pnfarm.buses.registry import frame_filters
from pnfarm.captures.reading import CapturedFrame
from pnfarm.drives.catalogue import model
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire.cpf import NullAddress, UnconnectedData, emit_items
from pnfarm.protocols.enip.wire.encapsulation import Command, EncapsulationPdu, emit_encapsulation
from pnfarm.protocols.enip.wire.epath import logical_path
from pnfarm.protocols.enip.wire.message import MessageReply, emit_multiple_service
from pnfarm.protocols.enip.wire.message import message_request as request
from tests.fuzz.mutate import mutated

GET, SET = Service.GET_ATTRIBUTE_SINGLE, Service.SET_ATTRIBUTE_SINGLE
ANSWER = "cip: Get_Attribute_Single.res"


# -- streams


def test_a_session_is_told_from_its_first_segment_to_its_last():
    tape = Tape()
    tape.encapsulated(0, Command.REGISTER_SESSION, b"\1\0\0\0", session=0)
    tape.encapsulated(1, Command.REGISTER_SESSION, b"\1\0\0\0")
    tape.encapsulated(0, Command.UNREGISTER_SESSION)
    tape.segment(0, flags=FIN | ACK)
    assert tape.lines() == [
        "enip: TCP connection asked for, port 50000 -> 44818",
        "enip: TCP connection accepted, port 44818 -> 50000",
        "enip: RegisterSession.req version 1",
        "enip: RegisterSession.res OK, session 0x00000011, version 1",
        "enip: UnRegisterSession.req session 0x00000011",
        "enip: TCP connection ends",
    ]


def reads(tape: Tape, numbers: range) -> bytes:
    """Requests for so many attributes as one sequence of octets."""
    return b"".join(tape.packed(0, request(GET, logical_path(1, 1, number)).emit()) for number in numbers)


WANTED = [f"Identity 0x01/1, attribute {n} {name}" for n, name in ((1, "Vendor ID"), (2, "Device Type"))]


def test_several_messages_in_one_segment_are_several_lines():
    tape = Tape()
    tape.segment(0, reads(tape, range(1, 3)))
    assert behind(tape.lines(), "cip: Get_Attribute_Single.req") == WANTED


@pytest.mark.parametrize("size", [1, 7, 23, 24, 25, 60])
def test_a_message_may_be_cut_anywhere(size):
    tape = Tape()
    octets = reads(tape, range(1, 3))
    for place in range(0, len(octets), size):
        tape.segment(0, octets[place : place + size])
    assert behind(tape.lines(), "cip: Get_Attribute_Single.req") == WANTED


def test_a_segment_that_comes_twice_is_counted_and_read_once():
    tape = Tape()
    frame = tape.segment(0, reads(tape, range(1, 2)))
    tape.segment(0, reads(tape, range(2, 3)))
    decoder, lines = tape.decoded([*tape.frames[:4], frame, tape.frames[4], frame])
    texts = described(decoder, lines)
    assert behind(texts, "cip: Get_Attribute_Single.req") == WANTED
    assert behind(texts, "enip: sent again") == ["48 octets"] * 2
    assert decoder.summary()[0]["counts"]["repeated"] == 2


def test_segments_in_the_wrong_order_are_read_in_the_right_one():
    tape = Tape()
    octets = reads(tape, range(1, 3))
    pieces = [tape.segment(0, octets[place : place + 40]) for place in range(0, len(octets), 40)]
    found = tape.lines([*tape.frames[:3], pieces[0], *reversed(pieces[1:])])
    assert behind(found, "cip: Get_Attribute_Single.req") == WANTED


def test_overlapping_segments_are_not_read_twice():
    tape = Tape()
    octets = reads(tape, range(1, 3))
    tape.segment(0, octets[:70])
    tape.next[0] = 1001 + 30
    tape.segment(0, octets[30:])
    assert behind(tape.lines(), "cip: Get_Attribute_Single.req") == WANTED


def test_a_capture_that_begins_in_the_middle_is_read_from_the_next_message_on():
    tape = Tape(opened=False)
    octets = reads(tape, range(1, 3))
    tape.segment(0, octets[30:48])
    tape.segment(0, octets[48:])
    assert tape.lines() == [f"cip: Get_Attribute_Single.req {WANTED[1]}"]


def test_octets_that_the_capture_lacks_cost_only_their_own_messages():
    tape = Tape()
    tape.segment(0, reads(tape, range(1, 2)))
    lost = tape.segment(0, reads(tape, range(3, 4)))
    tape.segment(0, reads(tape, range(2, 3)))
    tape.segment(1)  # the device has them all
    found = tape.lines([frame for frame in tape.frames if frame is not lost])
    assert behind(found, "cip: Get_Attribute_Single.req") == WANTED
    assert len(behind(found, "enip: octets missing")) == 1


def test_a_message_found_behind_a_gap_is_from_who_sent_it():
    """It is found with a frame of the other side."""
    tape = Tape()
    lost = tape.segment(1, reads(tape, range(3, 4)))
    tape.segment(1, reads(tape, range(1, 2)))
    tape.segment(0)
    _, lines = tape.decoded([frame for frame in tape.frames if frame is not lost])
    (found,) = [line for line in lines if line.family == "cip"]
    assert (found.source, found.destination) == (MACS[1], MACS[0])


def test_a_gap_that_nobody_acknowledges_is_given_up_as_well():
    tape = Tape()
    lost = tape.segment(0, reads(tape, range(3, 4)))
    for _ in range(MOST_EARLY + 1):
        tape.segment(0, reads(tape, range(1, 2)))
    found = tape.lines([frame for frame in tape.frames if frame is not lost])
    assert len(behind(found, "cip: Get_Attribute_Single.req")) == MOST_EARLY + 1


def test_one_malformed_message_does_not_hide_the_next():
    tape = Tape()
    broken = emit_encapsulation(EncapsulationPdu(Command.SEND_RR_DATA, bytes(6) + b"\x05\x00", 1))
    tape.segment(0, broken + reads(tape, range(1, 2)))
    found = tape.lines()
    assert len(behind(found, "enip: malformed")) == 1
    assert behind(found, "cip: Get_Attribute_Single.req") == WANTED[:1]


def test_a_reset_forgets_both_directions():
    tape = Tape()
    tape.segment(0, reads(tape, range(1, 2))[:30])
    tape.segment(1, flags=RST)
    tape.segment(0, reads(tape, range(2, 3)))
    found = tape.lines()
    assert behind(found, "enip: TCP connection reset") == [""]
    assert behind(found, "cip: Get_Attribute_Single.req") == WANTED[1:]


# -- datagrams


def test_list_identity_names_the_device_and_its_model():
    decoder, lines = known(Tape(opened=False)).decoded()
    assert described(decoder, lines) == [
        "enip: ListIdentity.req answers within 500 ms",
        (
            "enip: ListIdentity.res 'AKD' at 10.77.0.11, vendor 452 type 16 product 1 revision 1.13 status 0x0030 "
            "serial 0x00001234 state 3"
        ),
    ]
    assert lines[1].description.details["product_code"] == 1
    assert decoder.capture.stations.model(MACS[1]).name == "akd-ethernetip"


# -- services


def test_parameters_and_attributes_have_the_names_of_the_model():
    tape = known(Tape())
    row = next(row for row in model("akd-ethernetip").cip.instances.values() if row.size == 4 and row.signed)
    tape.ask(request(GET, logical_path(0x0F, row.number, 1)))
    tape.answer(GET, struct.pack("<i", -5))
    tape.ask(request(SET, logical_path(0x25, 1, 3), b"\1"))
    tape.answer(SET, status=0x0C)
    tape.ask(request(GET, logical_path(0x24, 1, 5)))
    tape.answer(GET, b"\1")
    assert tape.lines()[4:] == [
        f"cip: Get_Attribute_Single.req Parameter 0x0F/{row.number} {row.name}, attribute 1 Parameter Value",
        f"cip: Get_Attribute_Single.res OK, Parameter 0x0F/{row.number} {row.name}, attribute 1 Parameter Value: -5",
        "cip: Set_Attribute_Single.req Position Controller 0x25/1, attribute 3 Operation Mode = 1",
        (
            "cip: Set_Attribute_Single.res object state conflict (0x0C), Position Controller 0x25/1, attribute 3 "
            "Operation Mode"
        ),
        "cip: Get_Attribute_Single.req Position Controller Supervisor 0x24/1, attribute 5 General Fault",
        "cip: Get_Attribute_Single.res OK, Position Controller Supervisor 0x24/1, attribute 5 General Fault: 1",
    ]


def test_standard_attributes_have_the_type_of_the_standard():
    tape = Tape()
    for attribute, data, text in (
        (1, b"\xc4\1", "452"),
        (5, b"\x30\0", "0x0030"),
        (7, b"\3AKD", "'AKD'"),
        (4, b"\1\x0d", "01 0d"),
    ):
        tape.ask(request(GET, logical_path(1, 1, attribute)))
        tape.answer(GET, data)
        assert tape.lines()[-1].endswith(f": {text}")


def test_the_answer_to_get_attributes_all_of_identity_is_taken_apart():
    tape = Tape()
    tape.ask(request(Service.GET_ATTRIBUTES_ALL, logical_path(1, 1)))
    tape.answer(Service.GET_ATTRIBUTES_ALL, struct.pack("<HHHBBHI", 452, 16, 1, 1, 13, 0, 9) + b"\3AKD")
    decoder, _ = tape.decoded()
    assert tape.lines()[-1] == (
        "cip: Get_Attributes_All.res OK, Identity 0x01/1: 'AKD' vendor 452 type 16 product 1 revision 1.13 status "
        "0x0000 serial 0x00000009"
    )
    assert decoder.capture.stations.model(MACS[1]).name == "akd-ethernetip"


def test_each_request_and_reply_of_a_packet_of_several_is_a_line():
    tape = Tape()
    inner = [request(GET, logical_path(1, 1, number)) for number in (1, 99)]
    tape.ask(request(Service.MULTIPLE_SERVICE_PACKET, logical_path(2, 1), emit_multiple_service(
        [one.emit() for one in inner])))  # fmt: skip
    replies = [MessageReply(GET, data=b"\xc4\1").emit(), MessageReply(GET, 0x14).emit()]
    tape.answer(Service.MULTIPLE_SERVICE_PACKET, emit_multiple_service(replies), 0x1E)
    assert tape.lines()[2:] == [
        "cip: Multiple_Service_Packet.req 2 requests to Message Router 0x02/1",
        "cip: Get_Attribute_Single.req Identity 0x01/1, attribute 1 Vendor ID",
        "cip: Get_Attribute_Single.req Identity 0x01/1, attribute 99",
        "cip: Multiple_Service_Packet.res embedded service error (0x1E), 2 replies",
        "cip: Get_Attribute_Single.res OK, Identity 0x01/1, attribute 1 Vendor ID: 452",
        "cip: Get_Attribute_Single.res attribute not supported (0x14), Identity 0x01/1, attribute 99",
    ]


@pytest.mark.parametrize(
    ("path", "named"),
    [
        (logical_path(0xF6, 1, 4), "Get_And_Clear"),
        (b"\x91\4Tank", "service 0x4C"),
        (logical_path(6, 1), "service 0x4C"),
    ],
)
def test_a_service_of_one_object_has_its_name_at_this_object_alone(path, named):
    tape = Tape()
    tape.ask(request(Service.GET_AND_CLEAR, path, b"\1\0"))
    tape.answer(Service.GET_AND_CLEAR, b"\xc4\0\0\0\0\0")
    asked, answered = tape.lines()[2:]
    assert asked.startswith(f"cip: {named}.req ")
    assert answered.startswith(f"cip: {named}.res OK, ")


def test_a_reply_without_its_request_says_so():
    tape = Tape()
    tape.answer(GET, b"\1\0")
    assert tape.lines()[-1] == "cip: Get_Attribute_Single.res OK, its request is not in the capture: 01 00"


def asked_and_answered(tape: Tape, number: int) -> None:
    """An attribute of Identity, in the context of all others."""
    tape.ask(request(GET, logical_path(1, 1, number)))
    tape.answer(GET, number.to_bytes(2, "little"))


ANSWERED = [f"OK, Identity 0x01/1, attribute {n}" for n in (2, 3)]


def test_an_answer_is_not_taken_for_that_of_a_request_which_got_none():
    tape = Tape()
    tape.ask(request(GET, logical_path(1, 1, 1)))
    tape.now += 5 * 10**9
    for number in (2, 3):
        asked_and_answered(tape, number)
    assert [text[:32] for text in behind(tape.lines(), ANSWER)] == ANSWERED


def test_an_answer_is_not_taken_for_that_of_one_which_the_capture_lacks():
    tape = Tape()
    tape.ask(request(GET, logical_path(1, 1, 1)))
    tape.answer(GET, b"\1\0")
    lost = tape.frames[-1]
    for number in (2, 3):
        asked_and_answered(tape, number)
    found = tape.lines([frame for frame in tape.frames if frame is not lost])
    assert [text[:32] for text in behind(found, ANSWER)] == ANSWERED


def test_ports_that_are_used_again_have_no_request_of_before():
    tape = Tape()
    tape.ask(request(GET, logical_path(1, 1, 1)))
    tape.segment(0, flags=RST)
    tape.segment(0, flags=SYN)
    tape.segment(1, flags=SYN | ACK)
    asked_and_answered(tape, 2)
    assert [text[:32] for text in behind(tape.lines(), ANSWER)] == ANSWERED[:1]


def test_a_message_on_a_class_3_connection_is_paired_by_its_count():
    tape = Tape()
    for count, attribute in ((1, 1), (2, 2)):
        tape.connected(0, 5, count, request(GET, logical_path(1, 1, attribute)).emit())
    for count, value in ((2, 16), (1, 452)):
        tape.connected(1, 6, count, MessageReply(GET, data=value.to_bytes(2, "little")).emit())
    assert behind(tape.lines(), "cip: Get_Attribute_Single.res OK,") == [
        "Identity 0x01/1, attribute 2 Device Type: 16",
        "Identity 0x01/1, attribute 1 Vendor ID: 452",
    ]


def test_a_request_that_is_routed_is_shown_with_its_way():
    tape = Tape()
    inner = request(GET, logical_path(1, 1, 1)).emit()
    sent = fo.UnconnectedSend(inner, b"\1\0").emit()
    tape.ask(request(Service.UNCONNECTED_SEND, MANAGER, sent))
    tape.answer(GET, b"\xc4\1")
    tape.ask(request(Service.UNCONNECTED_SEND, MANAGER, sent))
    tape.answer(Service.UNCONNECTED_SEND, status=1, extended=(0x0204,))
    assert tape.lines()[2:] == [
        "cip: Unconnected_Send.req by port 1 address 0",
        "cip: Get_Attribute_Single.req Identity 0x01/1, attribute 1 Vendor ID",
        "cip: Get_Attribute_Single.res OK, Identity 0x01/1, attribute 1 Vendor ID: 452",
        "cip: Unconnected_Send.req by port 1 address 0",
        "cip: Get_Attribute_Single.req Identity 0x01/1, attribute 1 Vendor ID",
        (
            "cip: Unconnected_Send.res connection failure: unconnected request timed out (0x0204) (0x01), Identity "
            "0x01/1, attribute 1 Vendor ID"
        ),
    ]


def test_an_encapsulation_error_is_told_in_words():
    tape = Tape()
    tape.encapsulated(1, Command.SEND_RR_DATA, status=0x64)
    assert tape.lines()[-1] == "enip: SendRRData.res invalid session handle (0x0064)"


# -- connections


def test_a_forward_open_is_shown_with_all_fields_and_so_is_its_answer():
    tape = Tape()
    connect(tape, forward_open(t_to_o=fo.NetworkParameters(66, fo.ConnectionType.MULTICAST)), api_us=20_000)
    tape.ask(request(Service.FORWARD_CLOSE, MANAGER, fo.ForwardClose(fo.Triad(7, 1, 2), b"").emit()))
    tape.answer(Service.FORWARD_CLOSE, fo.ForwardCloseReply(fo.Triad(7, 1, 2)).emit())
    decoder, lines = tape.decoded()
    assert described(decoder, lines)[2:] == [
        (
            "cip: Forward_Open.req serial 0x0007 of originator 4660/0x00005678; class 1 cyclic; O->T 0x00000000 "
            "point-to-point, 70 octets, fixed, priority scheduled, RPI 10 ms; T->O 0x00220002 multicast, 66 "
            "octets, fixed, priority scheduled, RPI 10 ms; timeout 8 x RPI; Assembly 0x04/100, key 452/16/1 1.13, "
            "point 101, point 102"
        ),
        (
            "cip: Forward_Open.res OK, serial 0x0007 of originator 4660/0x00005678; O->T 0x00110001 API 20 ms; T->O "
            "0x00220002 API 20 ms"
        ),
        "cip: Forward_Close.req serial 0x0007 of originator 1/0x00000002; no path",
        "cip: Forward_Close.res OK, serial 0x0007 of originator 1/0x00000002",
    ]
    assert lines[2].description.details["t_to_o"]["type"] == "multicast"
    counts = decoder.summary()[0]["counts"]
    assert (counts["connects"], counts["releases"]) == (1, 1)


def test_a_refused_forward_open_says_why_and_what_would_be_right():
    tape = Tape()
    tape.ask(request(Service.FORWARD_OPEN, MANAGER, fo.emit_forward_open(forward_open())))
    refusal = fo.ForwardRefusal(fo.Triad(7, 0x1234, 0x5678)).emit()
    tape.answer(Service.FORWARD_OPEN, refusal, status=1, extended=(0x0127, 64))
    decoder, lines = tape.decoded()
    assert described(decoder, lines)[-1] == (
        "cip: Forward_Open.res connection failure: o to t size (0x0127), 64 octets of data would be right; serial "
        "0x0007 of originator 4660/0x00005678"
    )
    assert decoder.summary()[0]["reasons"]["refused"] == {"connection failure: o to t size (0x0127)": 1}


# -- filters, and any octets


def test_the_filters_know_the_families():
    filters = frame_filters()
    assert filters["cip"] == frozenset({"cip"})
    assert filters["enip"] == frozenset({"enip"})
    assert "cip" in filters["acyclic"]


FRAMES = everything()


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.integers(0, len(FRAMES) - 1), st.integers(0, 2**32)), min_size=1, max_size=20))
def test_any_frames_are_described_or_malformed_and_always_plain_json(chosen):
    import random

    decoder = make_decoder(every_frame=True)
    for number, (place, seed) in enumerate(chosen):
        frame = FRAMES[place]
        if seed % 3:
            # what is behind the addresses, so that it reaches the decoder
            frame = frame[:34] + mutated(random.Random(seed), frame[34:], [one[34:] for one in FRAMES])
        for line in decoder.feed(CapturedFrame(number, 10**18 + number * 10**6, frame)):
            json.dumps(decoder.as_dict(line))
    json.dumps(decoder.summary())


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=80), st.sampled_from([0, 1]))
def test_any_cip_message_is_described_or_malformed(octets, side):
    tape = Tape()
    items = emit_items((NullAddress(), UnconnectedData(octets)))
    tape.encapsulated(side, Command.SEND_RR_DATA, bytes(6) + items)
    assert len(tape.lines()) >= 3
