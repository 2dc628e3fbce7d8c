"""Submodules that come, go and change hands while connections are open: alarms, differences, data that are usable."""

from dataclasses import replace

import pytest
from cm_controllers import (
    DAP,
    PAP,
    TAKEOVER_ALLOWED,
    TELEGRAM,
    Controller,
    dap_only,
    drive_only,
    everything,
    one_controller,
    places,
    shared_bench,
    unusable,
)
from cm_support import ADVANCED, DRIVE, DRIVE_API, LEGACY, Bench, telegram
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.profinet.cm.ar import CmdevState
from pnfarm.protocols.profinet.cm.device.events import (
    AlarmConfirmed,
    ApplicationReadyConfirmed,
    ArAborted,
    PrmEndReceived,
)
from pnfarm.protocols.profinet.description import Plugged, SlotState
from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.errors import PnioStatus
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmType
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.control import ControlCommand, SubmoduleList
from pnfarm.protocols.profinet.wire.cm.expected import ArInfo, IdentInfo, ModuleDiffBlock, ModuleState

SUPERVISOR = {"ar_type": 6, "properties": LEGACY}
MS = 1_000_000


def states(diff):
    """(subslot) -> (IdentInfo, ARInfo) of every submodule that a ModuleDiffBlock names."""
    return {
        (module.slot, sub.subslot): (sub.ident_info, sub.ar_info)
        for api in diff.apis
        for module in api.modules
        for sub in module.submodules
    }


# pull and plug


@pytest.mark.parametrize(("properties", "expected"), [(LEGACY, AlarmType.PULL), (ADVANCED | 1 << 31, 0x1F)])
def test_a_pulled_module_is_one_alarm_of_the_type_that_the_controller_knows(properties, expected):
    bench, controller = one_controller(properties=properties)
    bench.cm.pull(1, None, 0)
    assert unusable(bench) == {PAP, TELEGRAM}
    (alarm,) = controller.pump()
    assert places([alarm]) == [(expected, DRIVE_API, 1, 0)]
    assert (alarm.module_ident, alarm.submodule_ident, alarm.high) == (0, 0, False)
    assert bench.cm.ars[0].state is CmdevState.DATA


def test_a_pulled_submodule_is_an_alarm_about_it_alone():
    bench, controller = one_controller()
    bench.cm.pull(1, 2, 0)
    assert unusable(bench) == {TELEGRAM}
    assert places(controller.pump()) == [(AlarmType.PULL, *TELEGRAM)]


def test_a_plugged_module_is_usable_only_once_its_parameters_have_come():
    bench, controller = one_controller()
    bench.cm.pull(1, None, 0)
    controller.pump()
    bench.cm.plug(1, None, 0)
    alarms = controller.pump()
    assert places(alarms) == [(AlarmType.PLUG, *PAP), (AlarmType.PLUG, *TELEGRAM)]
    assert [(a.module_ident, a.submodule_ident) for a in alarms] == [(0x100, 0xFFFF), (0x100, 0x68)]
    assert unusable(bench) == {PAP, TELEGRAM}
    pap, drive = (a.sequence_number for a in alarms)
    assert controller.prm_end_plug(pap)[0].ok
    assert PrmEndReceived(controller.key, pap) in bench.events()
    assert bench.cm.application_ready(controller.key, 0, pap)
    assert unusable(bench) == {TELEGRAM}
    ((ready, diff),) = controller.confirm_calls()
    assert (ready.block_type, ready.alarm_sequence_number) == (BlockType.APPLICATION_READY_PLUG_REQ, pap)
    assert states(diff) == {(1, 2): (IdentInfo.OK, ArInfo.APPLICATION_READY_PENDING)}
    assert bench.events()[-1] == ApplicationReadyConfirmed(controller.key, pap)
    assert controller.prm_end_plug(drive)[0].ok
    bench.events()
    assert bench.cm.application_ready(controller.key, 0, drive)
    assert unusable(bench) == frozenset()
    ((ready,),) = controller.confirm_calls()
    assert bench.cm.ars[0].module_diff is None


