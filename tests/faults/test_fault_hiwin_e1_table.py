"""Every fault of the HIWIN E1's table 5.1.1, raised in the run, seen by all its ways, and acknowledged."""

from __future__ import annotations

import pytest
from e1_plc import ACKNOWLEDGE, JOG_FORWARDS, RUN, E1Plc
from hand_plc import HandPlc

from pnfarm.drives.catalogue import model
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.table.axis_codes import REACTION_COAST
from pnfarm.table.signals import STW2

E1 = model("hiwin-e1")
FAULTS = [fault for fault in E1.faults.values() if not fault.warning]


@pytest.fixture(scope="module")
def plc() -> E1Plc:
    return E1Plc(111)


def run(plc: E1Plc) -> None:
    """Jogging, so that the reaction can be seen."""
    if plc.axis.drive.state != 4:
        plc.switch_on(operation=RUN)
    plc.put(STW1=RUN | JOG_FORWARDS)
    plc.wait_for(lambda: plc.rpm > 500.0)


def acknowledge(plc: E1Plc) -> int:
    plc.put(STW1=0x0400)
    return plc.put(STW1=0x0400 | ACKNOWLEDGE)


def test_the_table_has_56_faults():
    assert len(FAULTS) == 56
    assert len({fault.word for fault in FAULTS}) == len({fault.name for fault in FAULTS}) == 56


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name.split()[0])
def test_table_5_1_1_each_fault_stops_the_drive_is_reported_and_can_be_acknowledged(plc, fault):
    """ZSW1.3, FAULT_CODE, PNU 944, 945, 947, the name on the panel; which reaction each has is assumed."""
    run(plc)
    changes = plc.store.read(944)[0]
    plc.inject("drive-fault", fault=fault.name)
    plc.wait(4)
    assert plc["ZSW1"] & 0x0048 == (0x0048 if fault.reaction == REACTION_COAST else 0x0008)
    assert plc["FAULT_CODE"] == fault.word
    assert plc.store.read(944) == [changes + 1]
    assert (plc.store.read(945)[0], plc.store.read(947)[0]) == (fault.word, fault.number)
    shown = drive_snapshot(plc.farm, plc.farm.axes[0], plc.world.now)
    assert shown["fault"] == {"number": fault.number, "name": fault.name}
    assert plc["ZSW1"] & 0x0080 == 0
    assert plc["WARN_CODE"] == 0
    plc.wait_for(lambda: plc["ZSW1"] & 0x004F == 0x0048)
    assert plc.put(STW1=RUN) & 0x0047 == 0x0040, "no way on without acknowledgement"
    assert acknowledge(plc) & 0x0008 == 0
    assert plc["FAULT_CODE"] == 0
    assert (plc.store.read(945, 0)[0], plc.store.read(945, 8)[0]) == (0, fault.word)
    assert plc.store.read(944) == [changes + 2]


@pytest.mark.parametrize("wanted", ["15", 15, "AL.100 Overcurrent detected"])
def test_a_fault_is_named_by_its_number_or_by_its_name(wanted):
    assert E1.fault(wanted).word == 0x100


def test_952_the_buffer_keeps_eight_situations_and_forgets_them_when_0_is_written():
    plc = E1Plc(111)
    plc.store.events()
    for fault in FAULTS[:10]:
        plc.inject("drive-fault", fault=fault.number)
        plc.wait(4)
        assert acknowledge(plc) & 0x0008 == 0
    kept = [number for number in plc.store.read(947, 0, 64) if number]
    assert kept == [fault.number for fault in FAULTS[9:2:-1]]
    assert plc.store.read(952) == [10]
    plc.store.write(952, 0, [0])
    plc.wait(4)
    assert plc.store.read(947, 0, 64) == plc.store.read(945, 0, 64) == [0] * 64
    assert plc.store.read(952) == [0]


def test_several_faults_are_one_situation_and_fault_code_shows_the_oldest():
    plc = E1Plc(111)
    for number in (17, 18, 19):
        plc.inject("drive-fault", fault=number, hold=True)
        plc.wait(4)
    assert plc["FAULT_CODE"] == 0x400
    assert plc.store.read(947, 0, 4) == [17, 18, 19, 0]
    assert plc.store.read(945, 0, 4) == [0x400, 0x410, 0x510, 0]
    assert plc.store.read(952) == [1]
    assert acknowledge(plc) & 0x0008
    plc.clear()
    assert acknowledge(plc) & 0x0008 == 0
    assert plc["FAULT_CODE"] == 0
    assert plc.store.read(947, 8, 4) == [17, 18, 19, 0]


def test_a_coast_fault_overrides_the_controlled_stop_of_another():
    """AL.FB1 brakes (assumed); a fault that coasts takes the power stage off at once."""
    plc = E1Plc(111, params="{Pt538: 5000}")
    run(plc)
    plc.inject("drive-fault", fault=73)
    plc.wait(20)
    assert plc["ZSW1"] & 0x004B == 0x000B, "braking, the pulses are on"
    assert plc["ZSW2"] & 0x0800
    plc.inject("drive-fault", fault=15)
    plc.wait(4)
    assert plc["ZSW1"] & 0x004B == 0x0048
    assert not plc["ZSW2"] & 0x0800


