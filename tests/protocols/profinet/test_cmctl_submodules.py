"""Submodules that come and go while a controller exchanges data: parameters again, and what cannot be used."""

from __future__ import annotations

from cm_support import telegram
from cmctl_peers import RECORDS
from cmctl_wire import PAP, SECOND, SHARED, TELEGRAM, Wire

from pnfarm.protocols.profinet.cm.controller.cmctl import CmctlState
from pnfarm.protocols.profinet.cm.controller.events import (
    AlarmIndicated,
    ArAborted,
    ParametersEnded,
    RecordWriteDone,
    SubmodulesChanged,
)
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmType
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.connect import ArType
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum

WRITING = "its parameters are being written"
OF_TELEGRAM = [(r.api, r.slot, r.subslot, r.index) for r in RECORDS if r.subslot == 2]
DRIVE_ONLY = {"submodules": tuple(s for s in Wire().join().machine.plan.submodules if s.slot == 1)}
DAP_ONLY = {"submodules": tuple(s for s in Wire().join().machine.plan.submodules if s.slot == 0)}


def sent(wire: Wire) -> list[int]:
    """First block of each control call since the last look."""
    found = [head for opnum, head in wire.calls if opnum == Opnum.CONTROL]
    wire.calls.clear()
    return found


# pull and plug


def test_a_pulled_module_is_unusable_and_the_connection_stays() -> None:
    wire = Wire()
    end = wire.up()
    wire.device.pull(1, None, wire.now)
    wire.run()
    assert end.unusable() == {(1, 1): "pulled", (1, 2): "pulled"}
    assert end.machine.state is CmctlState.DATA
    assert end.machine.unusable == {PAP: "pulled", TELEGRAM: "pulled"}


def test_a_plugged_module_gets_its_records_its_end_and_is_usable_again() -> None:
    wire = Wire()
    end = wire.up(records=RECORDS)
    wire.device.pull(1, None, wire.now)
    wire.run()
    end.events.clear()
    wire.calls.clear()
    wire.records.writes.clear()
    wire.device.plug(1, None, wire.now)
    wire.run()
    assert wire.records.writes == OF_TELEGRAM
    assert sent(wire) == [BlockType.PRM_END_PLUG_REQ, BlockType.PRM_END_PLUG_REQ]
    assert [e for e in end.events if isinstance(e, ParametersEnded)] == [
        ParametersEnded((PAP,), after_plug=True),
        ParametersEnded((TELEGRAM,), after_plug=True),
    ]
    assert end.unusable() == {}
    assert wire.device_unusable(end) == set()
    assert wire.device.ars[0].module_diff is None


def test_while_the_parameters_are_written_the_submodule_stays_unusable() -> None:
    wire = Wire()
    end = wire.up(records=RECORDS)
    wire.device.pull(1, 2, wire.now)
    wire.ready = False
    wire.device.plug(1, None, wire.now)
    wire.run()
    assert end.unusable() == {(1, 2): WRITING}
    ar = wire.key(end)
    sequence = next(e.sequence for e in reversed(wire.device_events) if type(e).__name__ == "PrmEndReceived")
    assert wire.device.application_ready(ar, wire.now, sequence)
    wire.run()
    assert end.unusable() == {}


def test_a_wrong_module_is_unusable_until_the_right_one_comes() -> None:
    wire = Wire()
    end = wire.up()
    wire.device.plug(1, telegram(0x555, 0x70, 12, 12), wire.now)
    wire.run()
    assert end.unusable() == {(1, 1): "a wrong submodule is plugged", (1, 2): "a wrong submodule is plugged"}
    assert sent(wire) == [BlockType.PRM_END_REQ]
    wire.device.plug(1, telegram(0x100, 0x68, 12, 12), wire.now)
    wire.run()
    assert end.unusable() == {}


def test_a_submodule_that_is_missing_at_connect_gets_no_records_and_is_taken_once_it_is_plugged() -> None:
    wire = Wire()
    wire.plugged.pull(1)
    end = wire.join(records=RECORDS)
    end.machine.connect(wire.now)
    wire.run()
    assert end.machine.state is CmctlState.DATA
    assert end.machine.unusable == {PAP: "no module", TELEGRAM: "no module"}
    unsent = [e for e in end.events if isinstance(e, RecordWriteDone) and e.status is None]
    assert [(e.tag, e.reason) for e in unsent] == [(r, "no module") for r in RECORDS if r.slot == 1]
    wire.device.plug(1, telegram(0x100, 0x68, 12, 12), wire.now)
    wire.run()
    assert end.unusable() == {}
    assert wire.records.writes[-2:] == OF_TELEGRAM


