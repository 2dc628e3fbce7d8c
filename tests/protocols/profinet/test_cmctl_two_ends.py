"""Both ends of context management joined in memory: the controller's AR and the device's."""

from __future__ import annotations

from dataclasses import replace

import pytest
from cm_support import DAP, DRIVE
from cmctl_pair import CONTROLLER, SECOND, Pair, device_fit_for, pair, pair_of
from cmctl_peers import OTHER_UUID, RECORDS, make_plan, plans
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.profinet.cm.controller.cmctl import CmController, CmctlState
from pnfarm.protocols.profinet.cm.controller.events import (
    ArAborted,
    ArEstablished,
    ArFailed,
    ArReleased,
    Connected,
    RecordRead,
    RecordWriteDone,
)
from pnfarm.protocols.profinet.cm.controller.plan import ArPlan, PlannedSubmodule
from pnfarm.protocols.profinet.cm.device import events as device_events
from pnfarm.protocols.profinet.description import (
    Limits,
)
from pnfarm.protocols.profinet.errors import OK, RtaError
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq
from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

# The whole start-up


@pytest.mark.parametrize("multiple_write", [False, True])
@pytest.mark.parametrize("startup", ["legacy", "advanced"])
def test_both_ends_reach_data_and_agree_on_the_frames(startup: str, multiple_write: bool) -> None:
    both = pair(startup=startup, multiple_write=multiple_write, records=RECORDS)
    both.start()
    assert both.controller.state is CmctlState.DATA
    assert both.events[-1] == ArEstablished()
    assert isinstance(both.device_events[-1], device_events.ArEstablished)
    connected = both.events[0]
    assert isinstance(connected, Connected)
    (ar,) = both.device.ars
    assert ar.iocrs == connected.layouts
    inputs, outputs = connected.layouts
    assert outputs.frame_id in range(0x8000, 0xBC00)
    assert outputs.frame_id != inputs.frame_id
    assert connected.module_diff == ()
    assert both.records.kept == {(r.api, r.slot, r.subslot, r.index): r.data for r in RECORDS}


def test_rt_class_1_gets_frame_ids_of_its_own_range() -> None:
    both = pair(rt_class=1, input_frame_id=0xC000)
    both.start()
    assert both.controller.layouts[1].frame_id in range(0xC000, 0xF800)


@given(plans())
def test_a_device_that_has_what_any_plan_expects_is_established_with_the_same_layouts(plan: ArPlan) -> None:
    both = pair_of(plan, device_fit_for(plan))
    both.start()
    assert both.events[-1] == ArEstablished()
    (ar,) = both.device.ars
    assert ar.iocrs == both.controller.layouts


def test_records_travel_while_connected() -> None:
    both = pair()
    both.start()
    both.events.clear()
    both.controller.write_record("w", 0x3A00, 1, 1, 0xB02E, b"\x01\x02\x03")
    both.controller.read_record("r", 0x3A00, 1, 1, 0xB02E, 240)
    both.controller.read_record("none", 0x3A00, 1, 1, 0x1234, 240)
    both.controller.read_implicit("implicit", 0x3A00, 1, 1, 0xB02E, 2)
    both.run()
    assert both.events == [
        RecordWriteDone("w", OK),
        RecordRead("r", b"\x01\x02\x03", OK),
        RecordRead("none", None, PnioStatus(0xDE, 0x80, 0xB0, 0)),
        RecordRead("implicit", b"\x01\x02", OK),
    ]


# What the device refuses


@pytest.mark.parametrize(
    ("changes", "codes"),
    [
        ({"ar_type": 9}, (1, 4)),
        ({"activity_timeout_factor": 0}, (1, 10)),
        ({"controller_name": ""}, (1, 12)),
        ({"send_clock_factor": 3}, (2, 10)),
        ({"reduction_ratio": 513}, (2, 11)),
        ({"input_frame_id": 0x0100}, (2, 9)),
        ({"startup": "advanced", "rt_class": 1, "input_frame_id": 0xC000}, (2, 7)),
        ({"alarm_cr": AlarmCrBlockReq(rta_retries=0)}, (4, 8)),
        ({"alarm_cr": AlarmCrBlockReq(max_alarm_data_length=1)}, (4, 10)),
    ],
)
def test_a_plan_outside_of_the_standard_is_refused_with_the_code_of_its_field(
    changes: dict[str, object], codes: tuple[int, int]
) -> None:
    both = pair(**changes)
    both.start()
    (end,) = both.events
    assert isinstance(end, ArFailed)
    assert (end.phase, end.status) == ("connect", PnioStatus(0xDB, 0x81, *codes))
    assert both.device.ars == ()


def test_a_cycle_below_what_the_drive_allows_is_refused() -> None:
    slow = replace(DRIVE, limits=Limits(strict=True, min_cycle_ns=16_000_000))
    both = pair(slow, reduction_ratio=8)
    both.start()
    (end,) = both.events
    assert isinstance(end, ArFailed)
    assert "IOCRBlockReq, reduction ratio" in end.reason
    both = pair(slow, reduction_ratio=16)
    both.start()
    assert both.events[-1] == ArEstablished()


