"""Every field of every Connect block: a wrong value is refused with the standard's two codes."""

from dataclasses import replace

import pytest
from cm_requests import (
    BASE,
    DA,
    P,
    alarm,
    ar,
    cut,
    data,
    drive,
    fitting,
    iocr,
    moved,
    pap,
    telegram_sub,
    versioned,
    with_blocks,
)
from cm_support import ADVANCED, CAPTURE_NAMES, DRIVE, DRIVE_API, Bench, calls, connect_request, telegram
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.protocols.profinet.cm.ar import expected_submodules
from pnfarm.protocols.profinet.cm.device.events import ArConnected, ConnectRefused
from pnfarm.protocols.profinet.description import (
    Limits,
    ModuleDescription,
    Plugged,
)
from pnfarm.protocols.profinet.errors import (
    AlarmCrField,
    ArField,
    ArRpcField,
    ExpectedField,
    IocrField,
    describe_status,
)
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import RawBlock
from pnfarm.protocols.profinet.wire.cm import connect
from pnfarm.protocols.profinet.wire.cm.expected import (
    DataDescription,
    ExpectedSubmoduleBlockReq,
    ModuleDiffBlock,
)
from pnfarm.protocols.profinet.wire.cm.iocr import FrameSlot, IocrApi
from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

REFUSALS = [
    # ARBlockReq
    ("ar-missing", with_blocks(*BASE[1:]), 1, 0),
    ("ar-twice", with_blocks(*BASE, BASE[0]), 1, 0),
    ("ar-length", cut(0), 1, 1),
    ("ar-version-high", versioned(0, 0x0200), 1, 2),
    ("ar-version-low", versioned(0, 0x0101), 1, 3),
    ("ar-type", ar(ar_type=0x10), 1, 4),
    ("ar-rt-class-3", replace(ar(ar_type=0x10), extra=(RawBlock(0x0109, bytes(18)),)), 1, 4),
    ("ar-redundant", replace(ar(ar_type=0x20), extra=(RawBlock(0x010A, bytes(8)),)), 1, 4),
    ("ar-unknown-type", ar(ar_type=0x7777), 1, 4),
    ("ar-uuid-nil", ar(ar_uuid=type(P.ar.ar_uuid)(int=0)), 1, 5),
    ("ar-mac-multicast", ar(initiator_mac=b"\x01" + bytes(5)), 1, 7),
    ("ar-mac-zero", ar(initiator_mac=bytes(6)), 1, 7),
    ("ar-object-uuid", ar(initiator_object_uuid=P.ar.ar_uuid), 1, 8),
    ("ar-not-active", ar(properties=0x12), 1, 9),
    ("ar-parameter-server", ar(properties=0x01), 1, 9),
    ("ar-device-access-of-a-controller", ar(properties=0x111), 1, 9),
    ("ar-companion", ar(properties=0x211), 1, 9),
    ("ar-companion-reserved", ar(properties=0x611), 1, 9),
    ("ar-acknowledge-companion", ar(properties=0x811), 1, 9),
    ("ar-timeout-0", ar(activity_timeout_factor=0), 1, 10),
    ("ar-timeout-1001", ar(activity_timeout_factor=1001), 1, 10),
    ("ar-name-empty", ar(station_name=b""), 1, 12),
    ("ar-name-long", ar(station_name=b"a" * 241), 1, 12),
    ("ar-name-unreadable", ar(station_name=b"a\x07"), 1, 13),
    # IOCRBlockReq
    ("iocr-length", cut(1), 2, 1),
    ("iocr-version-high", versioned(1, 0x0000), 2, 2),
    ("iocr-version-low", versioned(2, 0x0107), 2, 3),
    ("iocr-type", iocr(iocr_type=9), 2, 4),
    ("iocr-multicast", iocr(iocr_type=3), 2, 4),
    ("iocr-reference-twice", iocr(iocr_reference=2), 2, 5),
    ("iocr-lt", iocr(lt=0x0800), 2, 6),
    ("iocr-rt-class-3", iocr(properties=3), 2, 7),
    ("iocr-rt-over-udp", iocr(properties=4), 2, 7),
    ("iocr-reserved-bit-4", iocr(properties=0x12), 2, 7),
    ("iocr-reserved-bit-10", iocr(properties=0x402), 2, 7),
    ("iocr-reserved-bit-24", iocr(properties=0x0100_0002), 2, 7),
    ("iocr-reserved-bit-31", iocr(properties=0x8000_0002), 2, 7),
    ("iocr-class-1-in-advanced", replace(iocr(properties=1), ar=replace(P.ar, properties=ADVANCED)), 2, 7),
    ("iocr-data-length-short", iocr(data_length=39), 2, 8),
    ("iocr-data-length-long", iocr(data_length=1441), 2, 8),
    ("iocr-frame-id-of-class-1", iocr(frame_id=0xC000), 2, 9),
    ("iocr-input-frame-id-left-open", iocr(frame_id=0xFFFF), 2, 9),
    ("iocr-frame-id-twice", with_blocks(*BASE[:2], replace(P.inputs, iocr_reference=3), *BASE[2:]), 2, 9),
    ("iocr-send-clock-3", iocr(send_clock_factor=3), 2, 10),
    ("iocr-send-clock-not-offered", iocr(send_clock_factor=4), 2, 10),
    ("iocr-reduction-0", iocr(reduction_ratio=0), 2, 11),
    ("iocr-reduction-3", iocr(reduction_ratio=3), 2, 11),
    ("iocr-reduction-513", iocr(reduction_ratio=513, data_hold_factor=1), 2, 11),
    ("iocr-reduction-256-at-4-ms", iocr(reduction_ratio=256, send_clock_factor=128), 2, 11),
    ("iocr-phase-0", iocr(phase=0), 2, 12),
    ("iocr-phase-beyond", iocr(phase=3), 2, 12),
    ("iocr-send-offset", iocr(frame_send_offset=1_000_000), 2, 14),
    ("iocr-data-hold-0", iocr(data_hold_factor=0), 2, 16),
    ("iocr-data-hold-beyond-1920-ms", iocr(data_hold_factor=961), 2, 16),
    ("iocr-priority", iocr(tag_header=0xA000), 2, 17),
    ("iocr-no-api", iocr(apis=()), 2, 19),
    ("iocr-unknown-api", iocr(apis=(IocrApi(9, (FrameSlot(0, 1, 0),)),)), 2, 20),
    ("iocr-unknown-api-besides", iocr(apis=(*P.inputs.apis, IocrApi(9, (FrameSlot(0, 1, 0),)))), 2, 20),
    ("iocr-empty-api", iocr(apis=(*P.inputs.apis, IocrApi(0))), 2, 21),
    ("iocr-unknown-slot", iocr(apis=(*P.inputs.apis, IocrApi(0, (FrameSlot(9, 1, 20),)))), 2, 22),
    ("iocr-unknown-subslot", iocr(apis=(*P.inputs.apis, IocrApi(0, (FrameSlot(0, 9, 20),)))), 2, 23),
    ("iocr-data-overlap", iocr(apis=(P.inputs.apis[0], IocrApi(DRIVE_API, (FrameSlot(1, 2, 0),)))), 2, 24),
    ("iocr-iocs-unknown-slot", iocr(apis=(*P.inputs.apis, IocrApi(0, (), (FrameSlot(9, 1, 20),)))), 2, 26),
    ("iocr-iocs-wrong-direction", iocr(apis=(*P.inputs.apis, IocrApi(0, (), (FrameSlot(0, 1, 20),)))), 2, 27),
    (
        "iocr-iocs-outside",
        iocr(apis=(P.inputs.apis[0], IocrApi(DRIVE_API, P.inputs.apis[1].data_objects, (FrameSlot(1, 2, 40),)))),
        2,
        28,
    ),
    # ExpectedSubmoduleBlockReq
    ("expected-length", cut(3), 3, 1),
    ("expected-version", versioned(3, 0x0300), 3, 2),
    ("expected-version-low", versioned(3, 0x0101), 3, 3),
    ("expected-no-api-in-block", with_blocks(*BASE, ExpectedSubmoduleBlockReq(())), 3, 4),
    ("expected-none", with_blocks(*(b for b in BASE if not isinstance(b, ExpectedSubmoduleBlockReq))), 3, 4),
    ("expected-slot-out-of-range", drive(slot=0x8000), 3, 6),
    ("expected-slot-twice", with_blocks(*BASE, BASE[4]), 3, 6),
    ("expected-module-ident-0", drive(module_ident=0), 3, 7),
    ("expected-no-submodules", drive(submodules=()), 3, 9),
    ("expected-subslot-twice", drive(submodules=(*P.drive.submodules, P.drive.submodules[0])), 3, 10),
    ("expected-subslot-out-of-range", moved(0xA000), 3, 10),
    ("expected-interface-outside-of-api-0", moved(0x8000), 3, 10),
    ("expected-shared-without-input", telegram_sub(properties=0x06, data=(DataDescription(2, 12),)), 3, 12),
    ("expected-reduced-input", telegram_sub(properties=0x0B), 3, 12),
    ("expected-reduced-output", telegram_sub(properties=0x13), 3, 12),
    ("expected-two-inputs", telegram_sub(data=(DataDescription(1, 12), DataDescription(1, 12))), 3, 13),
    ("expected-direction", data(direction=7), 3, 13),
    ("expected-length-of-nothing", pap(data=(DataDescription(1, 4),)), 3, 14),
    ("expected-length-too-long", data(data_length=1440), 3, 14),
    ("expected-length-of-the-telegram", data(data_length=10), 3, 14),
    ("expected-iops-length", data(iops_length=2), 3, 15),
    ("expected-iocs-length", data(iocs_length=0), 3, 16),
    # AlarmCRBlockReq
    ("alarm-length", cut(5), 4, 1),
    ("alarm-version", versioned(5, 0x0101), 4, 3),
    ("alarm-type", alarm(alarm_cr_type=2), 4, 4),
    ("alarm-lt", alarm(lt=0x0800), 4, 5),
    ("alarm-over-udp", alarm(properties=2), 4, 6),
    ("alarm-timeout-0", alarm(rta_timeout_factor=0), 4, 7),
    ("alarm-timeout-101", alarm(rta_timeout_factor=101), 4, 7),
    ("alarm-retries-2", alarm(rta_retries=2), 4, 8),
    ("alarm-retries-16", alarm(rta_retries=16), 4, 8),
    ("alarm-data-short", alarm(max_alarm_data_length=199), 4, 10),
    ("alarm-data-long", alarm(max_alarm_data_length=1433), 4, 10),
    ("alarm-tag-high", alarm(tag_header_high=0xA000), 4, 11),
    ("alarm-tag-low", alarm(tag_header_low=0xC000), 4, 12),
    # the rest
    ("rpc-port", replace(P, extra=(connect.ArRpcBlockReq(0x03FF),)), 7, 4),
    ("rpc-version-high", replace(P, extra=(RawBlock(0x0107, b"\x88\x94", 0x0200),)), 7, 2),
    ("rpc-version-low", replace(P, extra=(RawBlock(0x0107, b"\x88\x94", 0x0107),)), 7, 3),
    ("rpc-length", replace(P, extra=(RawBlock(0x0107, b"\x04"),)), 7, 1),
    ("vendor-length", replace(P, extra=(RawBlock(0x0108, b"\x04"),)), 12, 1),
    ("cmrpc-args-length", with_blocks(*BASE[:-1], RawBlock(0x0103, b"", 0)), 4, 2),
    ("cmrpc-unknown-block", replace(P, extra=(RawBlock(0x0777, b""),)), 0x40, 1),
    ("cmrpc-multicast", replace(P, extra=(connect.McrBlockReq(1, 0, 1, b"x"),)), 0x40, 1),
    ("cmrpc-no-output-cr", with_blocks(*(b for b in BASE if b is not BASE[2])), 0x40, 2),
    ("cmrpc-no-alarm-cr", with_blocks(*BASE[:-1]), 0x40, 3),
    ("cmrpc-two-alarm-crs", with_blocks(*BASE, BASE[-1]), 0x40, 3),
    ("cmrpc-three-iocrs", with_blocks(*BASE, replace(P.outputs, iocr_reference=3)), 0x40, 7),
    ("device-access-with-crs", with_blocks(DA, *BASE[1:]), 0x40, 1),
]  # fmt: skip