def test_a_wrong_module_is_reported_as_such_and_stays_unusable():
    bench, controller = one_controller()
    bench.cm.plug(1, telegram(0x555, 0x70, 12, 12), 0)
    assert places(controller.pump()) == [
        (AlarmType.PLUG_WRONG_SUBMODULE, *PAP),
        (AlarmType.PLUG_WRONG_SUBMODULE, *TELEGRAM),
    ]
    assert unusable(bench) == {PAP, TELEGRAM}
    diff = bench.cm.ars[0].module_diff
    assert diff.apis[0].modules[0].state == ModuleState.SUBSTITUTE
    assert states(diff)[1, 2] == (IdentInfo.WRONG, ArInfo.OWN)


def test_a_wrong_module_in_a_slot_that_was_empty_at_connect_is_reported_and_its_removal_too():
    bench = Bench()
    bench.plugged.pull(1)
    controller = Controller(bench, 1)
    controller.establish()
    bench.cm.plug(1, telegram(0x555, 0x70, 12, 12), 0)
    assert {a.alarm_type for a in controller.pump()} == {AlarmType.PLUG_WRONG_SUBMODULE}
    bench.cm.pull(1, None, 0)
    assert places(controller.pump()) == [(AlarmType.PULL, DRIVE_API, 1, 0)]
    bench.cm.pull(1, None, 0)
    assert controller.pump() == []


def test_a_substitute_is_usable_and_reported_as_one():
    bench, controller = one_controller()
    bench.cm.pull(1, None, 0)
    controller.pump()
    bench.cm.plug(1, telegram(0x555, 0x70, 12, 12), 0, substitute=True)
    alarms = controller.pump()
    assert {a.alarm_type for a in alarms} == {AlarmType.PLUG}
    for alarm in alarms:
        controller.prm_end_plug(alarm.sequence_number)
        bench.cm.application_ready(controller.key, 0, alarm.sequence_number)
    assert unusable(bench) == frozenset()
    diff = bench.cm.ars[0].module_diff
    assert states(diff) == {(1, 1): (IdentInfo.OK, 0), (1, 2): (IdentInfo.SUBSTITUTE, 0)}


def test_a_substitute_with_other_lengths_is_wrong():
    bench, _ = one_controller()
    bench.cm.plug(1, telegram(0x555, 0x70, 4, 4), 0, substitute=True)
    assert unusable(bench) == {TELEGRAM}


def test_a_connect_to_a_substitute_is_accepted_with_a_difference_that_says_so():
    bench = Bench()
    bench.plugged.plug(1, telegram(0x555, 0x70, 12, 12), substitute=True)
    controller = Controller(bench, 1)
    diff = controller.diff(controller.establish())
    assert states(diff) == {(1, 1): (IdentInfo.OK, 0), (1, 2): (IdentInfo.SUBSTITUTE, 0)}


def test_a_module_pulled_during_start_up_is_reported_by_application_ready_and_by_no_alarm():
    bench = Bench()
    controller = Controller(bench, 1)
    controller.connect()
    bench.cm.pull(1, None, 0)
    assert controller.pump() == []
    controller.prm_end()
    bench.cm.application_ready(controller.key, 0)
    ((_, diff),) = controller.confirm_calls()
    assert diff.apis[0].modules[0].state == ModuleState.NO_MODULE


def test_a_module_pulled_between_application_ready_and_data_is_reported_by_an_alarm_once_data_flow():
    bench = Bench()
    controller = Controller(bench, 1)
    controller.connect()
    controller.prm_end()
    bench.cm.application_ready(controller.key, 0)
    bench.cm.pull(1, None, 0)
    assert controller.pump() == []
    controller.confirm_calls()
    assert controller.pump() == []
    bench.cm.data_received(controller.key, 0)
    assert places(controller.pump()) == [(AlarmType.PULL, DRIVE_API, 1, 0)]


