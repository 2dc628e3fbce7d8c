"""Stops, faults, power, homing and jogging of the HIWIN E1 in position mode, bit by bit (manual 5.1, 6.4 to 6.8)."""

import pytest
from e1_plc import (
    ACKNOWLEDGE,
    BOTH_TELEGRAMS,
    FOLLOWS,
    HOME,
    HOMED,
    JOG_BACKWARDS,
    JOG_FORWARDS,
    REACHED,
    RUN,
    START,
    STOPPED,
    E1Plc,
)

# -- stops, faults and power (6.4, 6.5, 5.1) ---------------------------------------------------------------------------


@BOTH_TELEGRAMS
@pytest.mark.parametrize(("milliseconds", "rpm"), [(2, 0.0), (1000, 540.0)])
def test_6_4_the_quick_stop_takes_the_time_of_pt538_and_ends_inhibited(telegram, milliseconds, rpm):
    plc = E1Plc(telegram)
    plc.store.set("Pt538", milliseconds)
    plc.store.set("Pt30A", 5)
    plc.task(50.0)
    assert plc.go()
    plc.wait(300)
    plc.put(STW1=RUN & ~0x0004, wait=104)
    assert plc.rpm == pytest.approx(rpm, abs=15.0)
    plc.wait_for(lambda: plc["ZSW1"] & 0x0047 == 0x0040)
    place = plc.rev
    plc.switch_on(operation=RUN)
    plc.wait(200)
    assert plc.rev == pytest.approx(place, abs=0.01), "the task is gone"


@BOTH_TELEGRAMS
def test_off_brakes_ends_the_task_and_leads_to_ready(telegram):
    plc = E1Plc(telegram)
    plc.task(50.0)
    assert plc.go()
    plc.wait(300)
    plc.put(STW1=RUN & ~0x0001, wait=60)
    assert plc["ZSW1"] & 0x0047 == 0x0001
    plc.put(STW1=RUN, wait=200)
    assert plc.bit(0x0007 | STOPPED)
    assert not plc.bit(REACHED)


@BOTH_TELEGRAMS
def test_a_coast_stop_ends_the_task_and_the_home_position_stays_known(telegram):
    plc = E1Plc(telegram)
    plc.put(STW1=RUN | HOME)
    plc.wait_for(lambda: plc.bit(HOMED))
    plc.put(STW1=RUN)
    plc.task(50.0)
    assert plc.go()
    plc.wait(300)
    plc.put(STW1=RUN & ~0x0002, wait=300)
    assert plc["ZSW1"] & 0x0057 == 0x0040
    assert plc.bit(HOMED | STOPPED)
    plc.switch_on(operation=RUN)
    assert plc.go()


@BOTH_TELEGRAMS
@pytest.mark.parametrize("busy", ["task", "homing", "jog"])
def test_a_fault_ends_what_runs_and_it_stays_ended_after_the_acknowledgement(telegram, busy):
    plc = E1Plc(telegram)
    plc.store.set("Pt533", 300)
    plc.task(50.0)
    begin = {"task": START, "homing": HOME, "jog": JOG_FORWARDS}[busy]
    plc.put(STW1=RUN | begin, wait=200)
    assert plc.rpm > 30.0
    plc.inject("drive-fault", fault=15)
    plc.wait(5)
    assert plc["ZSW1"] & 0x004F == 0x0048
    if telegram == 111:
        assert plc["FAULT_CODE"] == 0x100
        assert plc["POS_ZSW1"] & 0x0C00 == 0
        assert plc["POS_ZSW2"] & 0x8004 == 0
    plc.wait(400)
    plc.put(STW1=0x0400)
    assert plc.put(STW1=0x0400 | ACKNOWLEDGE) & 0x0008 == 0
    plc.switch_on(operation=RUN)
    plc.wait(200)
    assert plc.rpm == pytest.approx(0.0, abs=0.1)
    assert not plc.bit(HOMED)
    if telegram == 111:
        assert plc["FAULT_CODE"] == 0


@BOTH_TELEGRAMS
def test_a_power_cycle_forgets_the_home_position_and_keeps_the_parameters(telegram):
    plc = E1Plc(telegram)
    plc.store.set("Pt533", 300)
    plc.put(STW1=RUN | HOME)
    plc.wait_for(lambda: plc.bit(HOMED))
    plc.inject("power-cycle", off="200ms")
    plc.run(0.1)
    assert not plc.farm.axes[0].powered
    plc.run(1.0)
    plc.connect()
    plc.wait_for(lambda: plc.axis.drive.state == 1)
    plc.put(STW1=0x0400)
    assert not plc.bit(HOMED)
    assert plc.axis.jog.settings.velocity[0] == 300.0
    assert 0.0 <= plc.rev < 1.0, "the encoder knows its angle alone: assumed"
    plc.switch_on(operation=RUN)


