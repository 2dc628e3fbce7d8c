"""The controller's AR against a device made of codecs: records, release, abort, and malformed octets."""

from __future__ import annotations

import pytest
from cmctl_peers import (
    DEVICE_ALARM_REFERENCE,
    DEVICE_MAC,
    RECORDS,
    SUBSTITUTE,
    WRONG_MODULE,
    Change,
    ScriptedDevice,
    established,
    line,
    ready_payload,
    rta_codes,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.protocols.profinet.cm.controller.cmctl import CmController, CmctlState
from pnfarm.protocols.profinet.cm.controller.events import (
    ArAborted,
    ArFailed,
    ArReleased,
    RecordRead,
    RecordWriteDone,
)
from pnfarm.protocols.profinet.errors import OK, RtaError, rta_status
from pnfarm.protocols.profinet.wire.alarms.rta import error_status, parse_rta, rta_error
from pnfarm.protocols.profinet.wire.records.iod import IodReadReqHeader
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum, PnioStatus
from pnfarm.wire.ethernet import VlanTag

# Records


def test_records_are_read_and_written_in_order_while_connected() -> None:
    up = established(ScriptedDevice(refused_indexes={9: PnioStatus(0xDE, 0x80, 0xB0, 0)}))
    up.controller.read_record("one", 0x3A00, 1, 1, 0xB02E, 240)
    up.controller.write_record("two", 0x3A00, 1, 1, 0xB02E, b"\x01\x02")
    up.controller.read_record("three", 0, 0, 1, 9, 64)
    up.controller.read_implicit("four", 0, 0, 1, 0xAFF0, 60)
    assert up.run() == [
        RecordRead("one", b"record", OK),
        RecordWriteDone("two", OK),
        RecordRead("three", None, PnioStatus(0xDE, 0x80, 0xB0, 0)),
        RecordRead("four", b"record", OK),
    ]
    assert [c.opnum for c in up.device.seen][-4:] == [Opnum.READ, Opnum.WRITE, Opnum.READ, Opnum.READ_IMPLICIT]


def test_without_a_connection_only_the_implicit_read_goes_out() -> None:
    up = line()
    up.controller.read_record("one", 0, 0, 1, 1, 64)
    up.controller.write_record("two", 0, 0, 1, 1, b"")
    up.controller.read_implicit("three", 0, 0, 1, 0xAFF0, 60)
    one, two, three = up.run()
    assert isinstance(one, RecordRead)
    assert isinstance(two, RecordWriteDone)
    assert (one.data, one.reason) == (None, "there is no connection (state IDLE)")
    assert (two.ok, two.reason) == (False, "there is no connection (state IDLE)")
    assert three == RecordRead("three", b"record", OK)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda s, p: (s, p[:30]), "malformed"),
        (lambda s, p: (s, p + bytes(4)), "malformed"),
        (lambda s, p: (s, p[:6] + b"\xff\xff" + p[8:]), "another record"),
    ],
)
def test_an_unusable_answer_to_a_read_ends_it_with_a_reason(change: Change, sentence: str) -> None:
    up = established(ScriptedDevice({Opnum.READ: change}))
    up.controller.read_record("one", 0, 0, 1, 1, 64)
    (end,) = up.run()
    assert isinstance(end, RecordRead)
    assert end.data is end.status is None
    assert sentence in end.reason


def test_more_octets_than_asked_for_are_not_taken() -> None:
    up = established()
    up.controller.read_record("one", 0, 0, 1, 1, 5)
    (end,) = up.run()
    assert isinstance(end, RecordRead)
    assert "at most 5" in end.reason


def test_a_record_without_an_answer_ends_after_its_time_and_the_next_one_goes_out() -> None:
    up = established(ScriptedDevice({Opnum.READ: lambda *_: None}))
    up.controller.read_record("one", 0, 0, 1, 1, 64)
    up.controller.write_record("two", 0, 0, 1, 1, b"x")
    assert up.run() == []
    deadline = up.controller.next_deadline()
    assert deadline is not None
    up.controller.handle_timeout(deadline)
    assert up.run() == [
        RecordRead("one", None, None, "no answer to Read within 10 s"),
        RecordWriteDone("two", OK),
    ]
    assert up.controller.state is CmctlState.DATA


def test_the_sequence_number_of_records_wraps() -> None:
    up = established()
    up.controller._calls._next_sequence = 0xFFFE
    up.device.seen.clear()
    for n in range(4):
        up.controller.read_implicit(n, 0, 0, 1, 1, 8)
    assert [(e.tag, e.data) for e in up.run() if isinstance(e, RecordRead)] == [(n, b"record") for n in range(4)]
    asked = [IodReadReqHeader.parse(call.payload).sequence_number for call in up.device.seen]
    assert asked == [0xFFFE, 0xFFFF, 0, 1]


# The end


