"""The alarm channel: frames, numbers, times and limits; both ends in memory, or one end against single PDUs."""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate

import pytest
from alarm_kit import CONTROLLER, DEVICE, STEP, Pair, alarm, controller_end, device_end, sent, unfinished

from pnfarm.protocols.profinet.alarms.channel import (
    AlarmAcknowledged,
    AlarmFailed,
    AlarmReceived,
    AlarmRefusedError,
    PeerAborted,
)
from pnfarm.protocols.profinet.errors import OK, ErrorCode, RtaError, pnio_error, rta_status
from pnfarm.protocols.profinet.wire.alarms.notification import acknowledge, parse_alarm
from pnfarm.protocols.profinet.wire.alarms.rta import (
    FIRST_SEND,
    RtaPdu,
    RtaType,
    error_status,
    next_sequence,
    parse_rta,
    rta_error,
)
from pnfarm.wire.ethernet import VlanTag

DATA, ACK, NACK, ERR = 0x11, 0x13, 0x12, 0x14


def to_device(kind: int, send: int, ack: int, body: bytes = b"", *, high: bool = False, **changes: int) -> RtaPdu:
    pdu = RtaPdu(0xFC01 if high else 0xFE01, DEVICE, CONTROLLER, kind, 0x11 if kind == DATA else 1, send, ack, body)
    return replace(pdu, **changes)


def numbers(pair: Pair) -> list[tuple[str, str, int, int]]:
    return [(name, RtaType(pdu.type).name, pdu.send_sequence, pdu.ack_sequence) for name, pdu in pair.frames]


# Without errors


def test_an_alarm_takes_four_frames_with_the_numbers_of_the_captured_controller():
    pair = Pair()
    handle = pair.device.notify(alarm(2), 0)
    pair.run()
    assert numbers(pair) == [
        ("device", "DATA", 0xFFFF, 0xFFFE),
        ("controller", "ACK", 0xFFFE, 0xFFFF),
        ("controller", "DATA", 0xFFFF, 0xFFFF),
        ("device", "ACK", 0xFFFF, 0xFFFF),
    ]
    assert pair.received() == [alarm(2)]
    assert pair.device_events == [AlarmAcknowledged(handle, alarm(2), OK)]
    assert pair.device.next_deadline() is pair.controller.next_deadline() is None
    pair.device.notify(alarm(3), 0)
    pair.run()
    assert numbers(pair)[4:] == [
        ("device", "DATA", 0, 0xFFFF),
        ("controller", "ACK", 0xFFFF, 0),
        ("controller", "DATA", 0, 0),
        ("device", "ACK", 0, 0),
    ]
    assert [a.sequence_number for a in pair.received()] == [0, 1]


def test_the_numbers_go_round_at_7fff_and_those_of_alarms_at_7ff():
    pair = Pair()
    for count in range(0x802):
        pair.device.notify(alarm(count), 0)
        pair.run()
        assert len(pair.device_events) == count + 1
        assert pair.received()[-1].sequence_number == count & 0x7FF
        pair.frames.clear()
    # as after thirty thousand further alarms
    assert list(accumulate(range(0x8000), lambda number, _: next_sequence(number), initial=FIRST_SEND))[1:] == [
        *range(0x8000)
    ]
    for end in (pair.device, pair.controller):
        end._low.send_sequence = end._low.expected_sequence = 0x7FFE
        end._low.last_sent = end._low.last_received = 0x7FFD
    for wanted in (0x7FFE, 0x7FFF, 0, 1):
        pair.device.notify(alarm(5), 0)
        pair.run()
        assert numbers(pair)[-1] == ("device", "ACK", wanted, wanted)
    assert pair.confirmed() == 0x802 + 4
    assert not pair.device.dropped