def test_a_second_controller_is_refused_and_the_first_keeps_its_ar() -> None:
    both = pair()
    both.start()
    second = Pair(
        CmController(make_plan(ar_uuid=OTHER_UUID, controller_name="plc-2")), both.device, both.plugged, both.records
    )
    second.start()
    (end,) = second.events
    assert isinstance(end, ArFailed)
    assert end.status == PnioStatus(0xDB, 0x81, 0x40, 4)
    assert len(both.device.ars) == 1


def test_a_new_connect_of_the_same_controller_ends_its_old_ar() -> None:
    both = pair()
    both.start()
    again = Pair(CmController(make_plan(ar_uuid=OTHER_UUID)), both.device, both.plugged, both.records)
    again.controller.connect(again.now)
    (call,) = again.controller.calls(again.now)
    both.device.receive_call(call.key, call.opnum, call.payload, call.args_maximum, CONTROLLER, both.now)
    both.run()
    end = both.events[-1]
    assert isinstance(end, ArAborted)
    assert (end.by_device, end.error_code2) == (True, RtaError.RE_RUN_ABORTS_EXISTING)


# Modules


def test_a_pulled_module_is_named_and_the_start_up_goes_on() -> None:
    both = pair()
    both.plugged.pull(1)
    both.start()
    connected = both.events[0]
    assert isinstance(connected, Connected)
    assert connected.module_diff[0].text == "slot 1: no module"
    assert both.events[-1] == ArEstablished()


def test_a_wrong_module_is_named_with_what_the_device_has_and_does_not_fit() -> None:
    others = tuple(PlannedSubmodule(0x3A00, 1, 9, subslot, 9, 2, 2) for subslot in (1, 2))
    both = pair(submodules=(*make_plan().submodules[:4], *others))
    both.start()
    connected = both.events[0]
    assert isinstance(connected, Connected)
    assert [(d.text, d.fits) for d in connected.module_diff] == [
        ("slot 1: substitute module, device has 0x00000101", True),
        ("slot 1 subslot 0x0001: wrong submodule, device has 0x0000FFFF", False),
        ("slot 1 subslot 0x0002: wrong submodule, device has 0x00000069", False),
    ]


def test_an_expected_submodule_that_the_device_lacks_is_named() -> None:
    extra = PlannedSubmodule(0, 0, DAP.module_ident, 0x8003, 3)
    both = pair(submodules=(*make_plan().submodules, extra))
    both.start()
    connected = both.events[0]
    assert isinstance(connected, Connected)
    assert [d.text for d in connected.module_diff] == ["slot 0 subslot 0x8003: no submodule"]


# The end


def test_a_release_frees_the_device_for_the_next_connect() -> None:
    both = pair()
    both.start()
    both.controller.release(both.now)
    both.run()
    assert both.events[-1] == ArReleased()
    assert both.device.ars == ()
    assert isinstance(both.device_events[-1], device_events.ArReleased)
    again = Pair(CmController(make_plan(ar_uuid=OTHER_UUID)), both.device, both.plugged, both.records)
    again.start()
    assert again.events[-1] == ArEstablished()


@pytest.mark.parametrize("side", ["controller", "device"])
def test_an_expired_watchdog_of_either_end_ends_both(side: str) -> None:
    both = pair()
    both.start()
    if side == "controller":
        both.controller.watchdog_expired(both.now)
    else:
        both.device.watchdog_expired(both.device.ars[0].key, both.now)
    both.run()
    end, device_end = both.events[-1], both.device_events[-1]
    assert isinstance(end, ArAborted)
    assert isinstance(device_end, device_events.ArAborted)
    assert (end.error_code1, end.error_code2) == (device_end.error_code1, device_end.error_code2) == (0xFD, 5)
    assert (end.by_device, device_end.by_peer) == (side == "device", side == "controller")
    assert both.controller.state is CmctlState.CLOSED
    assert both.device.ars == ()


def test_a_withheld_application_ready_ends_the_start_up_at_both_ends() -> None:
    both = pair(application_ready_ns=5 * SECOND)
    both.ready = False
    both.start()
    assert both.controller.state is CmctlState.W_ARDY
    both.expire()
    assert both.events[-1] == ArFailed("application-ready", None, "no ApplicationReady from the device within 5 s")
    assert both.device.ars == ()


def test_a_late_application_ready_is_taken() -> None:
    both = pair()
    both.ready = False
    both.start()
    both.now += 20 * SECOND
    both.device.application_ready(both.device.ars[0].key, both.now)
    both.run()
    assert both.events[-1] == ArEstablished()


def test_the_activity_timeout_of_the_device_fails_the_start_up() -> None:
    both = pair(activity_timeout_factor=50)
    both.ready = False
    both.start()
    deadline = both.device.next_deadline()
    assert deadline == both.now + 5 * SECOND
    both.now = deadline
    both.device.handle_timeout(both.now)
    both.run()
    end = both.events[-1]
    assert isinstance(end, ArFailed)
    assert end.status == PnioStatus(0xCF, 0x81, 0xFD, 6)


@given(st.integers(0, 255))
def test_an_abort_carries_any_code_to_the_device(code: int) -> None:
    both = pair()
    both.start()
    both.controller.abort(both.now, code)
    both.run()
    end = both.device_events[-1]
    assert isinstance(end, device_events.ArAborted)
    assert (end.error_code2, end.by_peer) == (code, True)
