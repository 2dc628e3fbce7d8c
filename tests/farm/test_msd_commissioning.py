"""The Moog MSD over frames, as an engineer commissions it: chapters 10.2, 10.7, 10.8, 11.4, 14 and 16 of its manual."""

from __future__ import annotations

import struct

import pytest
from msd_hand import MsdHand
from virtual_line import VirtualLine

from pnfarm.drives.parameters.factor_group import float_bits
from pnfarm.errors import ConfigError
from pnfarm.table.channel import STATUS_RUN

TASKS = 0x043F
START = 0x0040
REV = 65536
GAIN = 30_000


def current(line: MsdHand) -> float:
    """P-0700 as it comes in: a float32."""
    (value,) = struct.unpack(">f", struct.pack(">i", line.see("ACT_CURRENT")))
    return float(value)


# 14.1


def position_line() -> MsdHand:
    """Steps 1 and 2 of 14.1.1, the mapping of tables 14.1 and 14.2, and the four parameters."""
    line = MsdHand(telegram=105)
    assert line.store.get("P-0922") == 105
    line.map([967, 1275, 1275, 1277, 1277, 1278, 1279], [968, 1276, 1276, 1271, 1271, 700, 700])
    for name, value in (("P-0300", 3), ("P-0301", 0), ("P-0159", 7), ("P-0165", 9)):
        line.store.set(name, value)
    return line


def test_14_1_1_position_control_with_telegram_105() -> None:
    line = position_line()
    assert line.store.read(915, 0, 8) == [967, 1275, 1275, 1277, 1277, 1278, 1279, 0]
    assert line.store.read(916, 0, 8) == [968, 1276, 1276, 1271, 1271, 700, 700, 0]
    line.enable(TASKS)
    line.send(TARPOS_A=2 * REV, VELOCITY_A=600, DRV_ACC=100, DRV_DEC=50)
    line.send(0.05, STW1=TASKS | START)
    assert current(line) > 0.2, "it accelerates"
    line.run(0.1)
    assert line.see("ACT_SPEED") == pytest.approx(600, abs=3)
    line.until(lambda: line.see("ZSW1") & 0x2400 == 0x2400)
    assert line.see("XIST_A") == pytest.approx(2 * REV, abs=100)
    # a falling edge takes the next one
    line.send(TARPOS_A=-REV)
    line.send(STW1=TASKS)
    line.until(lambda: line.see("ZSW1") & 0x2400 == 0x2400)
    assert line.see("XIST_A") == pytest.approx(-REV, abs=100)


def test_14_1_1_without_its_parameters_the_set_points_do_nothing() -> None:
    """These settings are a prerequisite for the communication between master and drive."""
    line = position_line()
    line.store.set("P-0165", 0)
    line.enable(TASKS)
    line.send(TARPOS_A=2 * REV, VELOCITY_A=600, DRV_ACC=100, DRV_DEC=100)
    line.send(0.5, STW1=TASKS | START)
    assert line.see("XIST_A") == 0
    other = position_line()
    other.store.set("P-0159", 0)
    for word in (0x0476, 0x0477, TASKS):
        other.send(STW1=word)
    assert other.see("ZSW1") & 0x0247 == 0x0040


# 14.2


def test_14_2_speed_control_with_telegram_102() -> None:
    """Tables 14.3 and 14.4, and the steps of 14.2.1: scale, write the set point, switch on."""
    line = MsdHand(telegram=102)
    assert line.store.get("P-0922") == 102
    line.map([967, 1270, 1270, 1278, 1279], [968, 1271, 1271])
    for name, value in (("P-0300", 2), ("P-0301", 0), ("P-0159", 7), ("P-0165", 9)):
        line.store.set(name, value)
    # one unit is a tenth of a revolution per minute
    line.store.set("P-0274", int.from_bytes(struct.pack(">f", 0.1), "big"))
    line.send(REF_SPEED=6000, DRV_ACC=10, DRV_DEC=20)
    line.enable()
    line.run(0.5)
    assert line.see("ACT_SPEED") == pytest.approx(3000, abs=60), "10 rev/s2 for half a second"
    line.run(1.0)
    assert line.axis.motor.velocity == pytest.approx(600, abs=1)
    assert line.see("ACT_SPEED") == pytest.approx(6000, abs=10)
    line.send(0.25, REF_SPEED=-6000)
    assert line.axis.motor.velocity == pytest.approx(300, abs=15), "20 rev/s2 down"


def test_table_14_5_set_points_are_sent_back_where_they_are_mapped() -> None:
    line = MsdHand(telegram=111)
    line.map([967, 1275, 1275, 1278], [968, 967, 1275, 1275, 1278, 1277, 1277])
    line.store.set("P-1277", -7)
    line.send(STW1=0x0476, TARPOS_A=-123456, DRV_ACC=77)
    names = ("STW1_BACK", "TARPOS_A_BACK", "DRV_ACC_BACK", "VELOCITY_A_BACK")
    assert [line.see(name) for name in names] == [0x0476, -123456, 77, -7]