def test_each_priority_has_its_own_numbers_its_frame_id_and_its_tag():
    device = device_end(tag_header_high=0xC000, tag_header_low=0xB123)
    device.notify(alarm(1, high=True), 0)
    device.notify(alarm(2), 0)
    (high_tag, high), (low_tag, low) = device.to_send(0)
    assert (high_tag, low_tag) == (VlanTag(6), VlanTag(5, dei=True, vid=0x123))
    assert (high[:2].hex(), low[:2].hex()) == ("fc01", "fe01")
    assert high[8:12] == low[8:12] == b"\xff\xff\xff\xfe"
    assert (parse_alarm(high[14:]).high, parse_alarm(low[14:]).high) == (True, False)


def test_both_priorities_and_both_directions_go_on_side_by_side():
    pair = Pair()
    for n in range(1, 9):
        pair.device.notify(alarm(n, high=n % 2 == 0), 0)
        pair.controller.notify(alarm(0x100 + n, high=n % 3 == 0), 0)
    pair.run()
    got = [a.subslot for a in pair.received()]
    assert [n for n in got if n % 2] == [1, 3, 5, 7]
    assert [n for n in got if not n % 2] == [2, 4, 6, 8]
    assert len(pair.received("device")) == 8
    assert unfinished(pair.device) == unfinished(pair.controller) == (0, 0)
    assert (pair.confirmed(), pair.confirmed("controller")) == (8, 8)


def test_an_alarm_crs_property_forces_every_alarm_to_the_low_priority():
    device = device_end(properties=1)
    device.notify(alarm(1, high=True), 0)
    (pdu,) = sent(device)
    assert (pdu.frame_id, parse_alarm(pdu.body).high) == (0xFE01, False)


def test_an_alarm_that_is_refused_ends_with_the_peers_status():
    pair = Pair(acknowledges=False)
    handle = pair.device.notify(alarm(1), 0)
    pair.run()
    status = pnio_error(ErrorCode.ALARM_ACK, 0x3C, 0)
    assert pair.controller.acknowledge(pair.received()[0], 5, status)
    pair.run()
    assert pair.device_events == [AlarmAcknowledged(handle, alarm(1), status)]


def test_an_owner_may_take_its_time_and_answers_once():
    pair = Pair(acknowledges=False)
    pair.device.notify(alarm(1), 0)
    pair.device.notify(alarm(2), 0)
    pair.run()
    assert pair.device.next_deadline() is None
    assert unfinished(pair.device) == (1, 1)
    pair.pass_time(3600 * 10**9)
    (first,) = pair.received()
    assert not pair.controller.acknowledge(alarm(9), pair.now)
    assert pair.controller.acknowledge(first, pair.now)
    assert not pair.controller.acknowledge(first, pair.now)
    pair.run()
    assert [a.subslot for a in pair.received()] == [1, 2]


# Loss


def test_an_alarm_is_repeated_and_given_up_to_the_nanosecond():
    pair = Pair(device_end(rta_timeout_factor=3, rta_retries=2), now=7, lose=lambda sender, _pdu: sender == "device")
    pair.device.notify(alarm(1), 7)
    pair.run()
    for attempt in (1, 2):
        assert pair.device.next_deadline() == 7 + attempt * 3 * STEP
        pair.device.handle_timeout(7 + attempt * 3 * STEP - 1)
        assert pair.device.to_send(0) == []
        pair.pass_time(7 + attempt * 3 * STEP)
        assert [pdu for _, pdu in pair.frames] == [pair.frames[0][1]] * (attempt + 1)
    pair.device.handle_timeout(7 + 9 * STEP - 1)
    assert pair.device.events() == []
    pair.pass_time(7 + 9 * STEP)
    (failed,) = pair.device_events
    assert failed == AlarmFailed(RtaError.ALARM_SEND_FAILED, "an alarm was sent 3 times without a transport ACK")
    assert error_status(pair.frames[-1][1]) == rta_status(8)
    assert not pair.device.is_open
    assert pair.device.next_deadline() is None


