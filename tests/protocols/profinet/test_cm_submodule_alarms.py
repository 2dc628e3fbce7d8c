"""Alarms about submodules to the controllers that own them, also where the alarm channel has no room."""

from dataclasses import replace

import pytest
from cm_controllers import DAP, TELEGRAM, Controller, dap_only, one_controller, places, shared_bench, unusable

from pnfarm.protocols.profinet.cm.device.events import AlarmConfirmed, ArAborted
from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem, AlarmSpecifier, AlarmType

MS = 1_000_000
AR_STATE = AlarmSpecifier.AR_DIAGNOSIS_STATE
OF_SUBMODULE = AlarmSpecifier.CHANNEL_DIAGNOSIS | AlarmSpecifier.SUBMODULE_DIAGNOSIS_STATE


def test_an_alarm_carries_its_items_and_is_confirmed_by_its_number():
    bench, controller = one_controller()
    item = AlarmItem(0x8000, bytes.fromhex("80006800900f"))
    assert len(bench.cm.alarm(AlarmType.DIAGNOSIS, TELEGRAM, 0, items=(item,), specifier=0xA800)) == 1
    (alarm,) = controller.pump()
    assert (alarm.items, alarm.specifier) == ((item,), 0xA800)
    (event,) = bench.events()
    assert isinstance(event, AlarmConfirmed)
    assert (event.alarm_type, event.status.ok, event.sequence) == (AlarmType.DIAGNOSIS, True, 0)


def test_every_alarm_says_what_diagnosis_the_submodule_and_the_ar_have():
    bench, controller = one_controller()
    bench.cm.diagnosis.add(DiagnosisEntry(*DAP, error_type=6))
    bench.cm.report_diagnosis(0)
    bench.cm.pull(1, None, 0)
    bench.cm.plug(1, None, 0)
    bench.cm.alarm(AlarmType.RETURN_OF_SUBMODULE, DAP, 0)
    said = [(alarm.alarm_type, alarm.specifier & ~0x7FF) for alarm in controller.pump()]
    assert said == [
        (AlarmType.DIAGNOSIS, OF_SUBMODULE | AR_STATE),
        (AlarmType.PULL, AR_STATE),
        (AlarmType.PLUG, AR_STATE),
        (AlarmType.PLUG, AR_STATE),
        (AlarmType.RETURN_OF_SUBMODULE, OF_SUBMODULE | AR_STATE),
    ]


def test_unacknowledged_alarms_end_the_ar():
    bench, _ = one_controller()
    bench.cm.alarm(AlarmType.PROCESS, TELEGRAM, 0, high=True)
    for step in range(1, 60):
        bench.cm.handle_timeout(step * 100 * MS)
        bench.cm.rta_to_send()
    (event,) = bench.events()
    assert isinstance(event, ArAborted)
    assert event.error_code2 == 0x08


def test_an_ar_without_present_submodules_gets_no_alarms_and_device_access_has_no_channel():
    bench = shared_bench()
    first = Controller(bench, 1, dap_only)
    first.establish()
    assert bench.cm.alarm(AlarmType.DIAGNOSIS, TELEGRAM, 0) == ()
    assert first.pump() == []


def test_more_alarms_than_a_held_channel_keeps_are_counted():
    bench, controller = one_controller()
    controller.prm_begin(TELEGRAM)
    for _ in range(70):
        bench.cm.alarm(AlarmType.PROCESS, TELEGRAM, 0)
    assert bench.cm.dropped["alarm-queue-full"] == 6


def test_alarms_that_a_held_channel_kept_leave_in_order_as_its_queue_has_room():
    bench, controller = one_controller()
    controller.prm_begin(TELEGRAM)
    for number in range(60):
        bench.cm.alarm(AlarmType.PROCESS, TELEGRAM, 0, items=(AlarmItem(1, bytes([number])),))
    controller.prm_end()
    bench.cm.application_ready(controller.key, 0)
    controller.confirm_calls()
    heard = controller.pump()
    assert [alarm.items[0].data[0] for alarm in heard] == list(range(60))
    assert bench.cm.dropped["alarm-queue-full"] == 0


def test_a_plug_that_finds_the_alarm_queue_full_is_reported_when_there_is_room():
    bench, controller = one_controller()
    bench.cm.pull(1, 2, 0)
    controller.pump()
    while bench.cm.alarm(AlarmType.PROCESS, DAP, 0):
        pass
    bench.cm.plug(1, None, 0)
    assert unusable(bench) == {TELEGRAM}
    plugs = [alarm for alarm in controller.pump() if alarm.alarm_type == AlarmType.PLUG]
    assert places(plugs) == [(AlarmType.PLUG, *TELEGRAM)]
    assert controller.prm_end_plug(plugs[0].sequence_number)[0].ok
    assert bench.cm.application_ready(controller.key, 0, plugs[0].sequence_number)
    assert unusable(bench) == frozenset()


def test_a_plug_not_yet_reported_is_dropped_once_the_submodule_is_pulled_again():
    bench, controller = one_controller()
    bench.cm.pull(1, 2, 0)
    controller.pump()
    while bench.cm.alarm(AlarmType.PROCESS, DAP, 0):
        pass
    bench.cm.plug(1, None, 0)
    bench.cm.pull(1, 2, 0)
    assert AlarmType.PLUG not in {alarm.alarm_type for alarm in controller.pump()}
    assert unusable(bench) == {TELEGRAM}


@pytest.mark.parametrize("subslot", [2, None])
def test_a_pull_that_finds_the_alarm_queue_full_is_reported_when_there_is_room(subslot):
    bench, controller = one_controller()
    while bench.cm.alarm(AlarmType.PROCESS, DAP, 0):
        pass
    bench.cm.pull(1, subslot, 0)
    pulls = [alarm for alarm in controller.pump() if alarm.alarm_type != AlarmType.PROCESS]
    assert [(alarm.slot, alarm.subslot) for alarm in pulls] == [(1, subslot or 0)]
    assert pulls[0].alarm_type in {AlarmType.PULL, AlarmType.PULL_MODULE}


@pytest.mark.parametrize("subslot", [2, None])
def test_a_pull_not_yet_reported_is_dropped_once_the_submodule_is_plugged_again(subslot):
    bench, controller = one_controller()
    while bench.cm.alarm(AlarmType.PROCESS, DAP, 0):
        pass
    bench.cm.pull(1, subslot, 0)
    bench.cm.plug(1, None, 0)
    told = [alarm.alarm_type for alarm in controller.pump() if alarm.alarm_type != AlarmType.PROCESS]
    assert set(told) == {AlarmType.PLUG}


def test_a_wrong_submodule_that_finds_the_alarm_queue_full_is_reported_when_there_is_room():
    bench, controller = one_controller()
    while bench.cm.alarm(AlarmType.PROCESS, DAP, 0):
        pass
    module = bench.plugged.module(1)
    wrong = replace(module, submodules=tuple(replace(s, submodule_ident=0x7777) for s in module.submodules))
    bench.cm.plug(1, wrong, 0)
    told = {alarm.alarm_type for alarm in controller.pump()} - {AlarmType.PROCESS}
    assert told == {AlarmType.PLUG_WRONG_SUBMODULE}


def test_an_ended_ar_says_so_after_alarms_have_flown():
    bench, controller = one_controller()
    bench.cm.alarm(AlarmType.PROCESS, TELEGRAM, 0)
    controller.pump()
    bench.cm.watchdog_expired(controller.key, 0)
    (frame,) = bench.cm.rta_to_send()
    assert frame.payload[-4:].hex() == "cf81fd05"