def test_a_plug_that_the_controller_refuses_leaves_the_submodule_unusable():
    bench, controller = one_controller()
    bench.cm.pull(1, 2, 0)
    controller.pump()
    controller.acknowledges = False
    bench.cm.plug(1, None, 0)
    (alarm,) = controller.pump()
    controller.channel.acknowledge(alarm, 0, PnioStatus(0xDA, 0x81, 0x3C, 0))
    controller.pump()
    confirmed = [e for e in bench.events() if isinstance(e, AlarmConfirmed)][-1]
    assert not confirmed.status.ok
    status, _ = controller.prm_end_plug(alarm.sequence_number)
    assert (status.error_code1, status.error_code2) == (0x15, 7)
    assert TELEGRAM in bench.cm.ars[0].pending


def test_prm_end_of_a_plug_that_never_was_is_refused_by_its_sequence_number():
    bench, controller = one_controller()
    status, _ = controller.prm_end_plug(77)
    assert (status.error_code1, status.error_code2) == (0x15, 7)
    assert bench.cm.ars[0].state is CmdevState.DATA


def test_a_second_prm_end_of_one_plug_is_a_state_conflict():
    bench, controller = one_controller()
    bench.cm.pull(1, 2, 0)
    bench.cm.plug(1, None, 0)
    alarm = controller.pump()[-1]
    assert controller.prm_end_plug(alarm.sequence_number)[0].ok
    status, _ = controller.prm_end_plug(alarm.sequence_number)
    assert (status.error_code1, status.error_code2) == (0x40, 6)


def test_prm_end_may_overtake_the_acknowledgement_of_the_plug():
    bench, controller = one_controller(acknowledges=False)
    bench.cm.pull(1, 2, 0)
    (pull,) = controller.pump()
    controller.channel.acknowledge(pull, 0)
    controller.pump()
    bench.cm.plug(1, None, 0)
    (alarm,) = controller.pump()
    assert controller.prm_end_plug(alarm.sequence_number)[0].ok
    assert bench.cm.application_ready(controller.key, 0, alarm.sequence_number)
    controller.channel.acknowledge(alarm, 0)
    controller.pump()
    controller.confirm_calls()
    assert unusable(bench) == frozenset()


def test_a_submodule_pulled_again_is_not_awaited_any_more():
    bench, controller = one_controller()
    bench.cm.pull(1, 2, 0)
    bench.cm.plug(1, None, 0)
    sequence = controller.pump()[-1].sequence_number
    bench.cm.pull(1, 2, 0)
    controller.pump()
    assert controller.prm_end_plug(sequence)[0].error_code2 == 7
    assert bench.cm.ars[0].pending == set()


def test_a_slot_put_back_as_it_was_is_what_the_controller_expects_and_takes_its_parameters():
    bench, controller = one_controller()
    before = bench.plugged.state(1)
    bench.cm.put(1, SlotState(None, held=True, pulled=before.module), 0)
    assert places(controller.pump()) == [(AlarmType.PULL, DRIVE_API, 1, 0)]
    bench.cm.put(1, before, 0)
    assert bench.plugged.state(1) == before
    alarms = controller.pump()
    assert places(alarms) == [(AlarmType.PLUG, *PAP), (AlarmType.PLUG, *TELEGRAM)]
    for alarm in alarms:
        assert controller.prm_end_plug(alarm.sequence_number)[0].ok
        assert bench.cm.application_ready(controller.key, 0, alarm.sequence_number)
    controller.confirm_calls()
    assert unusable(bench) == frozenset()


def test_a_slot_plugged_without_a_change_raises_no_alarm():
    bench, controller = one_controller()
    bench.cm.put(1, bench.plugged.state(1), 0)
    assert controller.pump() == []
    assert unusable(bench) == frozenset()


