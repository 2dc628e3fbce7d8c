"""The motors of the HIWIN E1: one that turns, a direct drive, a linear one (manual 6.1 to 6.8, "Applicable Motor")."""

from __future__ import annotations

import re
from math import inf, pi
from pathlib import Path

import pytest
from drives_kit import Drive
from manuals import manual_text
from model_copy import copy_model, rewrite

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model
from pnfarm.drives.description.loader import load_model
from pnfarm.drives.description.motor_kinds import with_motor
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.table.image import IMAGE

PITCH = 32.0
#: rpm of one mm/s.
MM_S = 60.0 / PITCH


def drive_with(kind: str | None, pitch: float | None = None) -> Drive:
    described = with_motor(model("hiwin-e1"), kind, pitch)
    rows = AXIS.allocate(1), IMAGE.allocate(1)
    axis, image = rows[0][0], rows[1][0]
    described.apply_motor(axis)
    store = ParameterStore(described, AxisHandle(axis, image))
    store.power_on()
    return Drive(described, axis, image, store, rows)


@pytest.fixture
def linear() -> Drive:
    return drive_with("linear")


def test_the_usual_motor_turns_and_is_the_model_itself() -> None:
    e1 = model("hiwin-e1")
    assert with_motor(e1, None) is with_motor(e1, "rotary") is e1
    assert e1.pitch == 0.0


def test_6_applicable_motor_of_each_parameter() -> None:
    found = re.findall(r"^Pt No\.\tPt(\w+)(?:.*\n){1,3}?.*Applicable Motor\t(.+)$", manual_text("002"), re.MULTILINE)
    assert len(found) == 16
    for number, motors in found:
        parameter = model("hiwin-e1").resolve(f"Pt{number}")[0]
        assert parameter.motor == {"Rotary": "rotary", "Linear": "linear", "Rotary Linear": ""}[motors]


def test_6_1_the_linear_reference_velocity_counts_100_mm_per_second_at_once(linear: Drive) -> None:
    assert linear.axis.profidrive.settings.velocity_step * 0x4000 == pytest.approx(2000.0 * MM_S)
    linear.store.set("Pt386", 5)
    assert linear.axis.profidrive.settings.velocity_step * 0x4000 == pytest.approx(500.0 * MM_S)


def test_6_2_the_linear_velocity_limit_counts_100_mm_per_second_after_power_on(linear: Drive) -> None:
    assert linear.axis.travel.settings.velocity_limit == pytest.approx(5000.0 * MM_S)
    linear.store.set("Pt385", 3)
    assert linear.axis.travel.settings.velocity_limit == pytest.approx(5000.0 * MM_S)
    linear.store.power_on()
    assert linear.axis.travel.settings.velocity_limit == pytest.approx(300.0 * MM_S)


def test_6_3_torque_limits_are_shares_of_the_rated_torque_and_act_at_once() -> None:
    e1 = drive_with(None)
    assert (e1.axis.torque.settings.limit_positive, e1.axis.torque.settings.limit_negative) == pytest.approx(
        (8 * 1.27, 8 * 1.27)
    )
    e1.store.set("Pt402", 50)
    e1.store.set("Pt403", 100)
    assert (e1.axis.torque.settings.limit_positive, e1.axis.torque.settings.limit_negative) == pytest.approx(
        (0.635, 1.27)
    )


def test_6_3_force_limits_of_a_linear_motor_start_with_30_percent(linear: Drive) -> None:
    newton = PITCH / 1000 / (2 * pi)
    assert linear.axis.torque.settings.limit_positive == pytest.approx(54.0 * newton)
    linear.store.set("Pt484", 800)
    assert linear.axis.torque.settings.limit_negative == pytest.approx(1440.0 * newton)


def test_a_model_without_torque_limits_has_none() -> None:
    axis = AXIS.allocate(1)[0]
    axis.torque.settings.limit_positive = axis.torque.settings.limit_negative = 1.0
    ParameterStore(model("akd"), AxisHandle(axis, IMAGE.allocate(1)[0])).power_on()
    assert (axis.torque.settings.limit_positive, axis.torque.settings.limit_negative) == (inf, inf)


def test_6_8_the_linear_jog_velocity_is_that_of_pt585_and_ramps_follow_it(linear: Drive) -> None:
    assert linear.axis.jog.settings.velocity[0] == pytest.approx(50.0 * MM_S)
    assert linear.axis.jog.settings.acceleration == pytest.approx(500.0 * MM_S)
    linear.store.set("Pt585", 100)
    assert linear.axis.jog.settings.velocity[0] == pytest.approx(100.0 * MM_S)
    assert linear.axis.jog.settings.acceleration == pytest.approx(1000.0 * MM_S)
    assert linear.axis.ramp.settings.position_stop_deceleration == pytest.approx(10_000.0 * MM_S)