def test_an_alarm_ack_that_is_never_acknowledged_fails_with_its_own_code():
    pair = Pair(lose=lambda sender, pdu: sender == "device" and pdu.type == RtaType.ACK)
    pair.device.notify(alarm(1), 0)
    pair.run()
    assert pair.controller.next_deadline() == STEP
    pair.pass_time(4 * STEP)
    assert pair.controller_events[-1] == AlarmFailed(
        RtaError.ALARM_ACK_SEND_FAILED, "an AlarmAck was sent 4 times without a transport ACK"
    )
    assert pair.device_events == [AlarmAcknowledged(1, alarm(1), OK), PeerAborted(rta_status(9))]
    assert not pair.device.is_open


def test_a_lost_ack_is_made_good_by_the_alarm_ack_and_nothing_is_repeated():
    pair = Pair(lose=lambda sender, pdu: sender == "controller" and pdu.type == RtaType.ACK)
    pair.device.notify(alarm(1), 0)
    pair.run()
    assert pair.device.next_deadline() is None
    assert pair.device_events == [AlarmAcknowledged(1, alarm(1), OK)]
    assert len([pdu for name, pdu in pair.frames if name == "device" and pdu.type == RtaType.DATA]) == 1


def test_a_repeated_alarm_is_acknowledged_again_and_delivered_once():
    lost = []
    pair = Pair(acknowledges=False)
    pair.lose = lambda sender, pdu: sender == "controller" and not lost and not lost.append(pdu)
    pair.device.notify(alarm(1), 0)
    pair.run()
    assert lost
    pair.pass_time(STEP)
    assert [name for name, *_ in numbers(pair)] == ["device", "controller", "device", "controller"]
    assert pair.frames[0][1] == pair.frames[2][1]
    assert len(pair.received()) == 1
    assert pair.device.next_deadline() is None


def test_an_alarm_ack_goes_before_alarms_that_wait():
    device = device_end()
    device.notify(alarm(1), 0)
    device.notify(alarm(2), 0)
    sent(device)
    device.receive(to_device(DATA, 0xFFFF, 0xFFFE, alarm(9).emit()), 0)
    (event,) = device.events()
    assert device.acknowledge(event.alarm, 0)
    assert [pdu.pdu_type for pdu in sent(device)] == [ACK]
    device.receive(to_device(ACK, 0xFFFF, 0xFFFF), 0)
    (ack,) = sent(device)
    assert parse_alarm(ack.body) == acknowledge(alarm(9))
    assert (ack.send_sequence, ack.ack_sequence) == (0, 0xFFFF)


# Limits


def test_a_full_queue_refuses_and_keeps_what_it_has():
    pair = Pair(device_end(queue_length=2), acknowledges=False)
    for n in range(3):
        pair.device.notify(alarm(n), 0)
    with pytest.raises(AlarmRefusedError, match="2 alarms wait already") as refused:
        pair.device.notify(alarm(9), 0)
    assert refused.value.reason == "queue-full"
    pair.device.notify(alarm(10, high=True), 0)
    pair.acknowledges = True
    pair.run()
    assert [a.subslot for a in pair.received()] == [0, 10, 1, 2]


def test_an_alarm_longer_than_agreed_is_refused_here_and_ends_the_channel_there():
    device = device_end(max_alarm_data_length=200)
    octets = len(alarm(1, size=0).emit())
    with pytest.raises(AlarmRefusedError, match="201 octets, at most 200") as refused:
        device.notify(alarm(1, size=201 - octets), 0)
    assert refused.value.reason == "too-long"
    device.notify(alarm(1, size=200 - octets), 0)
    pair = Pair(device_end(max_alarm_data_length=1432))
    pair.device.notify(alarm(1, size=201 - octets), 0)
    pair.run()
    assert pair.controller_events == [
        AlarmFailed(RtaError.ALARM_DATA_TOO_LONG, "the peer's alarm data have 201 octets")
    ]
    assert pair.device_events == [PeerAborted(rta_status(10))]


