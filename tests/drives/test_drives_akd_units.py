"""Units and scales of the AKD of manual edition M: positions, velocities, ramps (5.10, 5.12, 6.1, 6.2, 6.5)."""

from __future__ import annotations

import pytest
from akd_kit import NAME, E, Positioning, refused
from drives_kit import Drive, Running, new_drive

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model
from pnfarm.drives.description.behaviour import with_behaviour
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.firmware.axis import AXIS
from pnfarm.table.image import IMAGE
from pnfarm.table.signals import (
    ITIST_GLATT,
    MDI_ACC,
    MDI_DEC,
    MDI_VELOCITY,
    XIST_A,
)

# 5.10, 5.12: position mode in the units of the manual


def test_5_12_1_mdi_velocity_of_2_to_the_32_is_12000_rpm() -> None:
    drive = Positioning()
    drive.image.received[MDI_VELOCITY] = 2**32 // 10 - (1 << 32 if 2**32 // 10 >> 31 else 0)
    drive.move(65536 * 1000, 500)
    assert drive.axis.motor.velocity == pytest.approx(1200.0, abs=1.0)


def test_5_12_1_60_rpm_are_163_steps_of_nsoll_a(akd: Drive) -> None:
    assert int(60 / 12000 * 2**15) == 163
    assert akd.axis.profidrive.settings.velocity_step * 2**15 == pytest.approx(12000, rel=3e-4)


def test_5_12_2_positions_have_65536_counts_a_turn_until_pnu_1002_says_otherwise() -> None:
    drive = Positioning()
    drive.move(2 * 65536)
    assert drive.axis.motor.position == pytest.approx(2.0, abs=0.002)
    assert drive.image.sent[XIST_A] == pytest.approx(2 * 65536, abs=100)
    drive.drive.store.write(1002, 0, [20])
    drive.move(-(1 << 20))
    assert drive.axis.motor.position == pytest.approx(-1.0, abs=0.002)


@pytest.mark.parametrize("steps", [1, 2, 40, 65535])
def test_5_12_3_mdi_acc_and_mdi_dec_are_parts_of_50_million_rpm_per_second(steps: int) -> None:
    drive = Positioning()
    drive.image.received[MDI_ACC], drive.image.received[MDI_DEC] = steps, steps
    drive.run(1)
    assert drive.axis.asked.acceleration == pytest.approx(steps * 50_000_000 / 65536, rel=1e-4)
    assert drive.axis.asked.deceleration == drive.axis.asked.acceleration
    # the table's own figures are rounded: 763 for 1, 1536 for 2
    table = {1: 763, 2: 1536}
    assert drive.axis.asked.acceleration == pytest.approx(table.get(steps, steps * 763), rel=0.01)


@pytest.mark.parametrize(
    ("scaling", "mdi_acc", "rpm_per_second"), [(763, 2, 1526), (1, 400, 400), (2, 400, 800), (20, 500, 10_000)]
)
def test_5_12_3_pnu_1008_scales_mdi_acc_and_mdi_dec_as_in_the_makers_examples(
    scaling: int, mdi_acc: int, rpm_per_second: int
) -> None:
    """Kollmorgen developer network, AKD PROFINET PN.ACCSCALING examples; 6.1 leaves these two signals out."""
    drive = Positioning()
    drive.image.received[MDI_ACC], drive.image.received[MDI_DEC] = mdi_acc, 2 * mdi_acc
    drive.drive.store.write(1008, 0, [scaling])
    drive.run(1)
    assert drive.axis.asked.acceleration == rpm_per_second
    assert drive.axis.asked.deceleration == 2 * rpm_per_second
    drive.axis.profidrive.settings.task_ramps_scaled = 0
    drive.run(1)
    assert drive.axis.asked.acceleration == pytest.approx(mdi_acc * 50_000_000 / 65536), "the other reading, of 6.1"


def test_5_12_4_minus_182_are_minus_0_1_a(running: Running) -> None:
    running.image.sent[ITIST_GLATT] = 0x10000 - 182
    assert running.drive.store.read(52) == [-182]
    assert 9 / 2**14 * running.drive.store.read(52)[0] == pytest.approx(-0.1, abs=0.001)


def test_5_10_1_the_following_error_window_is_bit_8() -> None:
    drive = Positioning()
    assert drive.send(0x043F) & 0x0100
    drive.drive.store.set("PL.ERRWTHRESH", 0)
    drive.axis.load.settings.torque = 0.3
    drive.run(3)
    assert not drive.send(0x043F) & 0x0100, "5.5: in range, against 5.10.1, which has it set beyond"