def test_a_submodule_that_is_pulled_again_during_its_parameters_needs_none() -> None:
    wire = Wire()
    end = wire.up(records=RECORDS)
    wire.device.pull(1, 2, wire.now)
    wire.run()
    wire.late.add((Opnum.WRITE, BlockType.IOD_WRITE_REQ))
    wire.device.plug(1, None, wire.now)
    wire.run()
    wire.device.pull(1, 2, wire.now)
    wire.run()
    assert end.unusable() == {(1, 2): "pulled"}
    sent(wire)
    wire.let_go()
    assert sent(wire) == []
    assert end.take(ParametersEnded) == []
    assert end.machine.dropped["answer-of-a-void-round"] == 1
    wire.device.plug(1, None, wire.now)
    wire.run()
    assert end.unusable() == {}


def test_an_application_ready_that_overtakes_the_end_of_parameters_is_answered_after_it() -> None:
    wire = Wire()
    end = wire.up()
    wire.device.pull(1, 2, wire.now)
    wire.run()
    wire.late.add((Opnum.CONTROL, BlockType.PRM_END_PLUG_REQ))
    wire.device.plug(1, None, wire.now)
    wire.run()
    assert end.unusable() == {(1, 2): WRITING}
    wire.let_go()
    assert end.unusable() == {}


def test_a_refused_record_after_a_plug_keeps_the_submodule_out() -> None:
    wire = Wire()
    end = wire.up(records=RECORDS)
    wire.device.pull(1, 2, wire.now)
    wire.run()
    wire.records.refused.add(10)
    end.events.clear()
    wire.device.plug(1, None, wire.now)
    wire.run()
    (ended,) = [e for e in end.events if isinstance(e, ParametersEnded)]
    assert end.machine.state is CmctlState.DATA
    assert ended.reason.startswith("slot 1 subslot 0x0002 index 0x000A: ")
    assert end.unusable() == {(1, 2): ended.reason}
    # the second record was never sent, and this was reported
    assert wire.records.writes.count(OF_TELEGRAM[1]) == 1


def test_a_device_that_is_never_ready_after_a_plug_loses_that_submodule_and_keeps_its_connection() -> None:
    wire = Wire()
    end = wire.up(application_ready_ns=3 * SECOND)
    wire.device.pull(1, 2, wire.now)
    wire.ready = False
    wire.device.plug(1, None, wire.now)
    wire.run()
    assert end.machine.next_deadline() == wire.now + 3 * SECOND
    end.events.clear()
    wire.now += 3 * SECOND
    end.machine.handle_timeout(wire.now)
    wire.run()
    reason = "no ApplicationReady from the device within 3 s"
    assert end.events == [ParametersEnded((TELEGRAM,), True, reason), SubmodulesChanged({TELEGRAM: reason})]
    assert end.machine.state is CmctlState.DATA
    assert end.machine.next_deadline() is None


def test_a_release_during_parameters_leaves_nothing_behind() -> None:
    wire = Wire()
    end = wire.up(records=RECORDS)
    wire.device.pull(1, 2, wire.now)
    wire.run()
    wire.late.add((Opnum.WRITE, BlockType.IOD_WRITE_REQ))
    wire.device.plug(1, None, wire.now)
    wire.run()
    end.machine.release(wire.now)
    wire.let_go()
    assert end.machine.state is CmctlState.CLOSED
    assert wire.device.ars == ()
    assert end.machine.next_deadline() is None


# PrmBegin


def test_a_controller_parametrises_again_while_data_flow() -> None:
    wire = Wire()
    end = wire.up(records=RECORDS)
    wire.records.writes.clear()
    wire.calls.clear()
    assert end.machine.reparametrise()
    assert not end.machine.reparametrise()
    wire.run()
    assert sorted(wire.records.writes) == sorted((r.api, r.slot, r.subslot, r.index) for r in RECORDS)
    assert sent(wire) == [BlockType.PRM_BEGIN_REQ, BlockType.PRM_END_REQ]
    assert len(end.take(ParametersEnded)) == 1
    assert end.machine.unusable == {}
    assert end.machine.reparametrise([TELEGRAM])
    wire.run()
    assert end.take(ParametersEnded) == [ParametersEnded((TELEGRAM,), after_plug=False)]


def test_all_usable_submodules_are_parametrised_again() -> None:
    wire = Wire()
    end = wire.up(records=RECORDS)
    wire.device.pull(1, 2, wire.now)
    wire.run()
    end.events.clear()
    assert end.machine.reparametrise()
    wire.run()
    (ended,) = end.take(ParametersEnded)
    assert isinstance(ended, ParametersEnded)
    assert TELEGRAM not in ended.submodules
    assert PAP in ended.submodules
    assert ended.reason == ""


def test_alarms_wait_until_the_new_parameters_are_in_force() -> None:
    wire = Wire()
    end = wire.up()
    wire.ready = False
    end.machine.reparametrise()
    wire.run()
    wire.device.alarm(AlarmType.PROCESS, TELEGRAM, wire.now, high=True)
    wire.run()
    assert end.take(AlarmIndicated) == []
    wire.device.application_ready(wire.key(end), wire.now)
    wire.run()
    assert len(end.take(AlarmIndicated)) == 1