def test_a_closed_channel_is_silent_and_refuses():
    device = device_end()
    device.notify(alarm(1), 0)
    device.notify(alarm(2), 0)
    device.close()
    device.close()
    assert (device.to_send(0), device.events(), device.next_deadline()) == ([], [], None)
    with pytest.raises(AlarmRefusedError, match="closed"):
        device.notify(alarm(3), 0)
    assert not device.acknowledge(alarm(1), 0)
    device.receive(to_device(ACK, 0xFFFE, 0xFFFF), 0)
    device.handle_timeout(10**12)
    assert (device.events(), device.to_send(0)) == ([], [])
    assert device.dropped == {"closed": 1}
    assert unfinished(device) == (0, 0)


def test_an_abort_names_its_code_and_the_numbers_of_the_low_priority():
    pair = Pair()
    pair.device.notify(alarm(1), 0)
    pair.run()
    pair.device.abort(RtaError.ABORT_REQUEST)
    pair.run()
    pdu = pair.frames[-1][1]
    assert (pdu.frame_id, pdu.pdu_type, pdu.add_flags) == (0xFE01, ERR, 1)
    assert (pdu.send_sequence, pdu.ack_sequence) == (0, 0xFFFF)
    assert pair.controller_events[-1] == PeerAborted(rta_status(0x0D))
    assert not pair.controller.is_open


def test_withheld_acknowledgements_let_the_peer_give_up():
    pair = Pair()
    pair.device.withhold(RtaType.ACK)
    pair.device.notify(alarm(1), 0)
    pair.run()
    assert pair.device_events == [AlarmAcknowledged(1, alarm(1), OK)]
    pair.device.withhold()
    pair.pass_time(STEP)
    assert pair.controller.next_deadline() is None
    pair.device.withhold(RtaType.ACK)
    pair.device.notify(alarm(2), 0)
    pair.run()
    pair.pass_time(10 * STEP)
    assert pair.controller_events[-1].code == RtaError.ALARM_ACK_SEND_FAILED
    assert pair.device.dropped["withheld"] == 5


# Peers that do not keep to it


@pytest.mark.parametrize(
    ("pdu", "reason"),
    [
        (to_device(ACK, 0xFFFE, 0xFFFF, destination=9), "reference"),
        (to_device(ACK, 0xFFFE, 0xFFFF, source=9), "reference"),
        (to_device(0x23, 0xFFFE, 0xFFFF), "version"),
        (to_device(0x15, 0xFFFE, 0xFFFF), "type"),
        (to_device(0x10, 0xFFFE, 0xFFFF), "type"),
        (to_device(ACK, 0xFFFE, 0xFFFF, b"x"), "length"),
        (to_device(NACK, 0xFFFE, 0xFFFF, b"x"), "length"),
        (to_device(NACK, 0xFFFE, 0xFFFE), "nack"),
        (to_device(ACK, 0xFFFE, 0xFFFE), "late-ack"),
        (to_device(ACK, 0xFFFE, 0xFFFF, high=True), "late-ack"),
        (to_device(DATA, 0xFFFF, 0xFFFF, add_flags=1), "no-tack"),
        (to_device(ERR, 0xFFFF, 0xFFFE, b"\xcf\x81\xfd"), "short"),
    ],
)
def test_pdus_that_do_not_fit_change_nothing(pdu, reason):
    device = device_end()
    device.notify(alarm(1), 0)
    sent(device)
    device.receive(pdu, 1)
    assert device.dropped == {reason: 1}
    assert (device.to_send(1), device.events()) == ([], [])
    assert device.next_deadline() == STEP
    assert device.is_open


def test_a_number_out_of_turn_is_answered_by_a_nack_that_names_the_last_one():
    device = device_end()
    device.receive(to_device(DATA, 3, 0xFFFE, alarm(1).emit()), 0)
    (nack,) = sent(device)
    assert (nack.pdu_type, nack.send_sequence, nack.ack_sequence, nack.body) == (NACK, 0xFFFE, 0xFFFE, b"")
    assert device.events() == []
    assert device.dropped == {"sequence": 1}