def test_a_release_is_confirmed_and_ends_the_machine() -> None:
    up = established()
    up.controller.release(up.now)
    assert up.run() == [ArReleased()]
    assert up.device.seen[-1].opnum == Opnum.RELEASE
    assert up.controller.state is CmctlState.CLOSED
    assert up.controller.rta_to_send() == []


def test_a_release_ends_the_records_that_wait_and_lets_the_one_under_way_end() -> None:
    up = established()
    up.controller.read_record("under way", 0, 0, 1, 1, 64)
    (call,) = up.controller.calls(up.now)
    up.controller.read_record("waits", 0, 0, 1, 1, 64)
    up.controller.write_record("waits too", 0, 0, 1, 1, b"")
    up.controller.release(up.now)
    up.controller.call_returned(call.key, *up.device.answer(call), up.now)
    assert up.run() == [
        RecordRead("waits", None, None, "the connection is being released"),
        RecordWriteDone("waits too", None, "the connection is being released"),
        RecordRead("under way", b"record", OK),
        ArReleased(),
    ]


@pytest.mark.parametrize(
    "change",
    [lambda *_: (PnioStatus(0xDC, 0x81, 0x40, 5), b""), lambda *_: (OK, b""), lambda *_: None],
    ids=["refused", "empty", "silent"],
)
def test_a_release_that_is_not_confirmed_is_followed_by_an_rta_error(change: Change) -> None:
    up = established(ScriptedDevice({Opnum.RELEASE: change}))
    up.controller.release(up.now)
    up.run()
    if (deadline := up.controller.next_deadline()) is not None:
        up.controller.handle_timeout(deadline)
        up.run()
    (end,) = up.events
    assert isinstance(end, ArReleased)
    assert end.reason
    assert rta_codes(up) == [RtaError.ABORT_REQUEST]


def test_a_device_may_end_a_released_ar_with_its_own_rta_error() -> None:
    up = established(ScriptedDevice({Opnum.RELEASE: lambda *_: None}))
    up.controller.release(up.now)
    up.run()
    pdu = rta_error(1, DEVICE_ALARM_REFERENCE, RtaError.RELEASE_RECEIVED).emit()
    up.controller.receive_rta(pdu, DEVICE_MAC, up.now)
    assert up.run() == [ArReleased()]


def test_a_release_while_connecting_waits_for_the_connect() -> None:
    up = line()
    up.controller.connect(0)
    (connect,) = up.controller.calls(0)
    up.controller.release(0)
    assert up.run() == []
    up.controller.call_returned(connect.key, *up.device.answer(connect), 0)
    assert up.run() == [ArReleased()]
    assert up.device.seen[-1].opnum == Opnum.RELEASE


def test_a_release_or_an_abort_before_any_connect_ends_at_once() -> None:
    for end in (CmController.release, CmController.abort):
        up = line()
        end(up.controller, 0)
        assert up.run() == [ArReleased("there was no connection")]
        up.controller.connect(0)
        assert up.run() == []


def test_an_abort_while_connecting_fails_the_start_up_and_releases_what_the_device_may_have_made() -> None:
    up = line()
    up.controller.connect(0)
    (connect,) = up.controller.calls(0)
    up.controller.abort(0)
    up.controller.call_returned(connect.key, *up.device.answer(connect), 0)
    assert up.run() == [ArFailed("connect", None, "aborted by the controller")]
    assert up.device.seen[-1].opnum == Opnum.RELEASE


def test_an_abort_before_the_connect_has_gone_out_sends_nothing() -> None:
    up = line()
    up.controller.connect(0)
    up.controller.abort(0)
    assert up.run() == [ArFailed("connect", None, "aborted by the controller")]
    assert up.device.seen == []


def test_an_unconfirmed_release_is_counted() -> None:
    device = ScriptedDevice({Opnum.CONNECT: lambda *_: (OK, b""), Opnum.RELEASE: lambda *_: None})
    up = line(device)
    up.start()
    deadline = up.controller.next_deadline()
    assert deadline is not None
    up.controller.handle_timeout(deadline)
    assert up.run() == []
    assert up.controller.dropped["farewell-unconfirmed"] == 1


def test_an_unusable_connect_response_after_the_owner_released_is_released_once() -> None:
    up = line(ScriptedDevice({Opnum.CONNECT: lambda *_: (OK, b"")}))
    up.controller.connect(0)
    (connect,) = up.controller.calls(0)
    up.controller.release(0)
    up.controller.call_returned(connect.key, *(up.device.answer(connect) or (OK, b"")), 0)
    assert up.run() == [ArReleased()]
    assert [call.opnum for call in up.device.seen] == [Opnum.CONNECT, Opnum.RELEASE]
    assert up.controller.dropped == {"fault-in-w-rlcnf": 1}


