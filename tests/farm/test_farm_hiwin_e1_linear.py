"""A HIWIN E1 with a linear motor or a direct drive, chosen by the farm file (manual 6.1 to 6.8, "Applicable Motor")."""

from __future__ import annotations

import pytest
from e1_plc import HOME, HOMED, JOG_FORWARDS, REACHED, RUN, START, STOPPED, WHOLE
from hand_plc import HandPlc

from pnfarm.buses.profinet.controller.plan import plan_devices
from pnfarm.errors import ConfigError
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.farm.views.snapshot import drive_snapshot

PITCH = 32.0
#: Control units of a millimetre: 0.1 um each.
MM = 10_000


def mm_s(plc: HandPlc) -> float:
    return float(plc.axis.motor.velocity) * PITCH / 60.0


def mm(plc: HandPlc) -> float:
    return plc["XIST_A"] / MM


def linear(telegram: int, **options) -> HandPlc:
    return HandPlc("hiwin-e1", telegram, **{"motor": "{kind: linear}"} | options)


def test_6_1_telegram_3_scales_the_speed_by_pt386_in_100_mm_per_second():
    plc = linear(3)
    plc.switch_on(operation=0x040F)
    plc.put(NSOLL_B=0x40000000 // 4, wait=400)
    assert mm_s(plc) == pytest.approx(500.0, abs=1.0), "25 % of 20 x 100 mm/s"
    assert plc["NIST_B"] == pytest.approx(0x40000000 // 4, rel=0.01)
    plc.store.set("Pt386", 10)
    plc.wait(300)
    assert mm_s(plc) == pytest.approx(250.0, abs=1.0)
    before = plc["G1_XIST1"]
    plc.wait(100)
    assert plc["G1_XIST1"] - before == pytest.approx(25.0 * MM, rel=0.02), "0.1 um an increment"


def test_6_2_pt385_limits_the_speed_after_power_on():
    plc = linear(3, params="{Pt385: 2}")
    plc.switch_on(operation=0x040F)
    plc.put(NSOLL_B=0x40000000, wait=500)
    assert mm_s(plc) == pytest.approx(200.0, abs=1.0)


def test_6_3_the_force_is_limited_to_30_percent_until_pt483_says_otherwise():
    """180 N rated force (assumed) on 5 kg, less friction."""
    plc = linear(3)
    plc.switch_on(operation=0x040F)
    for percent, start in ((30, 0.0), (60, None)):
        plc.store.set("Pt483", percent)
        before = mm_s(plc) if start is None else start
        plc.put(NSOLL_B=0x40000000, wait=54)
        gained = (mm_s(plc) - before) / 1000.0
        force = 1.8 * percent
        assert gained == pytest.approx((force - 5.0) / 5.0 * 0.052, rel=0.08)


@pytest.mark.parametrize("telegram", [9, 111])
def test_6_6_1_a_task_counts_control_units_of_the_scale(telegram):
    plc = linear(telegram)
    mode = {"SATZANW": 0x8000, "MDI_MOD": 1} if telegram == 9 else {"POS_STW1": 0x8100, "OVERRIDE": WHOLE}
    plc.put(MDI_TARPOS=100 * MM, MDI_VELOCITY=200 * MM * 60 // 1000, MDI_ACC=WHOLE, MDI_DEC=WHOLE, **mode)
    plc.switch_on(operation=RUN)
    plc.put(STW1=RUN | START, wait=440)
    assert mm_s(plc) == pytest.approx(200.0, abs=0.5)
    plc.wait_for(lambda: plc["ZSW1"] & (REACHED | STOPPED) == REACHED | STOPPED)
    plc.wait(50)
    assert mm(plc) == pytest.approx(100.0, abs=0.01)
    shown = drive_snapshot(plc.farm, plc.farm.axes[0], plc.world.now)
    assert shown["pitch_millimetres"] == PITCH
    assert shown["position_revolutions"] * PITCH == pytest.approx(100.0, abs=0.01)


@pytest.mark.parametrize("telegram", [9, 111])
def test_6_7_and_6_8_homing_and_jogging_by_pt585(telegram):
    plc = linear(telegram)
    plc.switch_on(operation=RUN)
    plc.put(STW1=RUN | JOG_FORWARDS, wait=300)
    assert mm_s(plc) == pytest.approx(50.0, abs=0.5)
    plc.store.set("Pt585", 100)
    plc.wait(300)
    assert mm_s(plc) == pytest.approx(100.0, abs=0.5)
    plc.put(STW1=RUN, wait=300)
    plc.put(STW1=RUN | HOME, wait=1)
    plc.wait_for(lambda: bool(plc["ZSW1"] & HOMED))
    assert plc.axis.motor.position == pytest.approx(round(float(plc.axis.motor.position)), abs=0.01), (
        "a mark at each pitch: assumed"
    )
    assert mm(plc) == pytest.approx(0.0, abs=0.05)


def test_6_8_a_direct_drive_jogs_with_60_rpm():
    plc = HandPlc("hiwin-e1", 9, motor="{kind: direct-drive}")
    plc.switch_on(operation=RUN)
    plc.put(STW1=RUN | JOG_FORWARDS, wait=400)
    assert plc.axis.motor.velocity == pytest.approx(60.0, abs=0.2)
    assert drive_snapshot(plc.farm, plc.farm.axes[0], plc.world.now)["pitch_millimetres"] is None


def test_load_and_motor_of_the_farm_file_are_in_the_units_of_the_motor():
    plc = linear(
        3,
        motor="{kind: linear, pitch: 20, max_velocity: 100, torque_constant: 30, rated_torque: 90, encoder_steps: 500}",
        load="{inertia: 10, torque: 8}",
    )
    assert plc.axis.load.settings.inertia * (2 * 3.14159265 / 0.02) ** 2 == pytest.approx(10.0)
    assert plc.axis.motor.settings.torque_constant * 2 * 3.14159265 / 0.02 == pytest.approx(30.0)
    assert plc.axis.torque.settings.rated * 2 * 3.14159265 / 0.02 == pytest.approx(90.0)
    assert plc.axis.torque.settings.limit_positive == pytest.approx(0.3 * plc.axis.torque.settings.rated)
    assert plc.axis.motor.settings.encoder_steps == pytest.approx(10_000.0)
    assert plc.axis.load.settings.torque * 2 * 3.14159265 / 0.02 == pytest.approx(8.0)
    assert plc.axis.motor.settings.max_velocity == pytest.approx(300.0)


def test_the_built_in_controller_knows_the_linear_motors_steps():
    text = (
        "farm: f\nlink: {kind: memory}\ndrives: [{name: a, model: e1, ip: 10.0.0.1/24, motor: {kind: linear}}]\n"
        "controller: {name: plc, ip: 10.0.0.9/24, cycle: 1ms, telegram: 3}\n"
    )
    config = parse_farm(text)
    drives = expand(config)
    (plan,) = plan_devices(config.controller, drives, [model_of(drive) for drive in drives])
    assert plan.steps.velocity_step * 0x4000 == pytest.approx(2000.0 * 60 / PITCH)


@pytest.mark.parametrize(
    ("motor", "told"),
    [
        ("{kind: linaer}", r"hiwin-e1 has no motor 'linaer'.*did you mean"),
        ("{kind: direct-drive, pitch: 5}", "a motor that turns"),
        ("{pitch: 5}", "a motor that turns"),
        ("{kind: linear, pitch: 0}", "pitch"),
    ],
)
def test_a_motor_that_the_drive_does_not_have_is_reported_with_its_place(motor, told):
    text = f"farm: f\nlink: {{kind: memory}}\ndrives: [{{name: a, model: e1, motor: {motor}}}]\n"
    with pytest.raises(ConfigError, match=told):
        parse_farm(text)