def test_a_prm_begin_that_the_device_refuses_changes_nothing() -> None:
    wire = Wire()
    end = wire.up()
    assert end.machine.reparametrise([(7, 7, 7)])
    wire.run()
    (ended,) = end.take(ParametersEnded)
    assert isinstance(ended, ParametersEnded)
    assert ended.reason.startswith("PrmBegin: ")
    assert end.machine.state is CmctlState.DATA
    assert end.machine.reparametrise([TELEGRAM])
    wire.run()
    assert end.take(ParametersEnded) == [ParametersEnded((TELEGRAM,), after_plug=False)]


def test_parameters_that_break_off_after_prm_begin_end_the_connection() -> None:
    wire = Wire()
    end = wire.up(records=RECORDS)
    wire.records.refused.add(10)
    end.machine.reparametrise()
    wire.run()
    (end_event,) = end.take(ArAborted)
    assert isinstance(end_event, ArAborted)
    assert (end_event.by_device, end_event.error_code2) == (False, RtaError.RPC_WRITE_ERROR)
    assert wire.device.ars == ()


def test_there_is_nothing_to_parametrise_without_a_connection() -> None:
    wire = Wire()
    end = wire.join()
    assert not end.machine.reparametrise()
    assert not wire.up().machine.reparametrise([])


# supervisors and shared devices


def test_a_supervisor_takes_over_and_gives_back() -> None:
    wire = Wire()
    end = wire.up(takeover_allowed=True, records=RECORDS)
    supervisor = wire.up(ar_type=ArType.IOSAR, **DRIVE_ONLY)
    wire.run()
    words = "controlled by a supervisor"
    assert end.unusable() == {(1, 1): words, (1, 2): words}
    assert supervisor.machine.unusable == {}
    assert (wire.device_unusable(end), wire.device_unusable(supervisor)) == ({(1, 1), (1, 2)}, set())
    assert end.machine.state is CmctlState.DATA
    wire.records.writes.clear()
    supervisor.machine.release(wire.now)
    wire.run()
    assert end.unusable() == {}
    assert wire.records.writes == OF_TELEGRAM
    assert wire.device_unusable(end) == set()


def test_a_supervisor_that_falls_silent_gives_back_as_well() -> None:
    wire = Wire()
    end = wire.up(takeover_allowed=True)
    supervisor = wire.up(ar_type=ArType.IOSAR, **DRIVE_ONLY)
    wire.device.watchdog_expired(wire.key(supervisor), wire.now)
    wire.run()
    assert isinstance(supervisor.events[-1], ArAborted)
    assert end.unusable() == {}


def test_a_controller_that_does_not_allow_it_keeps_its_submodules() -> None:
    wire = Wire()
    end = wire.up()
    supervisor = wire.up(ar_type=ArType.IOSAR, **DRIVE_ONLY)
    assert end.machine.unusable == {}
    assert set(supervisor.machine.unusable.values()) == {"locked by another IO controller"}


def test_a_supervisor_inherits_what_its_predecessor_leaves() -> None:
    wire = Wire()
    end = wire.up()
    supervisor = wire.up(ar_type=ArType.IOSAR, records=RECORDS[:2], **DRIVE_ONLY)
    assert supervisor.machine.unusable
    end.machine.release(wire.now)
    wire.run()
    assert supervisor.unusable() == {}
    assert wire.records.writes == OF_TELEGRAM


def test_two_controllers_share_a_device() -> None:
    wire = Wire(SHARED)
    first, second = wire.up(**DAP_ONLY), wire.up(**DRIVE_ONLY)
    assert (first.machine.unusable, second.machine.unusable) == ({}, {})
    wire.device.pull(1, None, wire.now)
    wire.run()
    assert first.take(AlarmIndicated) == []
    assert second.unusable() == {(1, 1): "pulled", (1, 2): "pulled"}
    wire.device.plug(1, None, wire.now)
    wire.run()
    assert second.unusable() == {}


def test_of_two_controllers_with_the_same_submodule_the_second_waits() -> None:
    wire = Wire(SHARED)
    first = wire.up(records=RECORDS)
    second = wire.up(records=RECORDS)
    assert first.machine.unusable == {}
    assert set(second.machine.unusable.values()) == {"locked by another IO controller"}
    assert len(second.machine.unusable) == len(second.machine.plan.submodules)
    first.machine.release(wire.now)
    wire.run()
    assert second.unusable() == {}
    assert second.machine.state is CmctlState.DATA


def test_records_reach_a_device_without_data_exchange() -> None:
    wire = Wire()
    wire.up()
    tool = wire.up(ar_type=ArType.IOSAR, device_access=True, submodules=())
    tool.machine.read_record("r", *TELEGRAM, 0x1234, 100)
    tool.machine.write_record("w", *TELEGRAM, 0x1234, b"abc")
    tool.machine.read_record("again", *TELEGRAM, 0x1234, 100)
    wire.run()
    assert [(e.tag, e.status.ok) for e in tool.events] == [("r", False), ("w", True), ("again", True)]
    assert len(wire.device.ars) == 2
    tool.machine.release(wire.now)
    wire.run()
    assert len(wire.device.ars) == 1