def test_a_task_beyond_software_limits_is_refused_and_a_limit_is_warned_of() -> None:
    drive = Positioning()
    store = drive.drive.store
    store.set("SWLS.LIMIT0", -65536)
    store.set("SWLS.LIMIT1", 2 * 65536)
    store.set("SWLS.EN", 3)
    drive.move(3 * 65536, 100)
    assert not drive.send(0x043F) & 0x5000
    assert drive.axis.motor.position == pytest.approx(0.0, abs=1e-3)
    assert drive.move(2 * 65536 - 10) & 0x0480 == 0x0480, "5.10.1: a warning is bit 7"
    assert store.get("DRV.WARNING1") == 107


@pytest.mark.parametrize(
    ("raw", "step", "most"),
    [(1, 0.0002, 7.3), (100, 0.022, 732), (1000, 0.224, 7324), (1638, 0.366, 11997), (2000, 0.447, 14648)],
)
def test_6_5_velscaling_has_the_steps_and_the_largest_velocities_of_its_table(
    akd: Drive, raw: int, step: float, most: float
) -> None:
    akd.store.set("PN.VELSCALING", raw)
    assert akd.axis.profidrive.settings.velocity_step == pytest.approx(step, abs=6e-4)
    assert akd.axis.profidrive.settings.velocity_step * 32767 == pytest.approx(most, rel=5e-3)


@pytest.mark.parametrize(("raw", "most"), [(1, 65_535), (100, 6_553_500), (763, 50_003_205), (14_648, 959_956_680)])
def test_6_1_accscaling_times_the_signal_is_the_acceleration(akd: Drive, raw: int, most: int) -> None:
    akd.store.set("PN.ACCSCALING", raw)
    assert akd.store.read(1008) == [raw]
    akd.store.write(1006, 0, [65535])
    akd.store.write(1007, 0, [1])
    assert akd.axis.jog.settings.acceleration == pytest.approx(most, rel=1e-4)
    assert (akd.axis.jog.settings.deceleration, akd.axis.profidrive.settings.acceleration_step) == (raw, raw)


def test_6_1_and_6_5_limits_and_defaults(akd: Drive) -> None:
    for name, least, most, default in (("PN.ACCSCALING", 1, 14_648, 763), ("PN.VELSCALING", 1, 2000, 1638)):
        assert akd.store.get(name) == default
        refused(E.LIMIT_EXCEEDED, akd.store, name, least - 1)
        refused(E.LIMIT_EXCEEDED, akd.store, name, most + 1)


def test_6_2_posscale_limits_default_and_the_positions_that_it_scales(akd: Drive) -> None:
    assert akd.store.get("PN.POSSCALE") == 1000
    refused(E.LIMIT_EXCEEDED, akd.store, "PN.POSSCALE", 0)
    refused(E.LIMIT_EXCEEDED, akd.store, "PN.POSSCALE", 1_000_001)
    scaled = {p.name for p in akd.model.parameters.values() if p.scale == "position"}
    assert {"PL.FB", "PL.CMD", "PL.ERR", "HOME.P", "HOME.DIST", "SWLS.LIMIT0", "MT.P", "CAP0.PLFB", "PLS.P8"} <= scaled
    assert not any(akd.model.resolve(name)[0].pnu < 2000 for name in scaled)


def test_6_2_a_revolution_is_65536_by_default_in_position_parameters_as_in_mdi_tarpos(akd: Drive) -> None:
    """UNIT.PROTARY is 4, counts of 16 bits, and a value in thousandths divided by 1000 is the value."""
    assert (akd.store.get("UNIT.PROTARY"), akd.store.get("PN.POSSCALE")) == (4, 1000)
    akd.axis.motor.position = 1.0
    assert akd.store.get("PL.FB") == 65536
    for unit, numbers in ((0, 2**32), (1, 6), (2, 360), (3, 5), (4, 65536)):
        akd.store.set("UNIT.PROTARY", unit)
        assert akd.store.get("PL.FB") == (numbers if numbers < 2**31 else 0), "a double word, which wraps"
    akd.store.set("UNIT.PROTARY", 2)
    akd.store.set("PN.POSSCALE", 1)
    assert akd.store.get("PL.FB") == 360_000, "thousandths of a degree"


