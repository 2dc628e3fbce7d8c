"""The controller's AR against a device made of codecs: everything that can go wrong before it is established."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import pytest
from cmctl_peers import (
    AR_UUID,
    DEVICE_MAC,
    OTHER_UUID,
    RECORDS,
    REFUSED,
    SECOND,
    SUBSTITUTE,
    WRONG_MODULE,
    Change,
    ScriptedDevice,
    established,
    failure,
    line,
    make_plan,
    ready_payload,
    rta_codes,
    with_block,
    without_block,
)

from pnfarm.protocols.profinet.cm.controller.cmctl import CmctlState
from pnfarm.protocols.profinet.cm.controller.events import (
    ApplicationReadyReceived,
    ArEstablished,
    ArFailed,
    Connected,
    RecordWriteDone,
)
from pnfarm.protocols.profinet.cm.controller.response import addressed_ar
from pnfarm.protocols.profinet.errors import OK, RtaError
from pnfarm.protocols.profinet.wire.block import BlockType, split_blocks
from pnfarm.protocols.profinet.wire.cm.connect import (
    ArBlockRes,
)
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock
from pnfarm.protocols.profinet.wire.cm.expected import (
    ArInfo,
    DiffApi,
    DiffModule,
    DiffSubmodule,
    IdentInfo,
    ModuleDiffBlock,
    ModuleState,
    submodule_state,
)
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockRes
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum, PnioStatus

# Connect goes wrong


def test_a_refused_connect_fails_with_the_devices_status_in_words() -> None:
    refusal = PnioStatus(0xDB, 0x81, 0x02, 0x0B)
    end = failure(line(ScriptedDevice({Opnum.CONNECT: lambda *_: (refusal, b"")})))
    assert (end.phase, end.status) == ("connect", refusal)
    assert "IOCRBlockReq, reduction ratio" in end.reason


AR_OK = ArBlockRes(1, AR_UUID, 7, DEVICE_MAC)
BAD_CONNECTS: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "no octets": (lambda p: b"", "0 ARBlockRes"),
    "cut": (lambda p: p[:-3], "malformed"),
    "no AR": (lambda p: without_block(p, BlockType.AR_RES), "0 ARBlockRes"),
    "two ARs": (lambda p: p + p[:34], "2 ARBlockRes"),
    "AR too short": (lambda p: bytes.fromhex("8101 0004 0100 0001") + p[34:], "ARBlockRes .* malformed"),
    "other UUID": (lambda p: with_block(p, replace(AR_OK, ar_uuid=OTHER_UUID), BlockType.AR_RES), "ARUUID"),
    "other type": (lambda p: with_block(p, replace(AR_OK, ar_type=6), BlockType.AR_RES), "ARType 6"),
    "other session": (lambda p: with_block(p, replace(AR_OK, session_key=8), BlockType.AR_RES), "SessionKey 8"),
    "no MAC": (lambda p: with_block(p, replace(AR_OK, responder_mac=bytes(6)), BlockType.AR_RES), "00:00"),
    "group MAC": (lambda p: with_block(p, replace(AR_OK, responder_mac=b"\x01" * 6), BlockType.AR_RES), "01:01"),
    "no IOCRs": (lambda p: without_block(p, BlockType.IOCR_RES), "0 IOCRBlockRes of the input CR"),
    "no output CR": (lambda p: with_block(p, IocrBlockRes(2, 3, 0x8010), BlockType.IOCR_RES, 1), "output CR"),
    "two input CRs": (lambda p: p + bytes.fromhex("8102 0008 0100 0001 0001 8000"), "2 IOCRBlockRes of the input"),
    "no frame id": (lambda p: with_block(p, IocrBlockRes(2, 2, 0xFFFF), BlockType.IOCR_RES, 1), "0xFFFF"),
    "DCP frame id": (lambda p: with_block(p, IocrBlockRes(1, 1, 0xFEFE), BlockType.IOCR_RES), "0xFEFE"),
    "no alarm CR": (lambda p: without_block(p, BlockType.ALARM_CR_RES), "0 AlarmCRBlockRes"),
    "two alarm CRs": (lambda p: p + bytes.fromhex("8103 0008 0100 0001 0001 00c8"), "2 AlarmCRBlockRes"),
    "cut module diff": (lambda p: p + bytes.fromhex("8104 0004 0100 0001"), "malformed"),
}


@pytest.mark.parametrize("case", BAD_CONNECTS)
def test_an_unusable_connect_response_fails_and_the_device_is_told_by_release(case: str) -> None:
    tamper, sentence = BAD_CONNECTS[case]
    device = ScriptedDevice({Opnum.CONNECT: lambda status, payload: (status, tamper(payload))})
    end = failure(line(device))
    assert (end.phase, end.status) == ("connect", None)
    assert re.search(sentence, end.reason), end.reason
    assert [call.opnum for call in device.seen] == [Opnum.CONNECT, Opnum.RELEASE]


def test_a_silent_device_fails_the_connect_after_its_time() -> None:
    up = line(ScriptedDevice({Opnum.CONNECT: lambda *_: None}))
    up.controller.connect(up.now)
    assert up.run() == []
    assert up.controller.next_deadline() == up.now + 10 * SECOND
    up.controller.handle_timeout(up.now + 10 * SECOND - 1)
    assert up.run() == []
    up.controller.handle_timeout(up.now + 10 * SECOND)
    assert up.run() == [ArFailed("connect", None, "no answer to Connect within 10 s")]
    assert up.controller.next_deadline() is None
    up.controller.call_returned(up.unanswered[0], OK, b"", up.now)
    assert up.controller.dropped == {"late-answer": 1}


def test_a_call_that_rpc_gave_up_fails_the_phase_with_its_reason() -> None:
    up = line()
    up.controller.connect(0)
    (call,) = up.controller.calls(0)
    up.controller.call_failed(call.key, "rejected: nca_unk_if", 0)
    assert up.run() == [ArFailed("connect", None, "rejected: nca_unk_if")]


@pytest.mark.parametrize("port", [0, 1, 0x8892, 0xFFFF])
def test_whatever_a_device_says_of_its_port_for_rt_over_udp_the_start_up_goes_on(port: int) -> None:
    """Devices of Renesas and of Siemens answer 0."""
    answer = replace(AR_OK, udp_rt_port=port)
    device = ScriptedDevice({Opnum.CONNECT: lambda s, payload: (s, with_block(payload, answer, BlockType.AR_RES))})
    assert isinstance(line(device).start()[0], Connected)


def test_a_server_block_of_a_real_device_with_padding_of_0x0f_is_no_hindrance() -> None:
    server = bytes.fromhex("8106 000c 0100 0007 61626364656667 0f")
    device = ScriptedDevice({Opnum.CONNECT: lambda status, payload: (status, payload + server)})
    assert isinstance(line(device).start()[0], Connected)


# Module differences


def test_a_wrong_module_is_named_and_the_start_up_goes_on() -> None:
    up = line(ScriptedDevice(module_diff=WRONG_MODULE))
    connected = up.start()[0]
    assert isinstance(connected, Connected)
    assert [(d.text, d.fits) for d in connected.module_diff] == [("slot 1: wrong module, device has 0x00000007", False)]
    assert up.events[-1] == ArEstablished()


def test_a_substitute_does_not_fail_the_start_up() -> None:
    up = line(ScriptedDevice(module_diff=SUBSTITUTE))
    assert up.start()[-1] == ArEstablished()


@pytest.mark.parametrize(
    ("module", "texts"),
    [
        (DiffModule(3, 0, ModuleState.NO_MODULE), ["slot 3: no module"]),
        (DiffModule(3, 9, ModuleState.SUBSTITUTE), ["slot 3: substitute module, device has 0x00000009"]),
        (DiffModule(3, 9, 17), ["slot 3: unknown module state 17"]),
        (
            DiffModule(3, 9, 2, (DiffSubmodule(1, 5, submodule_state(IdentInfo.WRONG)),)),
            ["slot 3 subslot 0x0001: wrong submodule, device has 0x00000005"],
        ),
        (
            DiffModule(3, 9, 2, (DiffSubmodule(0x8000, 5, submodule_state(3, ArInfo.LOCKED_BY_IO_CONTROLLER)),)),
            ["slot 3 subslot 0x8000: no submodule", "slot 3 subslot 0x8000: locked by another IO controller"],
        ),
        (
            DiffModule(3, 9, 2, (DiffSubmodule(1, 5, submodule_state(0, 1, fault=True)),)),
            ["slot 3 subslot 0x0001: application not ready yet", "slot 3 subslot 0x0001: has a diagnosis"],
        ),
        (
            DiffModule(3, 9, 2, (DiffSubmodule(1, 5, submodule_state(9, 9)),)),
            ["slot 3 subslot 0x0001: unknown IdentInfo 9", "slot 3 subslot 0x0001: unknown ARInfo 9"],
        ),
        (
            DiffModule(3, 9, 2, (DiffSubmodule(1, 5, 7),)),
            ["slot 3 subslot 0x0001: substitute submodule, device has 0x00000005"],
        ),
        (DiffModule(3, 9, 2, (DiffSubmodule(1, 5, 5),)), ["slot 3 subslot 0x0001: unknown state 0x0005"]),
        (DiffModule(3, 9, 2, (DiffSubmodule(1, 5, 0x8000),)), []),
    ],
)
def test_every_deviation_has_its_words(module: DiffModule, texts: list[str]) -> None:
    up = line(ScriptedDevice(module_diff=ModuleDiffBlock((DiffApi(0, (module,)),))))
    connected = up.start()[0]
    assert isinstance(connected, Connected)
    assert [d.text for d in connected.module_diff] == texts


# Writes, PrmEnd and ApplicationReady go wrong


@pytest.mark.parametrize("multiple", [False, True])
def test_a_refused_parameter_record_fails_the_start_up_and_names_the_record(multiple: bool) -> None:
    up = line(ScriptedDevice(refused_indexes={11: REFUSED}), records=RECORDS, multiple_write=multiple)
    end = failure(up)
    assert (end.phase, end.status) == ("write", REFUSED)
    assert end.reason.startswith("slot 1 subslot 0x0002 index 0x000B: ")
    assert rta_codes(up) == [RtaError.RPC_WRITE_ERROR]
    assert all(call.opnum != Opnum.CONTROL for call in up.device.seen)


@pytest.mark.parametrize("answer", [b"", b"\x80\x08\x00\x3c", bytes(64)])
def test_a_malformed_answer_to_a_write_fails_the_start_up(answer: bytes) -> None:
    end = failure(line(ScriptedDevice({Opnum.WRITE: lambda status, _: (status, answer)}), records=RECORDS))
    assert (end.phase, end.status) == ("write", None)
    assert "malformed" in end.reason


def test_an_answer_that_leaves_a_record_out_fails_that_record() -> None:
    device = ScriptedDevice({Opnum.WRITE: lambda status, payload: (status, payload[:-64])})
    up = line(device, records=RECORDS, multiple_write=True)
    end = failure(up)
    assert "does not name the record" in end.reason
    assert [e.ok for e in up.events if isinstance(e, RecordWriteDone)] == [True, True, False]


BAD_CONTROLS: dict[str, tuple[Change, str]] = {
    "refused": (lambda *_: (PnioStatus(0xDD, 0x81, 0x14, 8), b""), "IODControl"),
    "empty": (lambda status, _: (status, b""), "0 blocks"),
    "cut": (lambda status, payload: (status, payload[:-1]), "malformed"),
    "other AR": (lambda status, p: (status, p.replace(AR_UUID.bytes, OTHER_UUID.bytes)), "is for AR"),
    "other session": (
        lambda s, p: (s, with_block(p, ControlBlock(0x8110, AR_UUID, 9, 8), BlockType.PRM_END_RES)),
        "session key 9",
    ),
    "not done": (
        lambda s, p: (s, with_block(p, ControlBlock(0x8110, AR_UUID, 7, 1), BlockType.PRM_END_RES)),
        "instead of Done",
    ),
}


@pytest.mark.parametrize("case", BAD_CONTROLS)
def test_a_bad_answer_to_prm_end_fails_the_start_up_and_aborts_the_device(case: str) -> None:
    change, sentence = BAD_CONTROLS[case]
    up = line(ScriptedDevice({Opnum.CONTROL: change}))
    end = failure(up)
    assert end.phase == "parameter-end"
    assert sentence in end.reason
    assert rta_codes(up) == [RtaError.RPC_CONTROL_ERROR]


def test_a_device_that_never_gets_ready_fails_the_start_up() -> None:
    up = line(application_ready_ns=30 * SECOND)
    up.controller.connect(up.now)
    up.run()
    assert up.controller.next_deadline() == up.now + 30 * SECOND
    up.controller.handle_timeout(up.now + 30 * SECOND)
    assert up.run() == [ArFailed("application-ready", None, "no ApplicationReady from the device within 30 s")]
    assert rta_codes(up) == [RtaError.ABORT_REQUEST]
    ((_, status, _),) = up.ready()
    assert not status.ok


BAD_READIES: dict[str, tuple[bytes, tuple[int, int]]] = {
    "empty": (b"", (0x40, 1)),
    "cut": (ready_payload(make_plan())[:-2], (0x16, 1)),
    "other block": (ready_payload(make_plan(), BlockType.PRM_END_REQ), (0x40, 1)),
    "block too short": (bytes.fromhex("0112 0004 0100 0000"), (0x16, 1)),
    "other AR": (ready_payload(make_plan(), ar_uuid=OTHER_UUID), (0x40, 5)),
    "other session": (ready_payload(make_plan(), session_key=9), (0x16, 6)),
    "other command": (ready_payload(make_plan(), command=1), (0x16, 8)),
    "bad module diff": (ready_payload(make_plan()) + bytes.fromhex("8104 0004 0100 0001"), (0x40, 1)),
}


@pytest.mark.parametrize("case", BAD_READIES)
def test_a_bad_application_ready_is_refused_with_the_standards_code_and_a_good_one_still_works(case: str) -> None:
    payload, codes = BAD_READIES[case]
    up = line()
    up.controller.connect(0)
    up.run()
    ((_, status, answer),) = up.ready(payload)
    assert (status, answer) == (PnioStatus(0xDD, 0x81, *codes), b"")
    assert up.controller.state is CmctlState.W_ARDY
    assert up.ready()[0][1] == OK
    assert up.run()[-1] == ArEstablished()


def test_an_application_ready_of_another_operation_or_too_early_is_refused() -> None:
    up = line(records=RECORDS)
    up.controller.connect(0)
    ((_, too_early, _),) = up.ready()
    assert too_early == PnioStatus(0xDD, 0x81, 0x3E, 0)
    up.run()
    ((_, other, _),) = up.ready(opnum=Opnum.RELEASE)
    assert other == PnioStatus(0xDD, 0x81, 0x40, 1)
    assert up.controller.dropped == {"ready-out-of-turn": 1, "ready-wrong-operation": 1}


def test_application_ready_is_confirmed_again_and_after_a_plug_with_its_own_block() -> None:
    up = established()
    assert up.ready()[0][1] == OK
    plug = ready_payload(up.controller.plan, BlockType.APPLICATION_READY_PLUG_REQ, alarm_sequence_number=5)
    ((_, status, payload),) = up.ready(plug)
    answer = ControlBlock.of(split_blocks(payload)[0])
    assert (status, answer.block_type, answer.alarm_sequence_number) == (OK, BlockType.APPLICATION_READY_PLUG_RES, 5)
    assert up.run() == [ApplicationReadyReceived(()), ApplicationReadyReceived((), after_plug=True)]


def test_an_application_ready_call_names_its_ar() -> None:
    assert addressed_ar(ready_payload(make_plan())) == AR_UUID
    assert addressed_ar(b"\x01") is None