#: Fields in which no value is wrong for a device, or whose wrong value shows in another field, and why.
BLAMELESS = {
    (1, ArField.SESSION_KEY): "any number will do",
    (1, ArField.INITIATOR_UDP_RT_PORT): "of RT over UDP, which IOCRProperties refuses",
    (2, IocrField.BLOCK_TYPE): "a block of another type is no IOCRBlockReq: unknown blocks",
    (2, IocrField.SEQUENCE): "a reserved field that a device does not look at",
    (2, IocrField.WATCHDOG_FACTOR): "of older editions; DataHoldFactor alone counts",
    (2, IocrField.MULTICAST_MAC): "of multicast CRs, which IOCRType refuses",
    (2, IocrField.NUMBER_OF_IOCS): "a number beyond the block is a faulty block length; none is allowed",
    (3, ExpectedField.BLOCK_TYPE): "a block of another type is no ExpectedSubmoduleBlockReq",
    (3, ExpectedField.API): "an API that the device does not have is told by the ModuleDiffBlock",
    (3, ExpectedField.MODULE_PROPERTIES): "a reserved field that a device does not look at",
    (3, ExpectedField.SUBMODULE_IDENT): "another ident than the real one is told by the ModuleDiffBlock",
    (4, AlarmCrField.BLOCK_TYPE): "a block of another type is no AlarmCRBlockReq",
    (4, AlarmCrField.LOCAL_ALARM_REFERENCE): "any number will do",
    (7, ArRpcField.BLOCK_TYPE): "a block of another type is no ARRPCBlockReq",
}