@pytest.mark.parametrize(
    ("body", "code"),
    [
        (b"", RtaError.ALARM_IND_ERROR),
        (bytes.fromhex("0101 0002 0100"), RtaError.ALARM_IND_ERROR),
        (alarm(1).emit()[:-1], RtaError.ALARM_IND_ERROR),
        (alarm(1).emit() + b"\0", RtaError.ALARM_IND_ERROR),
        (alarm(1, high=True).emit(), RtaError.ALARM_IND_ERROR),
        (bytes(201), RtaError.ALARM_DATA_TOO_LONG),
    ],
)
def test_a_faulty_alarm_ends_the_channel_unacknowledged(body, code):
    device = device_end()
    device.receive(to_device(DATA, 0xFFFF, 0xFFFE, body), 0)
    (failed,) = device.events()
    assert (failed.code, device.is_open, device.to_send(0)) == (code, False, [])
    device.abort(failed.code)
    (err,) = sent(device)
    assert error_status(err).error_code2 == code


def test_an_alarm_before_the_answer_to_the_last_one_is_a_protocol_violation():
    device = device_end()
    device.receive(to_device(DATA, 0xFFFF, 0xFFFE, alarm(1).emit()), 0)
    device.receive(to_device(DATA, 0, 0xFFFE, alarm(2).emit()), 0)
    assert device.events() == [
        AlarmReceived(alarm(1)),
        AlarmFailed(RtaError.PROTOCOL_VIOLATION, "an alarm before the AlarmAck of the one before was confirmed"),
    ]


def test_an_alarm_ack_for_another_alarm_ends_the_channel():
    device = device_end()
    device.notify(alarm(1), 0)
    device.receive(to_device(DATA, 0xFFFF, 0xFFFF, acknowledge(alarm(2)).emit()), 0)
    assert device.events() == [AlarmFailed(RtaError.ALARM_IND_ERROR, "an AlarmAck that answers another alarm")]


def test_an_unexpected_alarm_ack_is_acknowledged_and_counted():
    device = device_end()
    device.receive(to_device(DATA, 0xFFFF, 0xFFFE, acknowledge(alarm(2)).emit()), 0)
    assert [pdu.pdu_type for pdu in sent(device)] == [ACK]
    assert device.events() == []
    assert device.dropped == {"out-of-turn-alpmi-alarm-ack-ind": 1}


def test_an_alarm_ack_without_the_transport_acknowledgement_does_not_stop_the_timer():
    device = device_end(rta_retries=1)
    device.notify(alarm(1), 0)
    device.receive(to_device(DATA, 0xFFFF, 0xFFFE, acknowledge(alarm(1)).emit()), 0)
    assert device.events() == [AlarmAcknowledged(1, alarm(1), OK)]
    device.notify(alarm(2), 0)
    assert [pdu.type for pdu in sent(device)] == [RtaType.DATA, RtaType.ACK]
    device.handle_timeout(STEP)
    device.handle_timeout(2 * STEP)
    assert device.events()[0].code == RtaError.ALARM_SEND_FAILED


def test_the_peers_error_pdu_closes_the_channel():
    device = device_end()
    device.notify(alarm(1), 0)
    device.receive(rta_error(DEVICE, CONTROLLER, 0x21), 0)
    assert device.events() == [PeerAborted(rta_status(0x21))]
    assert (device.is_open, device.to_send(0), device.next_deadline()) == (False, [], None)


# A controller that counts once for both priorities


