"""The AR machine from Connect to its end, in virtual time, against a scripted controller."""

import contextlib
from dataclasses import replace
from ipaddress import IPv4Address

import pytest
from cm_support import (
    ADVANCED,
    CAPTURE_NAMES,
    CONTROLLER_MAC,
    DEVICE_MAC,
    DRIVE,
    LEGACY,
    MS,
    UUID_1,
    UUID_2,
    Bench,
    Plan,
    calls,
    telegram,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.cm.ar import CmdevState
from pnfarm.protocols.profinet.cm.device.events import (
    ApplicationReadyConfirmed,
    ArAborted,
    ArConnected,
    ArEstablished,
    ArReleased,
    ConnectRefused,
    PrmEndReceived,
    SubmodulesChanged,
)
from pnfarm.protocols.profinet.cm.device.states import TRANSITIONS, CmdevEvent
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.wire.alarms.rta import error_status, parse_rta, rta_error
from pnfarm.protocols.profinet.wire.any_block import emit_blocks, parse_blocks
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.connect import ArRpcBlockReq, ArServerBlock
from pnfarm.protocols.profinet.wire.cm.control import ControlCommand, control_response
from pnfarm.protocols.profinet.wire.cm.expected import ModuleDiffBlock
from pnfarm.protocols.profinet.wire.records.iod import IodReadReqHeader
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum, PnioStatus

P = Plan()


@pytest.mark.parametrize("startup", [LEGACY, ADVANCED])
def test_a_whole_start_up_in_both_modes(startup):
    bench = Bench()
    status, answer = bench.connect(ar=replace(P.ar, properties=startup))
    assert status.ok
    ar, inputs, outputs, alarm, server = parse_blocks(answer)
    assert (ar.responder_mac, ar.session_key, ar.ar_uuid) == (DEVICE_MAC, 7, UUID_1)
    assert (inputs.frame_id, outputs.frame_id) == (0x8001, 0x8000)
    assert alarm.max_alarm_data_length == 200
    assert server == ArServerBlock(b"axis-01")
    (connected,) = bench.events()
    assert isinstance(connected, ArConnected)
    assert connected.advanced_startup is (startup == ADVANCED)
    standing = bench.cm.ar(connected.ar_key)
    assert standing.advanced_startup is connected.advanced_startup
    assert (len(standing.iocrs) - len(standing.output_crs), standing.activity_timeout_ns) == (1, 10_000 * MS)
    assert (connected.initiator_name, connected.initiator_mac) == ("plc-1", CONTROLLER_MAC)
    key = connected.ar_key
    assert bench.cm.ar(key).state is CmdevState.W_PEIND
    assert not bench.cm.application_ready(key, 0)

    status, answer = bench.prm_end()
    assert status.ok
    (done,) = parse_blocks(answer)
    assert (done.block_type, done.command) == (0x8110, ControlCommand.DONE)
    assert bench.events() == [PrmEndReceived(key)]
    assert bench.cm.ar(key).state is CmdevState.W_ARDY

    assert bench.cm.application_ready(key, 0)
    (call,) = bench.cm.calls()
    assert (call.peer_ip, call.port) == (IPv4Address("10.0.0.1"), None)
    (request,) = parse_blocks(call.payload)
    assert (request.block_type, request.command) == (0x0112, ControlCommand.APPLICATION_READY)
    assert bench.cm.ar(key).state is CmdevState.W_ARDYCNF

    bench.confirm(call)
    assert bench.events() == [SubmodulesChanged(key, frozenset(), starting=True), ApplicationReadyConfirmed(key)]
    assert bench.cm.ar(key).state is CmdevState.WDATA
    bench.cm.data_received(key, 0)
    assert bench.events() == [ArEstablished(key)]
    assert bench.cm.ar(key).state is CmdevState.DATA
    assert bench.cm.next_deadline() is None
    assert bench.cm.rta_to_send() == []


def test_data_before_the_confirmation_leads_straight_to_data():
    bench = Bench()
    key = bench.establish()
    assert bench.cm.ar(key).state is CmdevState.DATA
    assert bench.events()[-2:] == [ApplicationReadyConfirmed(key), ArEstablished(key)]


def test_data_of_another_cr_does_not_count():
    bench = Bench()
    bench.connect()
    key = bench.key()
    bench.prm_end()
    bench.cm.application_ready(key, 0)
    bench.confirm(bench.cm.calls()[0])
    bench.cm.data_received(key, 0, 1)
    assert bench.cm.ar(key).state is CmdevState.WDATA
    bench.cm.data_received(key, 0, 2)
    assert bench.cm.ar(key).state is CmdevState.DATA
    bench.cm.data_received(key + 1, 0)


def test_the_real_drives_own_calls_run_through_the_machine():
    request, prm_end = [c.payload for c in calls(CAPTURE_NAMES[0]) if c.request][:2]
    confirmation = next(c.payload for c in calls(CAPTURE_NAMES[0]) if c.frame == 8)
    bench = Bench()
    assert bench.call(0, request)[0].ok
    key = bench.key()
    status, answer = bench.call(4, prm_end)
    assert status.ok
    assert answer == next(c.payload for c in calls(CAPTURE_NAMES[0]) if c.frame == 6)
    bench.cm.application_ready(key, 0)
    (call,) = bench.cm.calls()
    assert call.payload == next(c.payload for c in calls(CAPTURE_NAMES[0]) if c.frame == 7)[:32]
    bench.cm.call_returned(key, PnioStatus(0, 0, 0, 0), confirmation, 0)
    assert bench.cm.ar(key).state is CmdevState.WDATA


def test_a_silent_controller_is_aborted_after_its_activity_timeout():
    bench = Bench()
    bench.connect(ar=replace(P.ar, activity_timeout_factor=3))
    assert bench.cm.next_deadline() == 300 * MS
    bench.cm.handle_timeout(299 * MS)
    assert bench.cm.ars
    bench.cm.handle_timeout(300 * MS)
    assert bench.cm.ars == ()
    aborted = bench.events()[-1]
    assert isinstance(aborted, ArAborted)
    assert (aborted.error_code1, aborted.error_code2, aborted.by_peer) == (0xFD, 6, False)
    assert "CMI timeout" in aborted.reason
    assert bench.cm.next_deadline() is None


def test_the_timeout_also_covers_an_application_that_is_never_ready_and_data_that_never_come():
    for steps in (1, 2, 3):
        bench = Bench()
        bench.connect()
        bench.prm_end()
        if steps > 1:
            bench.cm.application_ready(bench.key(), 0)
            (call,) = bench.cm.calls()
            if steps > 2:
                bench.confirm(call)
        bench.cm.handle_timeout(10_000 * MS)
        assert bench.cm.ars == ()


def test_an_abort_tells_the_controller_by_err_rta():
    bench = Bench()
    key = bench.establish()
    bench.events()
    bench.cm.watchdog_expired(key, 0)
    (sent,) = bench.cm.rta_to_send()
    mac, frame = sent.destination, sent.payload
    assert mac == CONTROLLER_MAC
    pdu = parse_rta(frame)
    assert (pdu.destination, pdu.source) == (5, 0)
    assert frame[-4:].hex() == "cf81fd05"
    (event,) = bench.events()
    assert (event.error_code2, event.ar_key) == (5, key)
    bench.cm.abort(key, RtaError.ABORT_REQUEST, 0)
    assert bench.events() == []


def test_an_abort_takes_back_a_call_that_has_not_gone_out():
    bench = Bench()
    bench.connect()
    bench.prm_end()
    bench.cm.application_ready(bench.key(), 0)
    bench.cm.abort_all(RtaError.STATION_NAME_CHANGED, 0)
    assert bench.cm.calls() == []
    assert bench.events()[-1].error_code2 == 0x1F


def test_the_controllers_err_rta_ends_the_ar_without_an_answer():
    bench = Bench()
    key = bench.establish()
    bench.events()
    frame = rta_error(0, 5, RtaError.ABORT_REQUEST).emit() + bytes(24)
    bench.cm.receive_rta(frame, b"\x02" * 6, 0)
    bench.cm.receive_rta(rta_error(1, 5, 13).emit(), CONTROLLER_MAC, 0)
    bench.cm.receive_rta(rta_error(0, 6, 13).emit(), CONTROLLER_MAC, 0)
    assert bench.cm.ar(key) is not None
    assert bench.cm.dropped["rta-unknown-reference"] == 3
    bench.cm.receive_rta(frame, CONTROLLER_MAC, 0)
    (event,) = bench.events()
    assert (event.by_peer, event.error_code2) == (True, 13)
    assert bench.cm.rta_to_send() == []


def test_other_alarm_frames_are_counted_and_change_nothing():
    bench = Bench()
    bench.establish()
    bench.cm.receive_rta(bytes.fromhex("fe010000000511110006000500000000"), CONTROLLER_MAC, 0)
    bench.cm.receive_rta(b"\xfe", CONTROLLER_MAC, 0)
    assert len(bench.cm.ars) == 1
    assert bench.cm.dropped == {"alarm-sequence": 1, "rta-short": 1}


def test_release_ends_the_ar_and_answers_done():
    bench = Bench()
    key = bench.establish()
    bench.events()
    status, answer = bench.release()
    assert status.ok
    assert parse_blocks(answer)[0].block_type == 0x8114
    assert bench.events() == [ArReleased(key)]
    assert bench.cm.ars == ()
    assert bench.cm.rta_to_send() == []
    status, _ = bench.release()
    assert (status.error_code, status.error_code1, status.error_code2) == (0xDC, 0x40, 5)


@pytest.mark.parametrize(
    ("fields", "codes"),
    [
        ({"session": 8}, (0x28, 6)),
        ({"uuid": UUID_2}, (0x40, 5)),
        ({"version": 0x0200}, (0x28, 2)),
        ({"version": 0x0101}, (0x28, 3)),
    ],
)
def test_a_faulty_release_leaves_the_ar_alone(fields, codes):
    bench = Bench()
    bench.establish()
    status, _ = bench.release(**fields)
    assert (status.error_code, status.error_code1, status.error_code2) == (0xDC, *codes)
    assert len(bench.cm.ars) == 1


def test_a_release_with_another_command_or_other_blocks_is_refused():
    bench = Bench()
    bench.establish()
    status, _ = bench.control(BlockType.RELEASE_REQ, ControlCommand.PRM_END, 1)
    assert (status.error_code1, status.error_code2) == (0x28, 8)
    status, _ = bench.control(BlockType.PRM_END_REQ, ControlCommand.PRM_END, 1)
    assert (status.error_code1, status.error_code2) == (0x40, 1)


@pytest.mark.parametrize(
    ("block", "command", "fields", "codes"),
    [
        (0x0110, ControlCommand.DONE, {}, (0x14, 8)),
        (0x0110, ControlCommand.PRM_END, {"session": 1}, (0x14, 6)),
        (0x0110, ControlCommand.PRM_END, {"uuid": UUID_2}, (0x40, 5)),
        (0x0110, ControlCommand.PRM_END, {"version": 0x0102}, (0x14, 3)),
        (0x0110, ControlCommand.PRM_END, {"version": 0}, (0x14, 2)),
        (0x0111, ControlCommand.PRM_END, {}, (0x40, 6)),
        (0x0118, ControlCommand.PRM_BEGIN, {}, (0x40, 1)),
        (0x0112, ControlCommand.APPLICATION_READY, {}, (0x40, 1)),
    ],
)
def test_a_faulty_control_call_is_refused_and_the_ar_still_waits(block, command, fields, codes):
    bench = Bench()
    bench.connect()
    status, answer = bench.control(block, command, **fields)
    assert (status.error_code, status.error_code1, status.error_code2, answer) == (0xDD, *codes, b"")
    assert bench.cm.ars[0].state is CmdevState.W_PEIND


def test_control_calls_of_wrong_length_are_refused():
    bench = Bench()
    bench.connect()
    assert bench.call(4, b"")[0].error_code2 == 0
    assert bench.call(4, b"\x01\x10\x00")[0].error_code2 == 0
    status, _ = bench.call(4, bytes.fromhex("011000060100") + bytes(4))
    assert (status.error_code1, status.error_code2) == (0x14, 1)


def test_a_second_prm_end_is_a_state_conflict():
    bench = Bench()
    bench.establish()
    status, _ = bench.prm_end()
    assert (status.error_code1, status.error_code2) == (0x40, 6)


def waiting_for_confirmation():
    bench = Bench()
    bench.connect()
    bench.prm_end()
    bench.cm.application_ready(bench.key(), 0)
    (call,) = bench.cm.calls()
    bench.events()
    return bench, call


def test_a_refused_application_ready_aborts_the_ar():
    bench, call = waiting_for_confirmation()
    bench.confirm(call, PnioStatus(0xDD, 0x81, 0x40, 6))
    assert bench.events()[0].error_code2 == RtaError.RPC_CLIENT_CALL_FAILED


def test_an_unanswered_application_ready_aborts_the_ar_and_says_why():
    bench, call = waiting_for_confirmation()
    bench.cm.call_failed(call.token, "no answer after 3 tries", 0)
    (event,) = bench.events()
    assert (event.error_code2, event.reason) == (0x0C, "ApplicationReady: no answer after 3 tries")


@pytest.mark.parametrize("change", ["command", "session", "type", "empty", "two"])
def test_a_malformed_confirmation_aborts_the_ar(change):
    bench, call = waiting_for_confirmation()
    answer = control_response(parse_blocks(call.payload)[0])
    payload = {
        "command": replace(answer, command=1).emit(),
        "session": replace(answer, session_key=1).emit(),
        "type": replace(answer, block_type=0x8110).emit(),
        "empty": b"",
        "two": answer.emit() * 2,
    }[change]
    bench.cm.call_returned(call.token, PnioStatus(0, 0, 0, 0), payload, 0)
    assert bench.events()[0].error_code2 == RtaError.PROTOCOL_VIOLATION


def test_an_unexpected_result_is_dropped():
    bench, call = waiting_for_confirmation()
    bench.confirm(call)
    bench.confirm(call)
    bench.cm.call_failed(call.token, "late", 0)
    bench.cm.call_failed(99, "late", 0)
    assert bench.cm.dropped["late-call-result"] == 3
    assert len(bench.cm.ars) == 1


def test_application_ready_goes_to_the_port_that_the_controller_named():
    bench = Bench()
    bench.connect(extra=(ArRpcBlockReq(0xC123),))
    bench.prm_end()
    bench.cm.application_ready(bench.key(), 0)
    assert bench.cm.calls()[0].port == 0xC123


def test_application_ready_says_again_what_differs():
    bench = Bench()
    bench.plugged.plug(1, telegram(0x100, 0x70, 12, 12))
    bench.connect()
    bench.prm_end()
    bench.cm.application_ready(bench.key(), 0)
    request, diff = parse_blocks(bench.cm.calls()[0].payload)
    assert request.block_type == 0x0112
    assert isinstance(diff, ModuleDiffBlock)


def test_a_connect_with_a_standing_uuid_is_refused_and_ends_that_ar_and_the_next_one_succeeds():
    bench = Bench()
    key = bench.establish()
    bench.events()
    status, _ = bench.connect()
    assert (status.error_code1, status.error_code2) == (0x3D, 0)
    aborted, refused = bench.events()
    assert (aborted.ar_key, aborted.error_code2) == (key, 0x0E)
    assert isinstance(refused, ConnectRefused)
    assert bench.connect()[0].ok
    assert bench.key() == key + 1


def test_the_same_controller_with_another_uuid_replaces_its_ar():
    bench = Bench()
    key = bench.establish()
    bench.events()
    status, _ = bench.connect(ar=replace(P.ar, ar_uuid=UUID_2))
    assert status.ok
    aborted, connected = bench.events()
    assert (aborted.ar_key, aborted.error_code2) == (key, RtaError.RE_RUN_ABORTS_EXISTING)
    assert connected.uuid == UUID_2
    assert [ar.uuid for ar in bench.cm.ars] == [UUID_2]


OTHER = replace(P.ar, ar_uuid=UUID_2, station_name=b"plc-2", initiator_mac=b"\x02" + b"\x22" * 5)


def test_a_second_controller_finds_no_resources():
    bench = Bench()
    bench.establish()
    status, _ = bench.connect(ar=OTHER)
    assert (status.error_code1, status.error_code2) == (0x40, 4)
    assert [ar.uuid for ar in bench.cm.ars] == [UUID_1]


def test_a_device_for_two_controllers_reports_to_the_second_what_the_first_owns():
    bench = Bench(replace(DRIVE, limits=replace(DRIVE.limits, max_ars=2)))
    bench.establish()
    bench.events()
    status, answer = bench.connect(ar=OTHER, inputs=replace(P.inputs, frame_id=0x8000))
    assert status.ok
    blocks = parse_blocks(answer)
    diff = next(b for b in blocks if isinstance(b, ModuleDiffBlock))
    assert {s.ar_info for a in diff.apis for m in a.modules for s in m.submodules} == {3}
    assert len(bench.events()[0].unusable) == 6
    # frame ids and alarm references of both ARs differ
    assert blocks[2].frame_id == 0x8002
    assert blocks[3].local_alarm_reference == 1


def test_a_second_controller_cannot_change_the_telegram_under_the_first():
    bench = Bench(replace(DRIVE, limits=replace(DRIVE.limits, max_ars=2)))
    bench.establish()
    bench.connect(ar=OTHER, drive=replace(P.drive, module_ident=0x101))
    assert bench.plugged.module(1).module_ident == 0x100


DEVICE_ACCESS = replace(P.ar, ar_uuid=UUID_2, ar_type=6, properties=0x111, station_name=b"tool")


def test_an_acyclic_ar_exists_beside_the_controllers():
    bench = Bench()
    key = bench.establish()
    status, answer = bench.call(0, emit_blocks((DEVICE_ACCESS,)))
    assert status.ok
    assert len(parse_blocks(answer)) == 1
    connected = bench.events()[-1]
    assert (connected.device_access, connected.iocrs) == (True, ())
    tool = bench.cm.ars[-1]
    assert tool.state is CmdevState.DATA
    assert not bench.cm.application_ready(tool.key, 0)
    status, _ = bench.call(0, emit_blocks((replace(DEVICE_ACCESS, ar_uuid=replace(P.ar).ar_uuid),)))
    assert (status.error_code1, status.error_code2) == (0x3D, 0)
    assert bench.cm.ar(key) is None
    bench.cm.abort(tool.key, RtaError.ABORT_REQUEST, 0)
    assert bench.cm.rta_to_send()[-1].destination == CONTROLLER_MAC


def test_an_acyclic_ar_whose_tool_fell_silent_ends_with_its_activity_timeout():
    bench = Bench()
    bench.call(0, emit_blocks((DEVICE_ACCESS,)))
    (tool,) = bench.cm.ars
    silent = tool.activity_timeout_ns
    assert bench.cm.next_deadline() == silent
    # each of its calls restarts the time
    bench.now = silent - 1
    bench.call(Opnum.READ, IodReadReqHeader(1, tool.uuid, 0, 0, 1, 0xAFF0, 4096).emit())
    bench.cm.handle_timeout(silent)
    assert bench.cm.ars == (tool,)
    bench.events()
    bench.cm.handle_timeout(2 * silent - 1)
    (ended,) = bench.events()
    assert (ended.ar_key, ended.error_code2) == (tool.key, RtaError.CMI_TIMEOUT)
    assert bench.cm.ars == ()


def test_connect_is_refused_on_purpose_with_any_status():
    bench = Bench()
    wanted = PnioStatus(0xDB, 0x81, 0x40, 4)
    bench.cm.refuse_connect = lambda request: wanted if request.session_key == 7 else None
    assert bench.connect()[0] == wanted
    assert bench.events()[0].detail == "refused on purpose"
    assert bench.connect(ar=replace(P.ar, session_key=8))[0].ok


def test_a_drive_without_a_name_sends_no_server_block():
    bench = Bench()
    bench.cm.station_name = ""
    _, answer = bench.connect()
    assert len(parse_blocks(answer)) == 4


def test_an_unknown_operation_is_answered_with_an_error():
    assert Bench().call(9, b"")[0].error_code1 == 0x40


def test_every_row_of_the_table_belongs_to_a_state_of_the_standard_and_every_running_state_can_be_aborted():
    for state, event in TRANSITIONS:
        assert state in CmdevState
        assert event in CmdevEvent
    for state in (CmdevState.W_PEIND, CmdevState.W_ARDY, CmdevState.W_ARDYCNF, CmdevState.WDATA, CmdevState.DATA):
        for event in (CmdevEvent.ABORT, CmdevEvent.RELEASE_IND):
            assert TRANSITIONS[state, event][0] is CmdevState.ABORT


def test_captured_err_rta_pdus_are_parsed_and_built():
    short = bytes.fromhex("fe01000000001401000600050004cf81fd00")
    pdu = parse_rta(short + bytes(10))
    assert (pdu.send_sequence, pdu.ack_sequence, error_status(pdu)) == (6, 5, PnioStatus(0xCF, 0x81, 0xFD, 0))
    assert pdu == rta_error(0, 0, 0, 6, 5)
    assert pdu.emit() == short
    long = parse_rta(bytes.fromhex("fe01000000001401000500050004cf81fd0b002a010e"))
    assert error_status(long).error_code2 == 11


@settings(max_examples=200)
@given(st.binary(max_size=40))
def test_any_alarm_octets_are_harmless(frame):
    with contextlib.suppress(DecodeError):
        error_status(parse_rta(frame))
    bench = Bench()
    bench.cm.receive_rta(frame, CONTROLLER_MAC, 0)


ACTIONS = st.lists(
    st.sampled_from(
        ("connect", "connect2", "prm_end", "ready", "confirm", "fail", "data", "watchdog", "release", "time")
    ),
    max_size=25,
)


@settings(max_examples=200)
@given(ACTIONS)
def test_any_order_of_events_keeps_the_machine_consistent(actions):
    bench = Bench()
    pending = []
    for action in actions:
        key = bench.cm.ars[-1].key if bench.cm.ars else 0
        match action:
            case "connect":
                bench.connect()
            case "connect2":
                bench.call(0, replace(P, ar=OTHER).payload(), peer=Peer(IPv4Address("10.0.0.2"), 1))
            case "prm_end":
                bench.prm_end()
            case "ready":
                bench.cm.application_ready(key, bench.now)
            case "confirm" if pending:
                bench.confirm(pending.pop())
            case "fail" if pending:
                bench.cm.call_failed(pending.pop().token, "lost", bench.now)
            case "data":
                bench.cm.data_received(key, bench.now)
            case "watchdog":
                bench.cm.watchdog_expired(key, bench.now)
            case "release":
                bench.release()
            case "time":
                bench.now += 6_000 * MS
                bench.cm.handle_timeout(bench.now)
        pending += bench.cm.calls()
        bench.events()
    begun = {e.ar_key for e in bench.seen if isinstance(e, ArConnected)}
    ended = [e.ar_key for e in bench.seen if isinstance(e, ArAborted | ArReleased)]
    assert len(ended) == len(set(ended))
    assert begun - set(ended) == {ar.key for ar in bench.cm.ars}
    assert len(bench.cm.ars) <= 1
    assert (bench.cm.next_deadline() is None) == all(ar.state is CmdevState.DATA for ar in bench.cm.ars)