def test_6_2_the_other_reading_is_the_formula_as_it_stands() -> None:
    literal = with_behaviour(model(NAME), {"position-parameters": "literal"})
    axis = AXIS.allocate(1)[0]
    store = ParameterStore(literal, AxisHandle(axis, IMAGE.allocate(1)[0]))
    store.power_on()
    axis.motor.position = 100.0
    assert store.get("PL.FB") == round(100 * 65536 / 1000)
    assert store.get("SWLS.LIMIT1") == round(1_048_576 / 1000), "defaults are places, whatever they are counted in"
    assert (axis.travel.settings.high, axis.positioning.settings.following_window) == (16.0, 6554 / 65536)
    store.set("PN.POSSCALE", 1)
    assert store.get("PL.FB") == 100 * 65536


def test_6_2_default_positions_stay_where_a_farm_file_gives_another_unit() -> None:
    drive = new_drive(NAME)
    places = (
        float(drive.axis.travel.settings.high),
        float(drive.axis.positioning.settings.target_window),
        float(drive.axis.homing.settings.lag),
    )
    drive.store.commission({"UNIT.PROTARY": 2, "PN.POSSCALE": 1, "SWLS.LIMIT0": -720_000})
    drive.store.power_on()
    assert (
        drive.axis.travel.settings.high,
        drive.axis.positioning.settings.target_window,
        drive.axis.homing.settings.lag,
    ) == places
    assert drive.axis.travel.settings.low == -2.0
    assert drive.store.get("SWLS.LIMIT1") == 16 * 360_000
    drive.store.set("DRV.RSTVAR", 1)
    assert (drive.axis.travel.settings.high, drive.store.get("SWLS.LIMIT1")) == (16.0, 1_048_576)


def test_6_2_the_numbers_follow_the_scale_and_the_positions_stay(akd: Drive) -> None:
    akd.store.set("HOME.P", 65536)
    akd.store.set("PLS.P1", -2000)
    place = float(akd.axis.homing.settings.position)
    window = float(akd.axis.positioning.settings.target_window)
    akd.store.set("PN.POSSCALE", 500)
    assert akd.store.get("HOME.P") == 2 * 65536
    assert akd.store.get("PLS.P1") == -4000
    akd.store.set("PN.POSSCALE", 1_000_000)
    assert akd.store.get("HOME.P") == round(65536 / 1000)
    akd.store.set("PN.POSSCALE", 1000)
    assert akd.store.get("HOME.P") == 65536, "nothing was lost on the way"
    assert (akd.axis.homing.settings.position, akd.axis.positioning.settings.target_window) == (place, window)
    akd.store.set("UNIT.PROTARY", 2)
    assert akd.store.get("HOME.P") == 360


def test_6_2_a_value_written_after_a_new_scale_counts_in_it(akd: Drive) -> None:
    akd.store.set("PN.POSSCALE", 100_000)
    akd.store.set("HOME.P", 655)
    assert akd.axis.homing.settings.position == pytest.approx(1.0, abs=1e-3)
    akd.store.set("PN.POSSCALE", 1000)
    assert akd.store.get("HOME.P") == 65_500


def test_every_position_parameter_keeps_its_position_over_nvsave_and_a_power_cycle() -> None:
    drive = new_drive(NAME)
    drive.store.set("PN.POSSCALE", 100)
    drive.store.set("SWLS.LIMIT0", -655_360)
    drive.store.set("DRV.NVSAVE", 1)
    drive.store.power_on()
    assert drive.axis.travel.settings.low == pytest.approx(-1.0, abs=1e-6)
    assert drive.store.get("SWLS.LIMIT0") == -655_360


@pytest.mark.parametrize(("unit", "pin", "pout", "raw"), [(2, 1, 1, -90), (3, 1, 2**32 - 1, 2**31 - 1)])
def test_6_2_home_set_makes_the_position_home_p_in_every_unit(unit: int, pin: int, pout: int, raw: int) -> None:
    """Degrees, and the largest unit: whatever the fieldbus writes is a position."""
    drive = Positioning(homed=False)
    for name, value in (("UNIT.PIN", pin), ("UNIT.POUT", pout), ("UNIT.PROTARY", unit), ("HOME.P", raw)):
        drive.drive.store.set(name, value)
    drive.drive.store.set("HOME.SET", 1)
    assert drive.send(0x043F, milliseconds=2) & 0x0800
    assert drive.drive.store.get("PL.FB") == pytest.approx(raw, abs=1)