def test_a_slot_that_is_free_again_gets_what_the_connected_controller_expects():
    bench = Bench()
    other = bench.plugged.state(1)
    bench.plugged.put(1, SlotState(None, held=True))
    controller = Controller(bench, 1)
    controller.establish()
    bench.cm.put(1, other, 0)
    assert (other.module.module_ident, bench.plugged.module(1).module_ident) == (0x101, 0x100)
    assert {a.alarm_type for a in controller.pump()} == {AlarmType.PLUG}


@pytest.mark.parametrize("by_hand", [True, False])
def test_diagnosis_goes_with_the_submodule_that_is_replaced_and_stays_with_the_others(by_hand):
    bench, _ = one_controller()
    for key in (PAP, TELEGRAM):
        bench.cm.diagnosis.add(DiagnosisEntry(*key, error_type=1))
    module = bench.plugged.module(1)
    shorter = replace(module, submodules=module.submodules[:1])
    if by_hand:
        bench.cm.plug(1, shorter, 0)
    else:
        bench.cm.put(1, SlotState(shorter, held=True), 0)
    assert [entry.place for entry in bench.cm.diagnosis] == [PAP]


@given(st.lists(st.sampled_from(["pull", "pull 2", "plug", "plug other", "restore", "follow"]), max_size=6))
def test_what_a_slot_was_can_be_put_back_after_anything(hands):
    plugged = Plugged(DRIVE)
    plugged.pull(1, 2)
    state = plugged.state(1)
    for hand in hands:
        match hand:
            case "pull":
                plugged.pull(1)
            case "pull 2":
                plugged.pull(1, 2)
            case "plug":
                plugged.plug(1)
            case "plug other":
                plugged.plug(1, telegram(0x555, 0x70, 12, 12), substitute=True)
            case "restore":
                plugged.restore(1)
            case "follow":
                plugged.follow(1, 0x100)
    plugged.put(1, state)
    assert plugged.state(1) == state
    plugged.plug(1)
    assert plugged.state(1) == SlotState(DRIVE.default_module(1))


# whose submodules they are


def test_two_controllers_share_a_device_and_the_alarms_go_to_the_owner():
    bench = shared_bench()
    first, second = Controller(bench, 1, dap_only), Controller(bench, 2, drive_only)
    assert first.diff(first.establish()) is None
    assert second.diff(second.establish()) is None
    assert len(bench.cm.alarm(AlarmType.DIAGNOSIS, TELEGRAM, 0)) == 1
    assert first.pump(second) == []
    assert places(second.heard()) == [(AlarmType.DIAGNOSIS, *TELEGRAM)]
    assert [ar.state for ar in bench.cm.ars] == [CmdevState.DATA] * 2


def test_a_third_controller_finds_no_room():
    bench = shared_bench()
    Controller(bench, 1, dap_only).establish()
    Controller(bench, 2, drive_only).establish()
    status, _ = Controller(bench, 3, drive_only).connect()
    assert (status.error_code1, status.error_code2) == (0x40, 4)


def test_a_second_controller_finds_the_firsts_submodules_locked_and_gets_them_when_it_goes():
    bench = shared_bench()
    first, second = Controller(bench, 1), Controller(bench, 2)
    first.establish()
    diff = second.diff(second.establish())
    assert set(states(diff).values()) == {(IdentInfo.OK, ArInfo.LOCKED_BY_IO_CONTROLLER)}
    assert len(states(diff)) == 6
    bench.events()
    assert first.release().ok
    alarms = second.pump()
    assert {a.alarm_type for a in alarms} == {AlarmType.RELEASED}
    assert len(alarms) == 6
    assert set(states(bench.cm.ars[0].module_diff).values()) == {(IdentInfo.OK, ArInfo.APPLICATION_READY_PENDING)}
    for alarm in alarms:
        assert second.prm_end_plug(alarm.sequence_number)[0].ok
        assert bench.cm.application_ready(second.key, 0, alarm.sequence_number)
    second.confirm_calls()
    assert unusable(bench, second.key) == frozenset()