@pytest.mark.parametrize(
    ("code1", "fields"), [(1, ArField), (2, IocrField), (3, ExpectedField), (4, AlarmCrField), (7, ArRpcField)]
)
def test_every_field_of_every_block_is_among_the_refusals_or_has_no_wrong_value(code1, fields):
    refused = {(case[2], case[3]) for case in REFUSALS}
    assert {(code1, f) for f in fields} - refused == {key for key in BLAMELESS if key[0] == code1}


@pytest.mark.parametrize(("plan", "code1", "code2"), [c[1:] for c in REFUSALS], ids=[c[0] for c in REFUSALS])
def test_a_faulty_field_is_refused_with_its_codes(request, plan, code1, code2):
    bench = Bench(replace(DRIVE, limits=replace(DRIVE.limits, max_input_crs=2 if "twice" in request.node.name else 1)))
    status, answer = bench.connect(plan)
    assert (status.error_code, status.error_decode, status.error_code1, status.error_code2) == (
        0xDB,
        0x81,
        code1,
        code2,
    )
    assert answer == b""
    assert bench.cm.ars == ()
    (event,) = bench.events()
    assert isinstance(event, ConnectRefused)
    assert event.status == status
    assert len(event.detail) > 8


def test_a_cr_that_is_there_twice_is_refused_by_its_reference_and_not_for_want_of_room():
    assert DRIVE.limits.max_input_crs + DRIVE.limits.max_output_crs == 2
    status, _ = Bench().connect(with_blocks(*BASE[:2], P.inputs, *BASE[2:]))
    assert (status.error_code1, status.error_code2) == (2, 5)