class OneSequence:
    """What such a controller does: one pair of counters, whatever the frame id."""

    def __init__(self):
        self.send, self.sent_before, self.expected, self.received_before = 0xFFFF, 0xFFFE, 0xFFFF, 0xFFFE
        self.alarms = []

    def receive(self, pdu):
        """The answers to a PDU of the device."""

        def answer(kind, send, body=b""):
            flags = 0x11 if kind == DATA else 1
            return RtaPdu(pdu.frame_id, DEVICE, CONTROLLER, kind, flags, send, self.received_before, body)

        if pdu.type == RtaType.ACK or pdu.send_sequence == self.expected:
            if pdu.ack_sequence == self.send:
                self.sent_before, self.send = self.send, (self.send + 1) & 0x7FFF
            if pdu.type == RtaType.ACK:
                return []
        if pdu.send_sequence == self.received_before:
            return [answer(ACK, self.sent_before)]
        if pdu.send_sequence != self.expected:
            return [answer(NACK, self.sent_before)]
        self.received_before, self.expected = self.expected, (self.expected + 1) & 0x7FFF
        taken = parse_alarm(pdu.body)
        self.alarms.append(taken)
        return [answer(ACK, self.sent_before), answer(DATA, self.send, acknowledge(taken).emit())]

    def talk(self, device):
        while frames := sent(device):
            for frame in frames:
                for answer in self.receive(frame):
                    device.receive(answer, 0)


class ProfinetPy:
    """The alarm listener of profinet-py itself, with its socket replaced."""

    def __init__(self):
        from profinet.alarm_listener import AlarmEndpoint, AlarmListener

        self.alarms, self._answers = [], []
        endpoint = AlarmEndpoint("none", CONTROLLER, DEVICE, bytes(6))
        self._listener = AlarmListener(endpoint, bytes(6))
        self._listener._sock = self

    def send(self, frame):
        self._answers.append(parse_rta(frame[18:]))  # behind two MAC addresses, the tag and the EtherType

    def talk(self, device):
        while frames := sent(device):
            for pdu in frames:
                before = self._listener._exp_seq_num
                self._listener._process_alarm(pdu.emit()[2:], pdu.frame_id == 0xFC01, bytes(6))
                if pdu.type == RtaType.DATA and self._listener._exp_seq_num != before:
                    self.alarms.append(parse_alarm(pdu.body))
                answers, self._answers = self._answers, []
                for answer in answers:
                    device.receive(answer, 0)


@pytest.mark.parametrize("kind", [OneSequence, ProfinetPy])
@pytest.mark.parametrize("before", [1, 2, 5])
@pytest.mark.parametrize("first_high", [True, False])
def test_a_controller_that_counts_once_gets_every_alarm_in_the_priority_that_came_first(kind, before, first_high):
    device, controller = device_end(), kind()
    for n in range(before):
        device.notify(alarm(n, high=first_high), 0)
        controller.talk(device)
    handle = device.notify(alarm(before, high=not first_high), 0)
    device.notify(alarm(before + 1, high=not first_high), 0)
    controller.talk(device)
    device.notify(alarm(before + 2, high=first_high), 0)
    controller.talk(device)
    assert [a.subslot for a in controller.alarms] == list(range(before + 3))
    assert {a.high for a in controller.alarms} == {first_high}
    done = [event.handle for event in device.events() if isinstance(event, AlarmAcknowledged)]
    assert done == list(range(1, before + 4))
    assert handle in done
    assert device.dropped["peer-counts-once"] == 1
    assert device.next_deadline() is None


def test_a_peer_that_counts_twice_is_never_taken_for_one_that_counts_once():
    pair = Pair()
    for n in range(6):
        pair.device.notify(alarm(n, high=n % 2 == 1), 0)
        pair.run()
    assert [a.high for a in pair.received()] == [False, True] * 3
    assert not pair.device.dropped
    # one that names its next number in an ACK, and not its last one, has done so before
    device = device_end()
    for high in (False, True):
        device.notify(alarm(1, high=high), 0)
        sent(device)
        device.receive(to_device(ACK, 0xFFFF, 0xFFFF, high=high), 0)
        body = acknowledge(alarm(1, high=high)).emit()
        device.receive(to_device(DATA, 0xFFFF, 0xFFFF, body, high=high), 0)
    assert len(device.events()) == 2
    assert not device.dropped


def test_an_idle_channel_needs_no_timer():
    for channel in (device_end(), controller_end()):
        assert channel.next_deadline() is None
        channel.handle_timeout(10**15)
        assert (channel.to_send(0), channel.events()) == ([], [])