# -- homing and jogging (6.7, 6.8) -------------------------------------------------------------------------------------


@BOTH_TELEGRAMS
def test_6_7_homing_runs_while_bit_11_is_set_and_shows_its_end(telegram):
    plc = E1Plc(telegram)
    plc.task(2.25)
    assert plc.go()
    plc.arrive()
    plc.put(STW1=RUN | HOME)
    if telegram == 111:
        assert plc["POS_ZSW1"] == 0x8800
    plc.wait_for(lambda: plc.bit(HOMED))
    assert plc.axis.homing.origin == pytest.approx(3.0), "the next zero mark forwards: assumed"
    plc.wait_for(lambda: plc.bit(REACHED | STOPPED))
    plc.wait(50)
    assert plc.rev == pytest.approx(0.0, abs=0.001)
    if telegram == 111:
        assert plc["POS_ZSW1"] == 0x8000
    plc.put(STW1=RUN, wait=20)
    assert plc.bit(HOMED)


@BOTH_TELEGRAMS
def test_6_7_homing_that_is_stopped_leaves_the_home_position_unset(telegram):
    plc = E1Plc(telegram)
    plc.put(STW1=RUN | HOME, wait=100)
    assert plc.rpm > 0.0
    plc.put(STW1=RUN, wait=200)
    assert plc.bit(STOPPED)
    assert not plc.bit(HOMED)
    plc.task(0.5)
    assert plc.go(), "tasks do not need the home position: the manual does not ask for it"


@BOTH_TELEGRAMS
@pytest.mark.parametrize(("bit", "sign"), [(JOG_FORWARDS, 1), (JOG_BACKWARDS, -1)])
def test_6_8_jogging_runs_with_pt533_along_pt534_and_pt537(telegram, bit, sign):
    plc = E1Plc(telegram)
    plc.store.set("Pt533", 300)
    plc.store.set("Pt534", 200)
    plc.store.set("Pt537", 400)
    plc.put(STW1=RUN | bit, wait=103)
    assert plc.rpm == pytest.approx(sign * 150.0, abs=10.0)
    plc.wait(150)
    assert plc.rpm == pytest.approx(sign * 300.0, abs=1.0)
    assert not plc.bit(STOPPED)
    if telegram == 111:
        assert plc["POS_ZSW1"] == 0x8400
        assert plc["POS_ZSW2"] == (0x0010 if sign > 0 else 0x0020)
        assert plc["NIST_B"] == pytest.approx(sign * 0x40000000 // 10, rel=0.01)
    plc.put(STW1=RUN, wait=203)
    assert plc.rpm == pytest.approx(sign * 150.0, abs=10.0)
    plc.wait_for(lambda: plc.bit(STOPPED))
    assert not plc.bit(REACHED)


@BOTH_TELEGRAMS
def test_6_8_both_jog_bits_stop_and_the_velocity_changes_at_once(telegram):
    plc = E1Plc(telegram)
    plc.put(STW1=RUN | JOG_FORWARDS, wait=300)
    plc.store.set("Pt533", 1200)
    plc.wait(400)
    assert plc.rpm == pytest.approx(1200.0, abs=2.0)
    plc.put(STW1=RUN | JOG_FORWARDS | JOG_BACKWARDS, wait=400)
    assert plc.rpm == pytest.approx(0.0, abs=0.5)


@BOTH_TELEGRAMS
def test_6_8_jogging_and_tasks_do_not_disturb_each_other(telegram):
    plc = E1Plc(telegram)
    plc.task(5.0)
    assert plc.go()
    plc.put(STW1=RUN | JOG_BACKWARDS, wait=200)
    assert plc.rpm > 500.0, "a task is not left for a jog"
    plc.put(STW1=RUN)
    plc.arrive()
    plc.put(STW1=RUN | JOG_FORWARDS, wait=200)
    assert not plc.go(RUN | JOG_FORWARDS), "nor a jog for a task"
    plc.put(STW1=RUN)
    plc.wait_for(lambda: plc.bit(STOPPED))
    assert plc.go()
    plc.arrive()
    assert plc.rev == pytest.approx(5.0, abs=0.01)


@BOTH_TELEGRAMS
def test_6_4_a_following_error_beyond_its_limit_is_position_deviation_overflow(telegram):
    plc = E1Plc(telegram)
    plc.store.set("Pt402", 1)
    plc.store.set("Pt403", 1)
    plc.task(50.0, 3000.0)
    assert plc.go()
    plc.wait_for(lambda: not plc.bit(FOLLOWS))
    plc.wait_for(lambda: bool(plc["ZSW1"] & 0x0008))
    assert plc.store.read(947, 0, 1) == [62]
    assert plc.store.read(945, 0, 1) == [0xD00]
    if telegram == 111:
        assert plc["FAULT_CODE"] == 0xD00