@pytest.mark.parametrize("bit", range(11, 24))
def test_bits_between_the_reserved_ones_of_iocr_properties_are_not_looked_at(bit):
    assert Bench().connect(iocr(properties=P.inputs.properties | 1 << bit))[0].ok


def test_a_device_without_supervisors_refuses_one_with_io_data():
    alone = replace(DRIVE, limits=replace(DRIVE.limits, max_supervisor_ars=0))
    status, _ = Bench(alone).connect(ar(ar_type=6))
    assert (status.error_code1, status.error_code2) == (1, 4)
    assert Bench(DRIVE).connect(ar(ar_type=6))[0].ok


def test_truncated_arguments_are_refused_as_such():
    bench = Bench()
    status, _ = bench.call(0, P.payload()[:-3])
    assert (status.error_code1, status.error_code2) == (0x40, 0)


def test_a_strict_drive_refuses_a_faster_cycle_than_its_manual_allows_and_a_lax_one_takes_it():
    strict = replace(DRIVE, limits=Limits(strict=True, min_cycle_ns=16_000_000))
    status, _ = Bench(strict).connect()
    assert (status.error_code1, status.error_code2) == (2, 11)
    slow = replace(P, inputs=replace(P.inputs, reduction_ratio=16), outputs=replace(P.outputs, reduction_ratio=16))
    assert Bench(strict).connect(slow)[0].ok
    assert Bench(DRIVE).connect()[0].ok