def test_1_3_a_power_cycle_ends_a_fault_without_an_acknowledgement_and_a_cause_that_stays_brings_it_back():
    plc = E1Plc(111)
    for hold in (False, True):
        plc.inject("drive-fault", fault=18, hold=hold)
        plc.wait(4)
        plc.inject("power-cycle", off="100ms")
        plc.run(1.0)
        plc.connect()
        plc.wait_for(lambda: plc.axis.drive.state == 1)
        plc.put(STW1=0x0400)
        assert bool(plc["ZSW1"] & 0x0008) == hold
        assert plc["FAULT_CODE"] == (0x410 if hold else 0)
        assert 18 in plc.store.read(947, 8, 56)


@pytest.mark.parametrize("telegram", [9, 111])
def test_a_lost_connection_brakes_with_pt538_and_leaves_the_fieldbus_alarm_for_the_next_one(telegram):
    """AL.FB1: that lost cyclic data raise it, and that it brakes, is assumed."""
    plc = E1Plc(telegram, params="{Pt538: 1000}")
    run(plc)
    plc.wait(100)
    plc.inject("link-down")
    plc.run(0.1)
    assert 500.0 < plc.rpm < 600.0
    plc.run(1.5)
    assert plc.rpm == pytest.approx(0.0, abs=0.1)
    plc.clear()
    plc.connect()
    plc.put(STW1=0x0400)
    assert plc["ZSW1"] & 0x0048 == 0x0048
    assert plc.store.read(945, 0, 1) == [0xFB1]
    if telegram == 111:
        assert plc["FAULT_CODE"] == 0xFB1
    assert acknowledge(plc) & 0x0008 == 0
    plc.switch_on(operation=RUN)
    plc.wait(100)
    assert plc.rpm == pytest.approx(0.0, abs=0.1), "the jog of the old connection is not remembered"


@pytest.mark.parametrize("telegram", [3, 9, 111])
def test_4_1_pnu_925_frames_without_sign_of_life_are_the_fieldbus_alarm(telegram):
    """Table 3.4.1, 4.1: five by default; AL.FB1 and counting as in the profile are assumed."""
    plc = HandPlc("hiwin-e1", telegram)
    for tolerance in (5, 2, 20):
        plc.store.set(925, tolerance)
        life = plc.life
        for _ in range(tolerance + 3):
            plc.image.sent[STW2] = life << 12
            plc.run(0.001)
        assert plc["ZSW1"] & 0x0008
        assert plc.store.read(947, 0, 1) == [73]
        plc.wait(20)
        plc.put(STW1=0x0400)
        assert plc.put(STW1=0x0400 | ACKNOWLEDGE) & 0x0008 == 0


def test_4_1_one_failed_sign_of_life_less_than_pnu_925_is_no_fault():
    plc = HandPlc("hiwin-e1", 3)
    life = plc.life
    for _ in range(4):
        plc.image.sent[STW2] = life << 12
        plc.run(0.001)
    plc.wait(60)
    assert plc["ZSW1"] & 0x0008 == 0
    assert 4 <= plc.axis.life.errors <= 5


def test_alarms_that_the_drive_sees_itself():
    """AL.510 beyond the overspeed of the motor, AL.720 by its heat; their thresholds are assumed."""
    plc = E1Plc(111)
    plc.axis.motor.thermal_load = 1.2
    plc.wait(5)
    assert plc["FAULT_CODE"] == 0x720
    plc.axis.motor.thermal_load = 0.0
    assert acknowledge(plc) & 0x0008 == 0
    plc.axis.motor.velocity = 9000.0
    plc.wait(5)
    assert plc["FAULT_CODE"] == 0x510


def test_3_16_the_motors_heat_is_the_i2t_warning_before_it_is_the_overload():
    """MELDW.7; its threshold is assumed."""
    plc = E1Plc(111)
    plc.axis.motor.thermal_load = 0.9
    plc.wait(5)
    assert (plc["MELDW"] & 0x00C0, plc["WARN_CODE"], plc["ZSW1"] & 0x0088) == (0x0040, 0x911, 0x0080)
    plc.inject("drive-warning", warning="motor-overload-warning")
    plc.wait(5)
    assert (plc["MELDW"] & 0x00C0, plc["WARN_CODE"]) == (0, 0x910), "both stand, one that was raised in front"
    plc.clear()
    plc.wait(5)
    assert plc["WARN_CODE"] == 0x911
    plc.axis.motor.thermal_load = 0.5
    plc.wait(5)
    assert (plc["MELDW"] & 0x00C0, plc["WARN_CODE"], plc["ZSW1"] & 0x0080) == (0x00C0, 0, 0)


def test_a_stalled_axis_heats_its_motor_until_it_warns_and_trips():
    """A load above the rated torque: I2t warning, then AL.720."""
    plc = E1Plc(111)
    plc.axis.load.settings.torque = 1.8
    told = plc.wait_for(lambda: bool(plc["WARN_CODE"]), 120_000)
    tripped = plc.wait_for(lambda: bool(plc["FAULT_CODE"]), 120_000)
    assert plc["FAULT_CODE"] == 0x720
    assert told > 10_000
    assert tripped > 1_000
