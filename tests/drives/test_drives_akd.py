"""The AKD of manual edition M (firmware 1.17) against that manual: parameters, units, faults, position mode."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from drives_kit import Drive, Running, new_drive
from manuals import manual_text

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.behaviour import with_behaviour
from pnfarm.drives.catalogue import model
from pnfarm.drives.parameter import Backing, ParameterError, ParameterErrorNumber
from pnfarm.drives.store import ParameterStore
from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import (
    CMD_ACKNOWLEDGE,
    CMD_CLEAR_WARNING,
    CMD_DISABLE,
    CMD_RAISE_FAULT,
    CMD_RAISE_WARNING,
    DISABLE_AT_ONCE,
    DISABLE_STOPPED,
)
from pnfarm.table.image import IMAGE
from pnfarm.table.signals import (
    DRIVE_INPUTS,
    DRV_ACC,
    DRV_DEC,
    HOME_DIST,
    HOME_MODE,
    ITIST_GLATT,
    MDI_ACC,
    MDI_DEC,
    MDI_MOD,
    MDI_TARPOS,
    MDI_VELOCITY,
    MT_FEEDRATE,
    NIST_A,
    SATZANW,
    XIST_A,
)

if TYPE_CHECKING:
    pass

NAME = "akd-profinet"
E = ParameterErrorNumber


@pytest.fixture
def running() -> Running:
    return Running(NAME)


def enable(drive: Running, word: int = 0x047F, nsoll_a: int = 0) -> None:
    for stw1 in (word & ~0x000F, word & ~0x0009, word & ~0x0008, word):
        drive.send(stw1, nsoll_a)
    drive.send(word, nsoll_a)
    assert drive.axis.drive.state == 4


def refused(number: int, store: object, name: str | int, value: int = 1) -> None:
    with pytest.raises(ParameterError) as caught:
        store.set(name, value)  # type: ignore[attr-defined]
    assert caught.value.number == number


# 4.2, 5.2: what this drive denies


def test_4_2_restrictions_one_port_16_ms_and_no_clock_synchronism() -> None:
    described = model(NAME)
    assert described.limits.min_cycle_ns == 16_000_000
    assert described.limits.ports == 1
    assert not described.limits.alarms
    assert [s.name for s in described.dap.submodules] == ["DAP", "Interface", "Port X11"]


# 5.4, 5.5


def test_5_4_and_5_5_every_bit_of_the_tables_has_its_name_in_velocity_mode() -> None:
    bits = {word.word: word.names for word in model(NAME).profidrive.word_bits}
    assert bits["STW1"][10] == "control_by_plc"
    assert len(bits["STW1"]) == 11
    assert len(bits["ZSW1"]) == 11


def test_5_4_bits_11_to_15_mean_nothing_in_velocity_mode_and_5_5_bits_11_to_15_stay_zero(running: Running) -> None:
    enable(running, 0x047F, 0x00A3)
    for bit in range(11, 16):
        assert running.send(0x047F | 1 << bit, 0x00A3, 100) & 0xF800 == 0
    assert running.image.sent[NIST_A] == 0x00A3


def test_5_4_bits_14_and_15_mean_nothing_in_position_mode(running: Running) -> None:
    running.drive.store.set("DRV.OPMODE", 2)
    enable(running, 0x043F)
    assert running.send(0xC43F, milliseconds=200) & 0x8000 == 0
    assert running.axis.motor.velocity == 0.0


def test_5_4_a_fault_is_acknowledged_by_bit_7_and_the_drive_goes_to_s1(running: Running) -> None:
    enable(running)
    running.drive.store.handle.push_command(CMD_RAISE_FAULT, 501)
    assert running.send(0x047F) & 0x000F == 0x0008
    assert running.send(0x04FF) & 0x004F == 0x0040


# 5.6, 5.8: parameters and signals


def test_5_6_the_profile_parameters_have_the_types_of_the_table() -> None:
    text = manual_text("000").split("List of all supported PROFIdrive PNU's")[1].split("**Supported Formats:**")[0]
    rows = re.findall(r"^(\d+)\t([^\t]*)\t((?:Array of )?[US]16|[US]32)?\t", text, re.MULTILINE)
    described = model(NAME)
    assert len(rows) == 25
    for number, name, kind in rows:
        parameter = described.parameters[int(number)]
        assert parameter.name == name or (number, name) == ("1002", "No. of singletum bits")
        assert parameter.octets == (4 if kind.endswith("32") else 2)
        assert bool(parameter.elements) == kind.startswith("Array") or not kind
        # the current is U16 here, but the example of 5.12.4 gives it a sign
        assert parameter.signed == kind.endswith("S16") or parameter.pnu == 52


def test_5_8_every_signal_of_the_table_has_its_format_and_its_pnu() -> None:
    text = manual_text("000").split("## 5.8 Telegram Configuration")[-1].split("### 5.8.1")[0]
    rows = re.findall(r"^(\d+)\t[^\t]*\t(D?WORD)\t(\w+)\t([^\t\n]+)$", text, re.MULTILINE)
    described = model(NAME)
    assert len(rows) == 21
    for number, form, name, drive_signal in rows:
        signal = described.profidrive.signals[int(number)]
        assert (signal.name, signal.bits) == (name, 32 if form == "DWORD" else 16)
        assert signal.drive_signal == drive_signal.rstrip("*") or int(number) == 106
        assert described.parameters[int(number)].octets == signal.bits // 8
    assert 107 not in described.profidrive.signals, "reserved"


def test_5_6_commands_that_cannot_act_are_refused_and_say_why(running: Running) -> None:
    store = running.drive.store
    commands = [p for p in running.drive.model.parameters.values() if p.backing is Backing.COMMAND]
    assert len(commands) == 31
    for parameter in commands:
        if parameter.argument == "refuse":
            assert parameter.note.startswith("refused: ")
            refused(E.OPERATING_STATE, store, parameter.pnu)


def test_5_6_drv_dis_takes_the_power_away_as_drv_dismode_says(akd: Drive) -> None:
    akd.store.set("DRV.DIS", 1)
    assert akd.axis.commands.settings.head == 0, "it is off"
    akd.axis.drive.state = 4
    for mode, how in ((0, DISABLE_AT_ONCE), (1, DISABLE_AT_ONCE), (2, DISABLE_STOPPED), (3, DISABLE_STOPPED)):
        akd.store.set("DRV.DISMODE", mode)
        akd.store.set("DRV.DIS", 1)
        assert akd.axis.commands.settings.ring[mode] == CMD_DISABLE
        assert akd.axis.drive.settings.disable_method == how


def test_5_6_drv_en_does_not_switch_on_what_the_control_word_left_off(akd: Drive) -> None:
    refused(E.OPERATING_STATE, akd.store, "DRV.EN")
    akd.axis.drive.state = 4
    akd.store.set("DRV.EN", 1)
    assert akd.axis.commands.settings.head == 0


def test_5_6_drv_clrfaults_acknowledges_under_both_its_numbers(running: Running) -> None:
    store = running.drive.store
    for number in (2111, 2112):
        store.handle.push_command(CMD_RAISE_FAULT, 301)
        running.run(2)
        assert running.send(0x0470) & 0x0008
        store.write(number, 0, [1])
        assert not running.send(0x0470, milliseconds=2) & 0x0008
    assert store.read(944) == [2]


def test_5_6_live_values_of_velocity_current_bus_and_motor(running: Running) -> None:
    store = running.drive.store
    enable(running, 0x047F, 0x00A3)
    running.send(0x047F, 0x00A3, 500)
    assert store.get("VL.CMD") == store.get("VL.CMDU") == pytest.approx(59_700, abs=100)
    assert store.get("VL.FB") == pytest.approx(59_700, abs=100)
    assert store.get("VL.ERR") == pytest.approx(0, abs=50)
    # dry friction of 0.05 N m, viscous of 0.0001 N m s/rad, 0.5 N m/A
    assert store.get("IL.FB") == pytest.approx(101, abs=5)
    assert (store.get("DRV.ACTIVE"), store.get("DRV.DISSOURCES")) == (1, 0)
    assert store.get("VBUS.VALUE") == pytest.approx(560_000, abs=10_000)
    assert (store.get("MOTOR.KT"), store.get("MOTOR.VMAX"), store.get("MOTOR.INERTIA")) == (500, 12000, 2000)
    assert (store.get("MOTOR.ICONT"), store.get("MOTOR.IPEAK"), store.get("DRV.IPEAK")) == (3000, 9000, 9000)
    assert (store.get("MOTOR.R"), store.get("MOTOR.LQLL"), store.get("VBUS.OVFTHRESH")) == (3000, 8000, 840)
    turned = float(running.axis.motor.position)
    assert store.get("FB1.MECHPOS") == pytest.approx(turned % 1.0 * 2**32, abs=2)
    store.set("UNIT.PROTARY", 2)
    assert store.get("FB1.P") == store.get("PL.FB") == pytest.approx(turned * 360, abs=1)


def test_5_6_digital_inputs_are_read_one_by_one(akd: Drive) -> None:
    akd.axis.machine.inputs = 0b1000101
    assert [akd.store.get(f"DIN{n}.STATE") for n in range(1, 8)] == [1, 0, 1, 0, 0, 0, 1]


def test_5_6_dissources_tells_why_the_power_stage_is_off(akd: Drive) -> None:
    assert akd.store.get("DRV.DISSOURCES") == 0x11, "not started up yet, and off by software"
    akd.axis.drive.state = 1
    assert akd.store.get("DRV.DISSOURCES") == 0x01
    akd.axis.faults.code[0] = 702
    assert akd.store.get("DRV.DISSOURCES") == 0x03


def test_5_6_faults_and_warnings_stand_in_their_parameters_in_the_order_they_came(running: Running) -> None:
    store = running.drive.store
    for number in (502, 301, 702):
        store.handle.push_command(CMD_RAISE_FAULT, number)
    running.run(2)
    assert [store.get(f"DRV.FAULT{n}") for n in range(1, 11)] == [502, 301, 702] + [0] * 7
    for number in (107, 108):
        store.handle.push_command(CMD_RAISE_WARNING, number)
    running.run(2)
    assert [store.get(f"DRV.WARNING{n}") for n in (1, 2, 3)] == [108, 107, 0]
    store.handle.push_command(CMD_CLEAR_WARNING, 107)
    running.run(2)
    assert [store.get(f"DRV.WARNING{n}") for n in (1, 2, 3)] == [108, 0, 0]


def test_5_6_vl_kp_and_vl_ki_tune_the_speed_controller(akd: Drive) -> None:
    assert akd.axis.motor.settings.speed_gain == 0.0, "tuned to motor and load"
    assert akd.axis.motor.settings.speed_integral_time == pytest.approx(0.008, rel=1e-4)
    akd.store.set("VL.KP", 200)
    akd.store.set("VL.KI", 160_000)
    assert akd.axis.motor.settings.speed_gain == pytest.approx(0.2 * 0.5)
    assert akd.axis.motor.settings.speed_integral_time == pytest.approx(6.2832 / 160, rel=1e-4)


def test_5_6_current_limits_bound_the_torque_of_their_direction(running: Running) -> None:
    store = running.drive.store
    assert running.axis.torque.settings.limit_positive == running.axis.torque.settings.limit_negative == float("inf")
    store.set("IL.LIMITP", 2000)
    store.set("IL.LIMITN", -1000)
    assert (running.axis.torque.settings.limit_positive, running.axis.torque.settings.limit_negative) == (1.0, 0.5)
    store.set("DRV.ACC", 50_000_000_000 // 100)
    store.set("DRV.DEC", 50_000_000_000 // 100)
    enable(running, 0x047F, 0)
    most = least = 0
    for nsoll_a in (8000, -8000):
        for _ in range(300):
            running.send(0x047F, nsoll_a & 0xFFFF)
            most, least = max(most, store.get("IL.FB")), min(least, store.get("IL.FB"))
    assert (most, least) == (pytest.approx(2000, abs=2), pytest.approx(-1000, abs=2))


def test_5_6_velocity_limits_bound_set_points_and_tasks_of_their_direction(running: Running) -> None:
    store = running.drive.store
    store.set("VL.LIMITP", 100_000)
    store.set("VL.LIMITN", -50_000)
    enable(running, 0x047F, 0)
    for nsoll_a, rpm in ((1638, 100.0), (-1638, -50.0)):
        running.send(0x047F, nsoll_a & 0xFFFF, 500)
        assert running.axis.motor.velocity == pytest.approx(rpm, abs=0.5)
    drive = Positioning()
    drive.drive.store.set("VL.LIMITN", -50_000)
    drive.move(-50 * 65536, 1000)
    assert drive.axis.motor.velocity == pytest.approx(-50.0, abs=0.5)
    assert drive.axis.positioning.following_error == pytest.approx(0.0, abs=0.01)


def test_5_6_another_command_source_than_the_fieldbus_leaves_velocity_set_points_alone(running: Running) -> None:
    enable(running, 0x047F, 0x00A3)
    running.send(0x047F, 0x00A3, 300)
    running.drive.store.set("DRV.CMDSOURCE", 0)
    running.send(0x047F, 0x00A3, 500)
    assert running.axis.motor.velocity == pytest.approx(0.0, abs=0.1)
    running.drive.store.set("DRV.CMDSOURCE", 1)
    running.send(0x047F, 0x00A3, 500)
    assert running.image.sent[NIST_A] == 0x00A3


def service_ready() -> Running:
    """In operation, with set points from elsewhere than the fieldbus."""
    running = Running(NAME)
    for name, value in (("SM.MODE", 2), ("SM.V1", 300_000), ("SM.V2", -120_000), ("SM.T1", 400), ("SM.T2", 200)):
        running.drive.store.set(name, value)
    running.drive.store.set("DRV.CMDSOURCE", 0)
    enable(running, 0x047F, 0x00A3)
    return running


def test_5_6_sm_move_turns_the_motor_for_its_time() -> None:
    running = service_ready()
    assert running.axis.motor.velocity == 0.0
    running.drive.store.set("SM.MOVE", 1)
    running.send(0x047F, 0x00A3, 300)
    assert running.axis.motor.velocity == pytest.approx(300.0, abs=0.5)
    assert running.drive.store.get("DRV.MOTIONSTAT") & 0x200
    running.send(0x047F, 0x00A3, 300)
    assert running.axis.motor.velocity == pytest.approx(0.0, abs=0.1)
    assert not running.drive.store.get("DRV.MOTIONSTAT") & 0x200


def test_5_6_service_motion_goes_to_and_fro_until_drv_stop() -> None:
    running = service_ready()
    store = running.drive.store
    store.set("SM.MODE", 3)
    store.set("SM.MOVE", 1)
    seen = []
    for _ in range(4):
        running.send(0x047F, 0x00A3, 300)
        seen.append(round(float(running.axis.motor.velocity)))
    assert seen == [300, -120, 300, -120]
    store.set("DRV.STOP", 1)
    running.send(0x047F, 0x00A3, 300)
    assert running.axis.motor.velocity == pytest.approx(0.0, abs=0.1)
    refused(E.OPERATING_STATE, store, "DRV.STOP")


@pytest.mark.parametrize(("name", "value"), [("DRV.CMDSOURCE", 1), ("SM.MODE", 4), ("DRV.OPMODE", 2)])
def test_5_6_sm_move_is_refused_without_what_it_needs(name: str, value: int) -> None:
    running = service_ready()
    running.drive.store.set(name, value)
    refused(E.OPERATING_STATE, running.drive.store, "SM.MOVE")


def test_5_6_service_motion_without_end_ends_with_operation_and_does_not_come_back() -> None:
    running = service_ready()
    running.drive.store.set("SM.T1", 0)
    running.drive.store.set("SM.MOVE", 1)
    running.send(0x047F, 0x00A3, 2000)
    assert running.axis.motor.velocity == pytest.approx(300.0, abs=0.5)
    running.send(0x0476, 0x00A3, 300)
    assert running.axis.motor.velocity == pytest.approx(0.0, abs=0.5)
    enable(running, 0x047F, 0x00A3)
    running.send(0x047F, 0x00A3, 300)
    assert running.axis.motor.velocity == pytest.approx(0.0, abs=0.1)


def test_5_8_signals_that_no_telegram_brings_count_once_their_pnu_is_written(akd: Drive) -> None:
    akd.store.plug_telegram(7)
    assert (akd.axis.profidrive.settings.home_signals, akd.axis.profidrive.settings.feedrate_signal) == (0, 0)
    akd.store.write(103, 0, [7])
    akd.store.write(100, 0, [-65536])
    akd.store.write(101, 0, [50])
    assert (akd.axis.profidrive.settings.home_signals, akd.axis.profidrive.settings.feedrate_signal) == (3, 1)
    received = akd.image.received
    assert (received[HOME_MODE], received[HOME_DIST], received[MT_FEEDRATE]) == (7, -65536, 50)


def test_5_8_signals_of_the_telegram_are_read_in_the_parameters_that_they_change(running: Running) -> None:
    store, received = running.drive.store, running.image.received
    store.plug_telegram(353)
    received[HOME_MODE], received[HOME_DIST] = 7, -32768
    assert (store.get("HOME.MODE"), store.get("HOME.DIST")) == (0, 0), "no valid data yet"
    running.send(0x0470)
    assert (store.get("HOME.MODE"), store.read(1001)) == (7, [7])
    assert store.get("HOME.DIST") == -32768
    store.plug_telegram(354)
    received[DRV_ACC], received[DRV_DEC] = 100, 50
    running.send(0x0470)
    assert (store.get("DRV.ACC"), store.get("DRV.DEC")) == (76_300_000, 38_150_000)
    assert (running.axis.ramp.up, running.axis.ramp.down) == (76_300.0, 38_150.0)
    assert (store.get("HOME.MODE"), store.get("HOME.DIST")) == (7, -32768), "changed for good, until another comes"


def test_5_8_of_a_signals_pnu_and_the_parameter_that_it_changes_the_last_one_written_counts(running: Running) -> None:
    store = running.drive.store
    store.plug_telegram(7)
    for signal, value, name, other in (
        (103, 7, "HOME.MODE", 4),
        (100, 65536, "HOME.DIST", 0),
        (108, 9, "DRV.ACC", 10_000_000),
    ):
        store.write(signal, 0, [value])
        assert store.get(name) not in {0, other}
        store.set(name, other)
        assert store.get(name) == other
    running.send(0x0470)
    axis = running.axis
    assert (axis.homing.method_in_force, axis.homing.distance_in_force, axis.ramp.up) == (4, 0.0, 10_000.0)


def test_5_8_1_every_bit_of_drive_inputs_is_what_its_parameter_shows(running: Running) -> None:
    store, axis = running.drive.store, running.axis

    def inputs() -> int:
        running.run(1)
        return int(running.image.sent[DRIVE_INPUTS])

    assert inputs() == 0x40
    assert (store.get("SWLS.STATE"), store.get("HWLS.NEGSTATE"), store.get("HWLS.POSSTATE")) == (0, 0, 0)
    assert (store.get("DRV.DISSOURCES") & 0x24, store.get("STO.STATE")) == (0, 1)
    axis.machine.settings.fault_limits = 1
    assert (inputs(), store.get("HWLS.NEGSTATE")) == (0x44, 1)
    axis.machine.settings.fault_limits = 2
    assert (inputs(), store.get("HWLS.POSSTATE")) == (0x48, 1)
    axis.machine.settings.fault_limits = 0
    store.set("SWLS.LIMIT0", -10)
    store.set("SWLS.LIMIT1", 150_000)
    store.set("SWLS.EN", 3)
    assert inputs() == 0x40, "not homed yet"
    axis.homing.homed = 1
    assert (inputs(), store.get("SWLS.STATE")) == (0x41, 1)
    axis.motor.position = 3.0
    assert (inputs(), store.get("SWLS.STATE")) == (0x42, 2)
    axis.faults.held[0] = 602
    assert (inputs(), store.get("STO.STATE")) == (0x02, 0)


def test_the_faults_that_the_axis_watches_for_are_the_models() -> None:
    for name in (NAME, "akd-profinet-2012"):
        described = model(name)
        assert described.fault("sto").number == int(described.firmware.get("faults.sto_fault", 602))
        sides = [described.fault(f"limit-switch-{side}").number for side in ("negative", "positive")]
        assert list(described.firmware.get("warnings.limit", sides)) == sides


# 5.10, 5.12: position mode in the units of the manual


class Positioning(Running):
    """In position mode, operation enabled, telegram 9; homed where it stands."""

    def __init__(self, *, homed: bool = True) -> None:
        super().__init__(NAME)
        self.drive.store.plug_telegram(9)
        self.drive.store.set("DRV.OPMODE", 2)
        enable(self, 0x043F)
        if homed:
            self.send(0x0C3F, milliseconds=5)
            assert self.send(0x043F) & 0x0800
        received = self.image.received
        received[SATZANW], received[MDI_MOD] = 0x8000, 1
        received[MDI_VELOCITY], received[MDI_ACC], received[MDI_DEC] = 2**32 // 20, 40, 40

    def move(self, counts: int, milliseconds: int = 3000) -> int:
        self.image.received[MDI_TARPOS] = counts
        self.send(0x047F, milliseconds=20)
        return self.send(0x043F, milliseconds=milliseconds)


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


# 5.14, 8.1: faults


def test_5_14_eight_situations_of_eight_faults_newest_first(running: Running) -> None:
    store = running.drive.store
    numbers = [107 + n for n in range(80)]
    for situation in range(9):
        for place in range(9):
            store.handle.push_command(CMD_RAISE_FAULT, numbers[situation * 8 + place])
        running.run(2)
        assert store.read(944) == [situation + 1], "one more with each situation, not with each fault"
        assert store.read(947, 0, 8) == numbers[situation * 8 : situation * 8 + 8], "the ninth has no place"
        assert running.send(0x0470) & 0x0008
        store.handle.push_command(CMD_ACKNOWLEDGE)
        assert not running.send(0x0470, milliseconds=2) & 0x0008
        assert store.read(947, 0, 8) == [0] * 8
    kept = store.read(947, 0, 64)
    assert kept[8:16] == numbers[64:72]
    assert kept[56:64] == numbers[16:24], "the two oldest of nine are gone: seven stay acknowledged"
    with pytest.raises(ParameterError) as caught:
        store.read(952)
    assert caught.value.number == E.IMPERMISSIBLE_PNU, "5.6 has no such parameter"


# 6: parameters


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


def test_6_2_defaults_of_places_stay_where_a_farm_file_gives_another_unit() -> None:
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


def test_6_2_the_numbers_follow_the_scale_and_the_places_stay(akd: Drive) -> None:
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


def test_6_2_a_value_written_behind_a_new_scale_counts_in_it(akd: Drive) -> None:
    akd.store.set("PN.POSSCALE", 100_000)
    akd.store.set("HOME.P", 655)
    assert akd.axis.homing.settings.position == pytest.approx(1.0, abs=1e-3)
    akd.store.set("PN.POSSCALE", 1000)
    assert akd.store.get("HOME.P") == 65_500


def test_6_3_and_6_6_pn_stw1_and_pn_zsw1_are_the_words_on_the_bus(running: Running) -> None:
    zsw1 = running.send(0x0477)
    assert running.drive.store.get("PN.STW1") == 0x0477
    assert running.drive.store.get("PN.ZSW1") == zsw1


def test_6_3_pn_stw1_is_read_only_and_a_set_point_by_its_pnu_moves_nothing(running: Running) -> None:
    store = running.drive.store
    for name in ("PN.STW1", "pn.stw1", "PN.STW1.0", "PN.ZSW1"):
        refused(E.NOT_CHANGEABLE, store, name, 0x0476)
        assert not running.drive.model.writable(name)
    running.send(0x0470)
    refused(E.NO_OPERATION_PRIORITY, store, 1, 0x0476)
    running.image.valid = 0
    running.run(5)
    store.set("STW1", 0x0476)
    running.run(5)
    assert (store.get(1), running.axis.drive.state) == (0x0476, 1), "5.8: written, and no controller sends it"


def test_6_4_the_timeout_is_that_of_the_controller(akd: Drive) -> None:
    refused(E.NOT_CHANGEABLE, akd.store, "PN.TIMEOUTFTHRESH", 5)
    akd.store.watchdog_ns = 48_000_000
    assert akd.store.get("PN.TIMEOUTFTHRESH") == 48


def test_5_15_fbus_param01_reads_the_configured_telegram(akd: Drive) -> None:
    akd.store.plug_telegram(353)
    assert akd.store.get("FBUS.PARAM01") == akd.store.read(922)[0] == 353
    refused(E.NOT_CHANGEABLE, akd.store, "FBUS.PARAM01", 1)


def test_every_position_parameter_keeps_its_place_over_nvsave_and_a_power_cycle() -> None:
    drive = new_drive(NAME)
    drive.store.set("PN.POSSCALE", 100)
    drive.store.set("SWLS.LIMIT0", -655_360)
    drive.store.set("DRV.NVSAVE", 1)
    drive.store.power_on()
    assert drive.axis.travel.settings.low == pytest.approx(-1.0, abs=1e-6)
    assert drive.store.get("SWLS.LIMIT0") == -655_360