def test_6_4_the_linear_quick_stop_counts_from_the_reference_velocity(linear: Drive) -> None:
    linear.store.set("Pt30A", 100)
    assert linear.axis.ramp.settings.quick_stop_deceleration == pytest.approx(20_000.0 * MM_S)


@pytest.mark.parametrize("name", ["Pt316", "Pt317", "Pt402", "Pt403", "Pt533"])
def test_parameters_of_the_other_motor_are_kept_without_effect(linear: Drive, name: str) -> None:
    before = linear.axis.tobytes()
    linear.store.set(name, 7)
    assert linear.store.get(name) == 7
    linear.store.power_on()
    assert linear.axis.tobytes() == before
    with pytest.raises(ParameterError):
        linear.store.set(name, 65536)


@pytest.mark.parametrize("name", ["Pt385", "Pt386", "Pt483", "Pt484", "Pt585"])
def test_linear_parameters_have_no_effect_on_a_motor_that_turns(name: str) -> None:
    e1 = drive_with(None)
    before = e1.axis.tobytes()
    e1.store.set(name, 7)
    e1.store.power_on()
    assert e1.axis.tobytes() == before


def test_6_8_a_direct_drive_jogs_with_60_rpm_by_default() -> None:
    """The note below the table of Pt533."""
    direct, usual = drive_with("direct-drive"), drive_with(None)
    assert (direct.store.get("Pt533"), usual.store.get("Pt533")) == (60, 600)
    assert (direct.axis.jog.settings.velocity[0], direct.axis.jog.settings.acceleration) == (60.0, 600.0)
    assert not direct.store.changed(direct.model.parameters[0x2533])


def test_4_1_pnu_979_shows_a_linear_encoder_and_its_increment_in_nm(linear: Drive) -> None:
    assert linear.store.read(979, 0, 7) == [0x5111, 0x80000001, 100, 0, 0, 0, 0]
    assert drive_with(None).store.read(979, 0, 7) == [0x5111, 0x80000000, 1 << 23, 0, 0, 1, 0]


def test_another_pitch_carries_everything_over() -> None:
    short = drive_with("linear", 16.0)
    assert short.axis.jog.settings.velocity[0] == pytest.approx(50.0 * 60 / 16)
    assert short.axis.sensor.settings.step * 16.0 == pytest.approx(0.0001)
    assert short.axis.load.settings.inertia == pytest.approx(5.0 * (0.016 / (2 * pi)) ** 2)
    assert short.store.read(979, 2) == [100]


@pytest.mark.parametrize(
    ("kind", "pitch", "message"),
    [
        ("liner", None, r"hiwin-e1 has no liner motor; it has rotary, direct-drive, linear"),
        ("direct-drive", 5.0, "turns and has no pitch"),
        (None, 5.0, "turns and has no pitch"),
    ],
)
def test_a_motor_that_the_model_does_not_have_is_reported(kind: str | None, pitch: float | None, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        with_motor(model("hiwin-e1"), kind, pitch)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("model.toml", 'inertia = { value = 5.0, unit = "kg"', 'inertia = { value = 5.0, unit = "kg m^2"', "is 'kg'"),
        ("model.toml", "pitch = { value = 32.0", "pitch = { value = -1", "not a length in mm"),
        ("model.toml", "Pt533 = { value = 60", "Pt533 = { value = 0", r"not within 1\.\.10000"),
        ("model.toml", "Pt533 = { value = 60", "Pt999 = { value = 60", "Pt999: there is no such parameter"),
        ("model.toml", "[motors.linear.firmware]", "[motors.linear.parameter]", "parameter: not one of kind, motor"),
        ("model.toml", "[motors.direct-drive.motor]", "[motors.rotary.motor]", "rotary.motor: the default motor"),
        ("model.toml", "[motors.linear.firmware]", "[motors.linear.defaults]", "overspeed: there is no such parameter"),
        ("model.toml", "homing.velocity = { value = 6.0", "ramp.up = { value = 6.0", "ramp.up: the axis has no"),
        ("parameters.csv", ",power-on,linear", ",power-on,lunar", "motor: 'lunar'"),
        ("parameters.csv", "; of jogging,,linear", "; of jogging,,rotary", "needs the motor linear"),
    ],
)  # fmt: skip
def test_a_mistake_in_the_data_of_a_motor_is_named(tmp_path: Path, file: str, old: str, new: str, message: str) -> None:
    folder = copy_model("hiwin-e1", tmp_path / "model")
    rewrite(folder, file, old, new)
    with pytest.raises(ConfigError, match=message):
        load_model(folder)