# 10.2, figure 10.2


def test_figure_10_2_the_switch_on_process_over_frames() -> None:
    line = MsdHand(telegram=1)
    seen = [line.send(STW1=word) & 0x0047 for word in (0x0400, 0x0406, 0x0407, 0x040F, 0x047F)]
    assert seen == [0x0040, 0x0001, 0x0003, 0x0007, 0x0007]


def test_enpo_is_taken_away_and_comes_back_as_a_kind_of_fault() -> None:
    line = MsdHand(telegram=1)
    line.enable(NSOLL_A=500)
    line.run(0.3)
    fault = line.fault("not-ready")
    line.run(0.02)
    assert line.see("ZSW1") & 0x4047 == 0x0040
    assert (line.labels, fault.evidence().confirmed) == ([], 1)
    line.send(0.02, STW1=0x0477)
    assert line.see("ZSW1") & 0x0041 == 0x0040
    line.clear(fault)
    line.enable(NSOLL_A=500)
    assert line.see("ZSW1") & 0x4000
    supply = line.fault("not-ready", params={"missing": "supply"})
    line.run(0.02)
    assert line.see("ZSW1") & 0x4047 == 0x4040
    line.clear(supply)


# 10.7 and 10.8, telegram 5: a controller's position loop closed in the drive


def test_telegram_5_follows_the_controllers_deviation_over_frames() -> None:
    line = MsdHand(telegram=5)
    line.enable(KPC=GAIN)
    worst = 0.0
    for cycle in range(1000):
        wanted = cycle * 0.005
        deviation = round(wanted * 2**20) - line.see("G1_XIST1")
        line.send(0.001, XERR=deviation, KPC=GAIN, NSOLL_B=round(300 / 3000 * 0x40000000))
        worst = max(worst, abs(float(line.axis.motor.position) - wanted))
    assert worst < 0.02
    assert line.axis.motor.velocity == pytest.approx(300, abs=5)


# 10.6, telegram 8


def test_telegram_8_leads_the_axis_with_a_position_in_each_frame() -> None:
    line = MsdHand(telegram=8)
    line.enable(TASKS)
    line.send(0.01, STW1=TASKS | START)
    for cycle in range(500):
        line.send(0.001, XSOLL_A=round(cycle * 0.005 * REV))
    assert line.axis.motor.velocity == pytest.approx(300, abs=5)
    assert line.see("XIST_A") == pytest.approx(499 * 0.005 * REV, abs=0.03 * REV)
    line.run(0.1)
    assert line.see("XIST_A") == pytest.approx(499 * 0.005 * REV, abs=200)


def test_8_2_1_the_drive_knows_the_cycle_of_the_connection_that_leads_it() -> None:
    """Its positions are that far apart (10.6)."""
    for cycle, nanoseconds in (("1ms", 1_000_000), ("8ms", 8_000_000)):
        assert MsdHand(telegram=8, cycle=cycle).axis.interpolation.settings.cycle_ns == nanoseconds


# 11.4


