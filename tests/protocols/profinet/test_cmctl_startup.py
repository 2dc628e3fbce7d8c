"""The controller's AR against a device made of codecs: the start-up and the order of what is sent."""

from __future__ import annotations

from dataclasses import replace

import pytest
from cmctl_peers import (
    AR_UUID,
    DEVICE_MAC,
    OUTPUT_FRAME_ID,
    RECORDS,
    REFUSED,
    ScriptedDevice,
    line,
    with_block,
)

from pnfarm.protocols.profinet.cm.controller.cmctl import CmctlState
from pnfarm.protocols.profinet.cm.controller.events import (
    ApplicationReadyReceived,
    ArEstablished,
    Connected,
    Parametrised,
    RecordWriteDone,
)
from pnfarm.protocols.profinet.errors import OK
from pnfarm.protocols.profinet.wire.block import BlockType, split_blocks
from pnfarm.protocols.profinet.wire.cm.connect import ArServerBlock
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockRes
from pnfarm.protocols.profinet.wire.records.iod import parse_write_request
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum, PnioStatus

# The start-up


@pytest.mark.parametrize("startup", ["legacy", "advanced"])
def test_a_start_up_goes_from_connect_over_writes_and_prm_end_to_application_ready(startup: str) -> None:
    up = line(startup=startup, records=RECORDS)
    up.controller.connect(up.now)
    assert [type(e) for e in up.run()] == [Connected, RecordWriteDone, RecordWriteDone, RecordWriteDone, Parametrised]
    assert [call.opnum for call in up.device.seen] == [Opnum.CONNECT, *[Opnum.WRITE] * 3, Opnum.CONTROL]
    assert up.controller.state is CmctlState.W_ARDY
    ((call, status, payload),) = up.ready()
    assert (call, status) == ("call", OK)
    assert ControlBlock.of(split_blocks(payload)[0]) == ControlBlock(
        BlockType.APPLICATION_READY_RES, AR_UUID, 7, ControlCommand.DONE
    )
    assert up.run() == [ApplicationReadyReceived(()), ArEstablished()]
    assert up.controller.state is CmctlState.DATA
    assert not up.controller.dropped


def test_connected_has_the_frame_ids_of_the_devices_answer() -> None:
    up = line(input_frame_id=0x8061)
    connected = up.start()[0]
    assert isinstance(connected, Connected)
    inputs, outputs = connected.layouts
    assert inputs == replace(up.controller.layouts[0], frame_id=0x8061)
    assert outputs.frame_id == OUTPUT_FRAME_ID
    assert connected.device_mac == up.controller.device_mac == DEVICE_MAC


def test_a_device_that_assigns_another_input_frame_id_is_followed() -> None:
    def other(status: PnioStatus, payload: bytes) -> tuple[PnioStatus, bytes]:
        return status, with_block(payload, IocrBlockRes(1, 1, 0x8123), BlockType.IOCR_RES)

    up = line(ScriptedDevice({Opnum.CONNECT: other}))
    up.start()
    assert up.controller.layouts[0].frame_id == 0x8123


def test_blocks_that_a_controller_does_not_need_are_passed_over() -> None:
    def more(status: PnioStatus, payload: bytes) -> tuple[PnioStatus, bytes]:
        unknown = bytes.fromhex("8999 0004 0100 abcd")
        return status, unknown + payload + ArServerBlock(b"axis-01").emit()

    up = line(ScriptedDevice({Opnum.CONNECT: more}))
    assert up.start()[-1] == ArEstablished()


def test_one_call_is_under_way_at_a_time() -> None:
    up = line(records=RECORDS)
    up.controller.connect(0)
    (call,) = up.controller.calls(0)
    assert up.controller.calls(0) == []
    up.controller.call_returned(call.key, *up.device.answer(call), 0)
    assert len(up.controller.calls(0)) == 1


def test_a_multiple_write_carries_all_records_and_each_has_its_own_end() -> None:
    up = line(ScriptedDevice(refused_indexes={11: REFUSED}), records=RECORDS, multiple_write=True)
    up.start()
    (write,) = [call for call in up.device.seen if call.opnum == Opnum.WRITE]
    assert [(w.header.index, w.data) for w in parse_write_request(write.payload).writes] == [
        (r.index, r.data) for r in RECORDS
    ]
    assert [e for e in up.events if isinstance(e, RecordWriteDone)] == [
        RecordWriteDone(RECORDS[0], OK),
        RecordWriteDone(RECORDS[1], REFUSED),
        RecordWriteDone(RECORDS[2], OK),
    ]


def test_what_does_not_fit_one_multiple_write_goes_into_a_further_one() -> None:
    up = line(records=RECORDS, multiple_write=True, multiple_write_octets=140)
    up.start()
    assert sum(call.opnum == Opnum.WRITE for call in up.device.seen) == 2
    assert up.events[-1] == ArEstablished()


def test_application_ready_that_overtakes_the_confirmation_of_prm_end_is_answered_after_it() -> None:
    up = line()
    up.controller.connect(0)
    (connect,) = up.controller.calls(0)
    up.controller.call_returned(connect.key, *up.device.answer(connect), 0)
    (prm_end,) = up.controller.calls(0)
    assert up.ready() == []
    up.controller.call_returned(prm_end.key, *up.device.answer(prm_end), 0)
    assert [status for _, status, _ in up.controller.responses()] == [OK]
    assert [type(e) for e in up.run()] == [Connected, Parametrised, ApplicationReadyReceived, ArEstablished]