def test_the_controllers_own_blocks_of_no_consequence_are_taken():
    bench = Bench()
    vendor = connect.ArVendorBlockReq(1, 0, b"xyz")
    status, answer = bench.connect(extra=(RawBlock(0x010B, b"\x00\x00"), connect.ArRpcBlockReq(0xC001), vendor))
    assert status.ok
    blocks = parse_blocks(answer)
    assert connect.ArRpcBlockRes(34964) in blocks
    assert connect.ArVendorBlockRes(1, 0) in blocks


def test_several_expected_blocks_and_one_block_with_all_slots_mean_the_same():
    bench = Bench()
    one = ExpectedSubmoduleBlockReq((P.dap, P.drive))
    status, answer = bench.connect(with_blocks(*BASE[:3], one, BASE[-1]))
    other = Bench().connect()
    assert (status, answer) == other


def test_the_device_chooses_the_output_frame_id_and_keeps_the_inputs():
    bench = Bench()
    _, answer = bench.connect(inputs=replace(P.inputs, frame_id=0x8000))
    inputs, outputs = parse_blocks(answer)[1:3]
    assert (inputs.frame_id, outputs.frame_id) == (0x8000, 0x8001)
    event = next(e for e in bench.events() if isinstance(e, ArConnected))
    assert [c.frame_id for c in event.iocrs] == [0x8000, 0x8001]


def test_class_1_frame_ids_come_from_the_class_1_range():
    bench = Bench()
    changes = {"properties": 1}
    _, answer = bench.connect(
        inputs=replace(P.inputs, frame_id=0xC000, **changes), outputs=replace(P.outputs, **changes)
    )
    assert [b.frame_id for b in parse_blocks(answer)[1:3]] == [0xC000, 0xC001]


def test_a_given_output_frame_id_is_kept():
    _, answer = Bench().connect(outputs=replace(P.outputs, frame_id=0x9000))
    assert parse_blocks(answer)[2].frame_id == 0x9000


def test_a_response_that_the_caller_cannot_take_is_an_error_and_leaves_no_ar():
    bench = Bench()
    status, answer = bench.call(0, P.payload(), room=60)
    assert (status.error_code1, status.error_code2, answer) == (0x40, 0, b"")
    assert bench.cm.ars == ()


def test_slot_1_takes_the_telegram_that_the_controller_expects():
    bench = Bench()
    assert bench.plugged.module(1).module_ident == 0x101
    _, answer = bench.connect()
    assert not any(isinstance(b, ModuleDiffBlock) for b in parse_blocks(answer))
    assert bench.plugged.module(1).module_ident == 0x100


def diff_of(bench, plan=P):
    status, answer = bench.connect(plan)
    assert status.ok
    event = next(e for e in bench.events() if isinstance(e, ArConnected))
    found = [b for b in parse_blocks(answer) if isinstance(b, ModuleDiffBlock)]
    return (found[0] if found else None), event.unusable


def test_an_unknown_module_is_answered_with_what_is_really_there():
    diff, unusable = diff_of(Bench(), drive(module_ident=0x555))
    (module,) = diff.apis[0].modules
    assert (diff.apis[0].api, module.slot, module.module_ident, module.state) == (DRIVE_API, 1, 0x101, 3)
    assert [(s.subslot, s.submodule_ident, s.ident_info) for s in module.submodules] == [(1, 0xFFFF, 2), (2, 0x69, 2)]
    assert unusable == {(DRIVE_API, 1, 1), (DRIVE_API, 1, 2)}


def test_a_missing_module_is_reported_as_no_module():
    bench = Bench()
    bench.plugged.pull(1)
    diff, unusable = diff_of(bench)
    assert diff.apis[0].modules[0].state == 0
    assert unusable == {(DRIVE_API, 1, 1), (DRIVE_API, 1, 2)}


def test_a_forced_module_of_the_same_ident_differs_in_its_submodule():
    bench = Bench()
    bench.plugged.plug(1, telegram(0x100, 0x70, 12, 12))
    diff, unusable = diff_of(bench)
    (module,) = diff.apis[0].modules
    assert (module.state, module.submodules[0].submodule_ident, module.submodules[0].state) == (2, 0x70, 0x9000)
    assert unusable == {(DRIVE_API, 1, 2)}