def test_a_supervisor_finds_everything_locked_where_the_controller_does_not_allow_a_takeover():
    bench, _ = one_controller()
    supervisor = Controller(bench, 9, **SUPERVISOR)
    diff = supervisor.diff(supervisor.establish())
    for api in diff.apis:
        for module in api.modules:
            for sub in module.submodules:
                assert (sub.ar_info, sub.state & 7) == (ArInfo.LOCKED_BY_IO_CONTROLLER, 1)
    assert unusable(bench, 1) is None


def test_a_supervisor_takes_over_where_it_may_and_gives_back_in_the_end():
    bench, controller = one_controller(properties=TAKEOVER_ALLOWED)
    supervisor = Controller(bench, 9, drive_only, **SUPERVISOR)
    assert supervisor.diff(supervisor.establish()) is None
    assert places(controller.pump(supervisor)) == [
        (AlarmType.CONTROLLED_BY_SUPERVISOR, *PAP),
        (AlarmType.CONTROLLED_BY_SUPERVISOR, *TELEGRAM),
    ]
    assert unusable(bench, controller.key) == {PAP, TELEGRAM}
    ar = bench.cm.ar(controller.key)
    assert (ar.state, ar.owned & {PAP, TELEGRAM, DAP}) == (CmdevState.DATA, {DAP})
    supervisor.release()
    alarms = controller.pump()
    assert places(alarms) == [(AlarmType.RELEASED, *PAP), (AlarmType.RELEASED, *TELEGRAM)]
    for alarm in alarms:
        controller.prm_end_plug(alarm.sequence_number)
        bench.cm.application_ready(controller.key, 0, alarm.sequence_number)
    controller.confirm_calls()
    assert unusable(bench, controller.key) == frozenset()


def test_a_controller_that_connects_under_a_supervisor_finds_its_submodules_locked():
    bench = Bench()
    Controller(bench, 9, drive_only, **SUPERVISOR).establish()
    controller = Controller(bench, 1)
    diff = controller.diff(controller.establish())
    assert states(diff) == {
        (1, 1): (IdentInfo.OK, ArInfo.LOCKED_BY_IO_SUPERVISOR),
        (1, 2): (IdentInfo.OK, ArInfo.LOCKED_BY_IO_SUPERVISOR),
    }


def test_a_controller_sees_of_a_locked_submodule_who_its_owner_is_now():
    bench = shared_bench()
    first = Controller(bench, 1, drive_only, properties=TAKEOVER_ALLOWED)
    second = Controller(bench, 2, drive_only)
    supervisor = Controller(bench, 8, drive_only, **SUPERVISOR)

    def owner():
        record = parse_blocks(bench.records.read(bench.cm.ar(second.key), 0, 0, 0, 0xE002, 4096, 0))
        return {info for _, info in states(record[0]).values()}

    first.establish()
    second.establish()
    assert owner() == {ArInfo.LOCKED_BY_IO_CONTROLLER}
    supervisor.establish()
    assert owner() == {ArInfo.LOCKED_BY_IO_SUPERVISOR}
    assert supervisor.release().ok
    assert owner() == {ArInfo.LOCKED_BY_IO_CONTROLLER}


def test_a_supervisor_that_is_lost_gives_back_as_well():
    bench, controller = one_controller(properties=TAKEOVER_ALLOWED)
    supervisor = Controller(bench, 9, everything, **SUPERVISOR)
    supervisor.establish()
    controller.pump(supervisor)
    bench.cm.watchdog_expired(supervisor.key, 0)
    assert {a.alarm_type for a in controller.pump(supervisor)} == {AlarmType.RELEASED}