def test_11_4_a_homing_run_with_touch_probe_0_on_isd05() -> None:
    """The controller sets the function, the input changes, the position is read from G1_XIST2."""
    line = MsdHand(telegram=3)
    line.store.write(1255, 0, [1, 2])
    assert line.store.read(1402, 0, 2) == [1, 1]
    line.enable(NSOLL_B=0x40000000 // 50)
    line.run(0.2)
    line.send(0.01, G1_STW=0x0011)
    assert line.see("G1_ZSW") & 0x00FF == 0x0001
    probe = line.fault("digital-input", params={"input": 5})
    place = float(line.axis.motor.position)
    line.run(0.01)
    assert line.see("G1_ZSW") & 0x01FF == 0x0110
    line.clear(probe)
    line.run(0.1)
    line.send(0.01, G1_STW=0x0021)
    assert line.see("G1_XIST2") / 2**20 == pytest.approx(place, abs=0.003)
    assert line.see("G1_XIST2") != line.see("G1_XIST1")
    line.send(0.01, G1_STW=0)
    assert line.see("G1_ZSW") & 0x00FF == 0
    # and with no function configured there is nothing to search for
    line.send(0.01, G1_STW=0x0014)
    assert (line.see("G1_ZSW") & 0x8000, line.see("G1_XIST2")) == (0x8000, 4)


def test_11_4_a_homing_run_finds_the_edge_of_a_cam_of_the_machine() -> None:
    line = MsdHand(telegram=3, machine="{cams: [{input: 5, between: [1.25, 1.5]}]}")
    line.store.write(1255, 0, [1, 2])
    line.enable(NSOLL_B=0x40000000 // 50)
    line.send(0.01, G1_STW=0x0011)
    line.until(lambda: line.see("G1_ZSW") & 0x0010 == 0x0010)
    line.send(0.01, G1_STW=0x0021)
    assert line.see("G1_XIST2") / 2**20 == pytest.approx(1.25, abs=0.003)


def test_11_4_p_1402_is_not_set_back_when_the_reference_mark_goes() -> None:
    line = MsdHand(telegram=3)
    line.store.set("P-1255.1", 2)
    line.store.set("P-1255.1", 0)
    assert line.store.read(1402, 0, 2) == [0, 1]


# 16


@pytest.mark.parametrize("how", ["bad", "stop", "loss"])
def test_16_bad_outputs_and_a_lost_connection_set_every_output_to_zero(how: str) -> None:
    line = MsdHand(telegram=9)
    line.enable(TASKS, TARPOS_A=50 * REV, VELOCITY_A=600, STW2=0)
    line.send(0.3, STW1=TASKS | START)
    if how == "bad":
        line.plc.columns.image[0].good = 0
    elif how == "stop":
        line.plc.columns.ppm["data_status"] ^= STATUS_RUN
    else:
        line.fault("silence", direction="in", **{"for": "5s"})
    line.run(0.1)
    assert (int(line.axis.profidrive.stw1), int(line.axis.drive.state)) == (0, 1)
    # P-0967, P-1275 and P-1277 are these outputs
    assert [line.store.get(f"P-{pnu:04}") for pnu in (967, 1275, 1277)] == [0, 0, 0]
    line.until(lambda: abs(line.axis.motor.velocity) < 1.0, 60.0)


def test_16_set_points_that_are_sent_back_are_zero_with_bad_outputs_and_come_back_with_good_ones() -> None:
    line = MsdHand(telegram=104)
    line.map([967, 1275, 1275], [968, 967, 1275, 1275])
    sent = (0x0406, -5 * REV)
    line.send(STW1=sent[0], TARPOS_A=sent[1])
    assert (line.see("STW1_BACK"), line.see("TARPOS_A_BACK")) == sent
    line.plc.columns.image[0].good = 0
    line.run(0.01)
    assert (line.see("STW1_BACK"), line.see("TARPOS_A_BACK")) == (0, 0)
    line.plc.columns.image[0].good = 1
    line.run(0.01)
    assert (line.see("STW1_BACK"), line.see("TARPOS_A_BACK")) == sent


def test_16_after_power_on_every_output_is_zero() -> None:
    line = MsdHand(telegram=1)
    line.enable(NSOLL_A=500)
    line.run(0.3)
    line.fault("power-cycle", params={"off": "200ms"})
    # before the controller is back
    line.run(0.25)
    axis = line.axis
    assert (int(axis.profidrive.stw1), float(axis.ramp.setpoint), float(axis.motor.velocity)) == (0, 0.0, 0.0)


def test_table_15_1_torque_is_mapped_both_ways_and_leads_the_drive() -> None:
    """P-0300 = 1 (table 10.1), P-1272 and P-1273 in thousandths of a newton metre."""
    line = MsdHand(telegram=111)
    line.map([967, 1272], [968, 1273, 1271, 1271])
    line.store.set("P-0300", 1)
    line.store.set("P-0295", float_bits(0.001))
    line.enable()
    line.send(0.03, REF_TORQUE=300)
    assert line.see("ACT_TORQUE") == pytest.approx(300, abs=1)
    assert line.see("ACT_SPEED") > 200
    line.send(0.03, REF_TORQUE=-300 & 0xFFFF)
    assert line.see("ACT_TORQUE") - 0x10000 == pytest.approx(-300, abs=1)


# parameters of the farm file


@pytest.mark.parametrize(("written", "override"), [("50.0", 0.5), ("12.5", 0.125), ("0x42480000", 0.5)])
def test_a_float_of_the_farm_file_is_the_number_itself_with_a_point_and_its_bits_without(
    written: str, override: float
) -> None:
    line = VirtualLine(model="moog-msd", cycle="1ms", params=f"{{P-0167: {written}}}")
    assert float(line.farm.axes[0].handle.axis.ramp.settings.speed_override) == pytest.approx(override)


@pytest.mark.parametrize(
    ("params", "complaint"),
    [
        ("{P-0167: -50.0}", r"params\.P-0167: is -50\.0; allowed: a number such as 50\.0"),
        ("{P-0167: 1e300}", r"params\.P-0167: is 1e\+300; allowed: a number such as 50\.0"),
        ("{P-1278: 1.5}", r"params\.P-1278: is 1\.5; allowed: a whole number from 0 to 65535"),
        ("{P-1278: 65536}", r"params\.P-1278: is 65536; allowed: a whole number from 0 to 65535"),
    ],
)
def test_a_parameter_of_the_farm_file_that_the_drive_cannot_hold_is_reported_with_its_line(
    params: str, complaint: str
) -> None:
    with pytest.raises(ConfigError, match=complaint):
        VirtualLine(model="moog-msd", cycle="1ms", params=params)