def test_a_missing_submodule_is_reported_as_no_submodule():
    bench = Bench()
    bench.plugged.plug(1, ModuleDescription(1, 0x100, telegram(0x100, 0x68, 12, 12).submodules[1:]))
    diff, unusable = diff_of(bench)
    (sub,) = diff.apis[0].modules[0].submodules
    assert (sub.subslot, sub.ident_info, unusable) == (1, 3, {(DRIVE_API, 1, 1)})


@pytest.mark.parametrize("name", CAPTURE_NAMES)
def test_a_device_that_fits_answers_a_captured_connect_as_the_captured_device_did(name):
    bench = Bench(fitting(name))
    real = parse_blocks(next(c.payload for c in calls(name) if not c.request and c.opnum == 0))
    status, answer = bench.call(0, connect_request(name), room=712)
    assert status.ok
    mine = parse_blocks(answer)
    kinds = [type(b).__name__ for b in real if type(b).__name__ not in {"ModuleDiffBlock", "ArServerBlock"}]
    assert [type(b).__name__ for b in mine if type(b).__name__ != "ArServerBlock"] == kinds
    assert (mine[0].ar_uuid, mine[0].session_key, mine[0].ar_type) == (
        real[0].ar_uuid,
        real[0].session_key,
        real[0].ar_type,
    )
    assert mine[1] == real[1]
    assert (mine[2].iocr_type, mine[2].iocr_reference) == (real[2].iocr_type, real[2].iocr_reference)
    expected = expected_submodules(
        a for b in parse_blocks(connect_request(name)) if isinstance(b, ExpectedSubmoduleBlockReq) for a in b.apis
    )
    event = next(e for e in bench.events() if isinstance(e, ArConnected))
    assert event.unusable == frozenset()
    assert {(d.api, d.slot, d.subslot) for c in event.iocrs for d in c.data} <= set(expected)


@settings(max_examples=150)
@given(st.data())
def test_mutated_connects_get_one_answer_and_never_an_exception(data):
    payload = bytearray(P.payload())
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    bench = Bench()
    status, _ = bench.call(0, bytes(payload[: data.draw(st.integers(len(payload) - 8, len(payload)))]))
    assert status.ok == bool(bench.cm.ars)
    assert describe_status(status)


@settings(max_examples=150)
@given(st.binary(max_size=120), st.integers(0, 6), st.integers(0, 5000))
def test_any_octets_in_any_call_get_one_answer(payload, opnum, room):
    Bench().call(opnum, payload, room)


def test_words_for_a_refusal():
    assert describe_status(PnioStatus(0xDB, 0x81, 2, 11)) == (
        "IODConnectRes: faulty IOCRBlockReq, reduction ratio (DB 81 02 0B)"
    )
    assert describe_status(PnioStatus(0xDE, 0x80, 0xB0, 0)) == "IODReadRes: invalid index (DE 80 B0 00)"
    assert "AR consumer DHT/WDT expired (RTA_ERR_ABORT)" in describe_status(PnioStatus(0xCF, 0x81, 0xFD, 5))
    assert describe_status(PnioStatus(0, 0, 0, 0)) == "OK"
    assert (
        describe_status(PnioStatus(0xDB, 0x81, 0x05, 7))
        == "IODConnectRes: faulty PrmServerBlockReq, code 7 (DB 81 05 07)"
    )
    assert (
        describe_status(PnioStatus(0xDB, 0x81, 0x99, 7))
        == "IODConnectRes: ErrorCode1 0x99, ErrorCode2 0x07 (DB 81 99 07)"
    )
    assert (
        describe_status(PnioStatus(0xCF, 0x81, 0xFD, 0xEE)) == "RTA error: RTA_ERR_CLS_PROTOCOL: code 238 (CF 81 FD EE)"
    )
    assert describe_status(PnioStatus(0x12, 0x34, 0x56, 0x78)) == "service 0x12: ErrorDecode 0x34 (12 34 56 78)"


def test_the_plugged_mapping_of_a_fitting_device_has_every_expected_submodule():
    description = fitting(CAPTURE_NAMES[1])
    assert len(Plugged(description)) == 10
    assert description.slots == (0, 1, 2, 3, 4, 5, 6)