def test_an_application_ready_that_was_kept_is_refused_when_the_ar_ends() -> None:
    up = line()
    up.controller.connect(0)
    (connect,) = up.controller.calls(0)
    up.controller.call_returned(connect.key, *(up.device.answer(connect) or (OK, b"")), 0)
    (_parameter_end,) = up.controller.calls(0)
    assert up.ready() == []
    ((_, first, _),) = up.ready()
    assert not first.ok
    up.controller.abort(0)
    ((_, second, _),) = up.controller.responses()
    assert not second.ok
    end = up.run()[-1]
    assert isinstance(end, ArFailed)
    assert end.phase == "parameter-end"


def test_an_expired_watchdog_aborts_the_ar_and_tells_the_device_code_5() -> None:
    up = established()
    up.controller.watchdog_expired(up.now)
    assert up.run() == [ArAborted(False, 0xFD, 5, "no input data within the data hold time")]
    ((mac, pdu, tag),) = up.controller.rta_to_send()
    error = parse_rta(pdu)
    assert (mac, tag) == (DEVICE_MAC, VlanTag(5))
    assert (error.destination, error.source, error_status(error)) == (DEVICE_ALARM_REFERENCE, 1, rta_status(5))


def test_an_rta_error_of_the_device_aborts_the_ar_and_is_not_answered() -> None:
    up = established()
    up.controller.read_record("waits", 0, 0, 1, 1, 64)
    pdu = rta_error(1, DEVICE_ALARM_REFERENCE, RtaError.LINK_DOWN).emit()
    up.controller.receive_rta(pdu, DEVICE_MAC, up.now)
    waits, end = up.run()
    assert waits == RecordRead("waits", None, None, "the connection was aborted")
    assert isinstance(end, ArAborted)
    assert (end.by_device, end.error_code1, end.error_code2) == (True, 0xFD, RtaError.LINK_DOWN)
    assert "link down" in end.reason
    assert up.controller.rta_to_send() == []


def test_an_rta_error_during_the_start_up_fails_it() -> None:
    up = line()
    up.controller.connect(0)
    up.run()
    pdu = rta_error(1, DEVICE_ALARM_REFERENCE, RtaError.CMI_TIMEOUT).emit()
    up.controller.receive_rta(pdu, DEVICE_MAC, 0)
    (end,) = up.run()
    assert isinstance(end, ArFailed)
    assert (end.phase, end.status) == ("application-ready", rta_status(6))


def test_rta_frames_of_others_change_nothing() -> None:
    up = established()
    good = rta_error(1, DEVICE_ALARM_REFERENCE, 5).emit()
    up.controller.receive_rta(good, bytes(6), 0)
    up.controller.receive_rta(rta_error(2, DEVICE_ALARM_REFERENCE, 5).emit(), DEVICE_MAC, 0)
    up.controller.receive_rta(good[:9], DEVICE_MAC, 0)
    assert up.run() == []
    assert up.controller.state is CmctlState.DATA
    assert up.controller.dropped == {"rta-of-another-station": 1, "rta-of-another-ar": 1, "rta-short": 1}


def test_a_second_connect_changes_nothing() -> None:
    up = established()
    up.controller.connect(up.now)
    assert up.run() == []
    assert up.controller.dropped == {"connect-in-data": 1}


# Whatever comes in


@settings(max_examples=200)
@given(st.data())
def test_tampered_answers_and_calls_raise_nothing(data: st.DataObject) -> None:
    def tamper(status: PnioStatus, payload: bytes) -> tuple[PnioStatus, bytes]:
        octets = bytearray(payload)
        for _ in range(data.draw(st.integers(0, 3))):
            where = data.draw(st.integers(0, len(octets)))
            octets[where : where + data.draw(st.integers(0, 4))] = data.draw(st.binary(max_size=4))
        return status, bytes(octets)

    device = ScriptedDevice(dict.fromkeys(Opnum, tamper), module_diff=SUBSTITUTE)
    up = line(device, records=RECORDS, multiple_write=data.draw(st.booleans()))
    up.controller.connect(0)
    up.run()
    up.ready(tamper(OK, ready_payload(up.controller.plan, diff=WRONG_MODULE))[1])
    up.controller.read_record("tag", 0, 0, 1, 1, 64)
    up.run()
    up.controller.receive_rta(data.draw(st.binary(max_size=40)), up.controller.device_mac or bytes(6), 0)
    up.controller.release(0)
    up.run()
    assert up.controller.state is CmctlState.CLOSED
    ends = [e for e in up.events if isinstance(e, ArFailed | ArAborted | ArReleased)]
    assert len(ends) == 1


@given(st.binary(max_size=200), st.integers(0, 0xFFFFFFFF))
def test_random_octets_as_answers_raise_nothing(payload: bytes, status: int) -> None:
    up = line(ScriptedDevice(dict.fromkeys(Opnum, lambda *_: (PnioStatus.from_int(status), payload))))
    up.start()
    assert isinstance(up.events[-1], ArFailed)