def test_one_supervisor_at_a_time():
    bench, _ = one_controller()
    Controller(bench, 8, drive_only, **SUPERVISOR).establish()
    status, _ = Controller(bench, 9, drive_only, **SUPERVISOR).connect()
    assert (status.error_code1, status.error_code2) == (0x40, 4)


# parameters again


def test_a_controller_parametrises_again_while_data_flow():
    bench, controller = one_controller()
    assert controller.prm_begin(TELEGRAM)[0].ok
    assert len(bench.cm.alarm(AlarmType.PROCESS, TELEGRAM, 0, high=True)) == 1
    assert controller.pump() == []
    assert controller.prm_end()[0].ok
    assert bench.events()[-1] == PrmEndReceived(controller.key)
    assert bench.cm.ars[0].state is CmdevState.DATA
    assert bench.cm.application_ready(controller.key, 0)
    ((ready,),) = controller.confirm_calls()
    assert (ready.block_type, ready.command) == (BlockType.APPLICATION_READY_REQ, ControlCommand.APPLICATION_READY)
    assert bench.events()[-1] == ApplicationReadyConfirmed(controller.key)
    (alarm,) = controller.pump()
    assert (alarm.alarm_type, alarm.high) == (AlarmType.PROCESS, True)
    assert controller.prm_begin(TELEGRAM, DAP)[0].ok


def test_alarms_that_were_not_sent_before_prm_begin_wait_until_the_application_is_ready_again():
    bench, controller = one_controller()
    told = [bench.cm.alarm(AlarmType.PROCESS, TELEGRAM, 0, high=high) for high in (False, False, True, True, False)]
    assert controller.prm_begin(TELEGRAM)[0].ok
    under_way = controller.pump()
    assert [alarm.high for alarm in under_way] == [False, True], "one of each priority is on its way"
    controller.prm_end()
    bench.cm.application_ready(controller.key, 0)
    controller.confirm_calls()
    bench.events()
    assert [alarm.high for alarm in controller.pump()] == [False, True, False]
    assert sorted(event.number for event in bench.events()) == sorted(n for (n,) in told[1:2] + told[3:])


@pytest.mark.parametrize(
    ("keys", "field"),
    [((), 4), (((7, 0, 1),), 5), (((DRIVE_API, 2, 1),), 6), ((TELEGRAM, (DRIVE_API, 1, 9)), 7)],
)
def test_a_prm_begin_for_what_is_not_there_is_refused_by_its_field(keys, field):
    _, controller = one_controller()
    status, _ = controller.prm_begin(*keys)
    assert (status.error_code, status.error_code1, status.error_code2) == (0xDD, 0x19, field)
    assert controller.prm_end()[0].error_code2 == 6


def test_a_prm_begin_without_its_list_is_refused():
    _, controller = one_controller()
    status, _ = controller.control(BlockType.PRM_BEGIN_REQ, ControlCommand.PRM_BEGIN)
    assert (status.error_code1, status.error_code2) == (0x40, 1)
    status, _ = controller.control(
        BlockType.PRM_BEGIN_REQ, ControlCommand.PRM_BEGIN, extra=(SubmoduleList((TELEGRAM,), 0x0200),)
    )
    assert (status.error_code1, status.error_code2) == (0x19, 2)


def test_a_second_prm_begin_is_a_state_conflict_and_after_prm_end_the_end_of_the_ar():
    bench, controller = one_controller()
    controller.prm_begin(TELEGRAM)
    status, _ = controller.prm_begin(TELEGRAM)
    assert (status.error_code1, status.error_code2) == (0x40, 6)
    controller.prm_end()
    status, _ = controller.prm_begin(TELEGRAM)
    assert (status.error_code1, status.error_code2) == (0x40, 6)
    assert isinstance(bench.events()[-1], ArAborted)


def test_module_diffs_are_only_sent_when_something_differs():
    bench = Bench()
    controller = Controller(bench, 1)
    answer = controller.establish()
    assert not any(isinstance(b, ModuleDiffBlock) for b in [controller.diff(answer)])
