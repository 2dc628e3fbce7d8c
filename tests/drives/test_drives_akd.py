"""The AKD of manual edition M (firmware 1.17) against that manual: parameters, units, faults, position mode."""

from __future__ import annotations

import re

import pytest
from akd_kit import NAME, E, Positioning, enable, refused
from drives_kit import Drive, Running
from manuals import manual_text

from pnfarm.drives.catalogue import model
from pnfarm.drives.parameters.parameter import Backing, ParameterError
from pnfarm.table.axis_codes import (
    CMD_ACKNOWLEDGE,
    CMD_CLEAR_WARNING,
    CMD_DISABLE,
    CMD_RAISE_FAULT,
    CMD_RAISE_WARNING,
    DISABLE_AT_ONCE,
    DISABLE_STOPPED,
)
from pnfarm.table.signals import (
    DRIVE_INPUTS,
    DRV_ACC,
    DRV_DEC,
    HOME_DIST,
    HOME_MODE,
    MT_FEEDRATE,
    NIST_A,
)

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


def test_5_6_dissources_shows_why_the_power_stage_is_off(akd: Drive) -> None:
    assert akd.store.get("DRV.DISSOURCES") == 0x11, "not started up yet, and off by software"
    akd.axis.drive.state = 1
    assert akd.store.get("DRV.DISSOURCES") == 0x01
    akd.axis.faults.code[0] = 702
    assert akd.store.get("DRV.DISSOURCES") == 0x03


def test_5_6_faults_and_warnings_are_in_their_parameters_in_order_of_time(running: Running) -> None:
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


def test_5_6_service_motion_moves_back_and_forth_until_drv_stop() -> None:
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


def test_a_telegram_that_is_plugged_again_applies_again(akd: Drive) -> None:
    akd.store.plug_telegram(7)
    before = akd.axis.tobytes()
    akd.store.write(103, 0, [7])
    akd.store.write(101, 0, [50])
    akd.axis.drive.settings.opmode = 1
    assert akd.axis.tobytes() != before
    akd.store.plug_telegram(7)
    assert akd.axis.tobytes() == before


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
    axis.faults.held[0], axis.faults.causes = 602, 1
    assert (inputs(), store.get("STO.STATE")) == (0x02, 0)


def test_the_faults_that_the_axis_watches_for_are_the_models() -> None:
    for name in (NAME, "akd-profinet-2012"):
        described = model(name)
        assert described.fault("sto").number == int(described.firmware.get("faults.sto_fault", 602))
        sides = [described.fault(f"limit-switch-{side}").number for side in ("negative", "positive")]
        assert list(described.firmware.get("warnings.limit", sides)) == sides


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
