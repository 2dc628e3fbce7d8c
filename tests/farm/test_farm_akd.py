"""The AKD of manual edition M over frames and records, as a PLC program sees it, section by section."""

from __future__ import annotations

import pytest
from akd_position import (
    ACKNOWLEDGED,
    ACTIVE,
    BYTE,
    COUNTS,
    DWORD,
    HOME,
    HOMED,
    IN_RANGE,
    MDI,
    REACHED,
    READY,
    START,
    STOPPED,
    WORD,
    position_line,
    write,
)
from hand_line import HandLine
from parameter_requests import change_request
from record_line import API, access, changing, reading, value_of
from virtual_line import VirtualLine

from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.drives.profiles.profidrive.base_mode import (
    ParameterAddress,
    ParameterValues,
    emit_request,
    parse_response,
)
from pnfarm.protocols.profinet.wire.rtc import DataStatus

FAULT = 0x0008
#: One revolution in the raw numbers of MT.P and its kin.
REVOLUTION = 65536


def task(line: VirtualLine, number: int, revolutions: float, *, control: int = 0, following: int = 0, wait: int = 0):
    """A motion task, put together and kept by its parameters."""
    for pnu, form, value in (
        (2274, BYTE, number),
        (2275, DWORD, round(revolutions * REVOLUTION)),
        (2283, DWORD, 600_000),
        (2263, DWORD, 30_000_000),
        (2268, DWORD, 30_000_000),
        (2266, DWORD, control),
        (2273, BYTE, following),
        (2278, WORD, wait),
        (2277, BYTE, 1),
    ):
        write(line, pnu, form, value)


# 3.6, 5.9, 7.1: velocity mode


def test_5_9_the_example_sends_four_control_words_and_1_rps():
    line = HandLine()
    assert line.send(0b0000_0100_0111_0000, NSOLL_A=0) & 0x47 == 0x40
    assert line.send(0b0000_0100_0111_0110) & 0x47 == 0x01
    assert line.send(0b0000_0100_0111_0111) & 0x47 == 0x03
    assert line.send(0b0000_0100_0111_1111, NSOLL_A=0x00A3, frames=20) & 0x4F == 0x07
    assert line.actual("NIST_A") == 0x00A3
    assert line.axis.motor.velocity == pytest.approx(60.0, abs=0.5)


def test_7_1_the_sample_project_step_by_step_at_its_cycle_of_128_ms():
    line = HandLine(cycle="128ms")
    assert line.farm.axes[0].store.telegram_number == 1
    # 7.1.3 wants DRV.OPMODE 1; 7.1.2 shows parameters read and written by the acyclic channel
    assert value_of(line, 930) == (1,)
    write(line, 930, WORD, 1)
    assert line.send(0b0000_0100_0000_0000, NSOLL_A=0) & 0x0247 == 0x0240, "remote control over the field bus"
    assert line.send(0b0000_0100_0000_0110) & 0x0047 == 0x0001, "S2"
    # bit 0 is missing in the third word of 7.1.4, and so S3 is reached by the fourth
    line.send(0b0000_0100_0000_1110)
    assert line.send(0b0000_0100_0000_1111) & 0x0047 == 0x0007, "S4"
    assert line.axis.motor.velocity == 0.0, "bits 4, 5 and 6 are not set"
    line.send(0b0000_0100_0111_1111, NSOLL_A=0x00A3, frames=20)
    assert line.actual("NIST_A") == 0x00A3
    # the table's status word 0x0237, and within five steps of the set point bits 8 and 10
    assert line.zsw1 == 0x0737


def test_5_4_velocity_mode_bits_4_5_and_6_work_the_ramp_generator():
    line = HandLine()
    line.enable_axis(0x047F)
    line.send(0x047F, NSOLL_A=1638, frames=30)
    assert line.axis.motor.velocity == pytest.approx(600.0, abs=1.0)
    line.send(0x045F, NSOLL_A=0, frames=30)
    assert line.axis.motor.velocity == pytest.approx(600.0, abs=1.0), "frozen"
    line.send(0x047F, frames=30)
    assert line.axis.motor.velocity == pytest.approx(0.0, abs=0.5)
    line.send(0x043F, NSOLL_A=1638, frames=30)
    assert line.axis.motor.velocity == pytest.approx(0.0, abs=0.5), "no set point enabled"
    line.send(0x046F, frames=30)
    assert line.axis.motor.velocity == pytest.approx(0.0, abs=0.5), "no ramp generator"


def test_5_4_without_bit_10_no_command_is_accepted():
    line = HandLine()
    line.enable_axis(0x047F)
    line.send(0x007F, NSOLL_A=0x00A3, frames=20)
    assert line.axis.motor.velocity == 0.0
    line.send(0x0070, frames=10)
    assert line.zsw1 & 0x0007 == 0x0007, "OFF is not accepted either"


def test_5_4_jog_1_and_jog_2_run_at_pnu_1004_and_1005():
    line = HandLine()
    for pnu, value in ((1004, 1638), (1005, -819), (1006, 13), (1007, 13)):
        write(line, pnu, WORD, value)
    line.enable_axis(0x040F)
    line.send(0x050F, frames=30)
    assert line.axis.motor.velocity == pytest.approx(600.0, abs=1.0)
    line.send(0x040F, frames=30)
    assert line.axis.motor.velocity == pytest.approx(0.0, abs=0.5)
    line.send(0x060F, frames=30)
    assert line.axis.motor.velocity == pytest.approx(-300.0, abs=1.0)


# 5.10.1: program mode


def test_5_10_1_telegram_7_starts_a_motion_task_by_satzanw_and_the_edge_of_bit_6():
    line = position_line()
    task(line, 7, 2.0)
    zsw1 = line.send(START, SATZANW=7)
    assert zsw1 & (ACKNOWLEDGED | STOPPED | ACTIVE | REACHED) == ACKNOWLEDGED | ACTIVE
    assert line.actual("AKTSATZ") == 7
    assert not line.send(READY) & ACKNOWLEDGED
    line.until(REACHED | STOPPED)
    line.run(0.2)
    assert line.place == pytest.approx(2.0, abs=0.01)
    assert line.zsw1 & (ACTIVE | IN_RANGE) == IN_RANGE
    assert line.actual("AKTSATZ") == 0


def test_5_10_1_bit_6_that_stays_set_starts_nothing_and_each_rise_starts_once():
    line = position_line()
    task(line, 1, 1.0, control=0x01)
    line.send(START, SATZANW=1, frames=100)
    line.send(START, frames=100)
    assert line.place == pytest.approx(1.0, abs=0.01)
    line.send(READY)
    line.send(START, frames=100)
    assert line.place == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize("missing", ["home", "position mode", "task"])
def test_5_10_1_a_task_needs_what_the_section_asks_for(missing):
    line = position_line(homed=missing != "home")
    task(line, 7, 2.0)
    if missing == "position mode":
        write(line, 930, WORD, 1)
    zsw1 = line.send(START, SATZANW=8 if missing == "task" else 7, frames=20)
    assert not zsw1 & ACKNOWLEDGED
    assert line.place == pytest.approx(0.0, abs=0.01)


def test_5_10_1_bit_5_interrupts_a_task_and_bit_4_rejects_it():
    line = position_line()
    task(line, 7, 10.0)
    line.send(START, SATZANW=7, frames=20)
    assert line.send(READY & ~0x0020, frames=20) & (STOPPED | ACTIVE) == STOPPED | ACTIVE
    held = line.place
    line.send(READY & ~0x0020, frames=20)
    assert line.place == pytest.approx(held, abs=0.01)
    assert not line.send(READY) & STOPPED, "and goes on"
    assert line.send(READY & ~0x0010, frames=20) & (STOPPED | ACTIVE | REACHED) == STOPPED
    held = line.place
    line.send(READY, frames=30)
    assert line.place == pytest.approx(held, abs=0.01)
    assert held < 9.0


def test_5_10_1_tasks_are_chained_over_frames():
    line = position_line()
    task(line, 1, 1.0, control=0x30, following=2, wait=200)
    task(line, 2, -1.0)
    line.send(START, SATZANW=1)
    seen = [1]
    begun = line.world.now
    while not line.zsw1 & REACHED:
        line.run(0.016)
        assert line.world.now - begun < 10e9
        if line.actual("AKTSATZ") != seen[-1]:
            seen.append(line.actual("AKTSATZ"))
    assert seen[:2] == [1, 2]
    assert line.place == pytest.approx(-1.0, abs=0.02)


def test_5_10_1_a_chain_into_a_task_that_cannot_begin_is_a_warning_and_bit_10_of_motionstat():
    line = position_line()
    store = line.farm.axes[0].store
    task(line, 1, 1.0, control=0x30, following=2)
    line.send(START, SATZANW=1)
    line.send(READY, frames=60)
    assert line.zsw1 & (REACHED | 0x0080) == REACHED | 0x0080
    assert store.get("DRV.MOTIONSTAT") & 0x0C00 == 0x0C00
    assert store.get("DRV.WARNING1") == 154
    line.send(START, SATZANW=3)
    assert store.get("DRV.WARNING1") == 160
    store.set("DRV.CLRFAULTS", 1)
    assert not line.send(READY) & 0x0080


def test_a_task_ends_when_operation_does_and_motion_tasks_stay_for_the_next_time():
    line = position_line()
    task(line, 7, 10.0)
    line.send(START, SATZANW=7, frames=20)
    line.send(0x043E, frames=60)
    assert line.zsw1 & 0x0007 == 0x0001
    held = line.place
    for word in (0x0437, READY):
        line.send(word, frames=10)
    assert line.place == pytest.approx(held, abs=0.01)
    assert not line.zsw1 & (ACTIVE | REACHED)
    line.send(START, frames=10)
    line.until(REACHED)
    assert line.place == pytest.approx(10.0, abs=0.02)


def test_a_fault_in_a_task_sets_bit_3_and_the_home_position_stays_known():
    line = position_line()
    task(line, 7, 10.0)
    line.send(START, SATZANW=7, frames=10)
    line.farm.axes[0].raise_fault(301, hold=False)
    line.send(READY, frames=40)
    assert line.zsw1 & (FAULT | ACTIVE | HOMED) == FAULT | HOMED
    assert line.axis.motor.velocity == pytest.approx(0.0, abs=0.1)
    assert line.send(0x04B6) & 0x004F == 0x0001, "acknowledged, and bit 0 is withdrawn already: S2"


def test_motion_tasks_and_parameters_outlive_a_power_cycle_once_drv_nvsave_was_written():
    memory = VolatileMemory()
    line = position_line(memory=memory)
    task(line, 7, 2.0)
    write(line, 1002, WORD, 20)
    write(line, 2469, BYTE, 1)
    task(line, 8, 3.0)
    station = line.farm.axes[0]
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    assert list(line.axis.motion_tasks.settings.kind.nonzero()[0]) == [7]
    assert station.store.get("DRV.OPMODE") == 2
    again = HandLine(telegram=7, memory=memory)
    assert value_of(again, 1002) == (20,)
    assert list(again.axis.motion_tasks.settings.kind.nonzero()[0]) == [7]


# 5.10.2: manual data input


def test_5_10_2_a_task_by_mdi_is_acknowledged_runs_and_reaches_its_target():
    line = position_line(9)
    assert line.send(READY, MDI_TARPOS=2 * COUNTS, **MDI) & (STOPPED | ACKNOWLEDGED) == STOPPED
    assert line.actual("AKTSATZ") & 0x8000
    assert line.send(START) & (ACKNOWLEDGED | STOPPED | ACTIVE) == ACKNOWLEDGED | ACTIVE
    assert not line.send(READY) & ACKNOWLEDGED, "the drive clears bit 12 with bit 6"
    line.until(REACHED | STOPPED)
    line.run(0.2)
    assert line.actual("XIST_A") == pytest.approx(2 * COUNTS, abs=200)


def test_5_10_2_change_on_the_fly_needs_bit_6_to_fall_and_rise():
    line = position_line(9)
    line.send(START, MDI_TARPOS=5 * COUNTS, **MDI)
    line.send(READY, MDI_TARPOS=8 * COUNTS)
    assert line.axis.profile.target - line.axis.homing.origin == pytest.approx(5.0, abs=0.001), "the target of the edge"
    assert line.send(START) & ACKNOWLEDGED
    line.send(READY)
    assert line.axis.profile.target - line.axis.homing.origin == pytest.approx(8.0, abs=0.001)
    line.until(REACHED | STOPPED)
    line.run(0.2)
    assert line.place == pytest.approx(8.0, abs=0.01)


def test_5_7_mdi_mod_bit_0_makes_a_target_absolute_and_0_a_way():
    line = position_line(9)
    for _ in range(2):
        line.send(START, MDI_TARPOS=-COUNTS, **{**MDI, "MDI_MOD": 0}, frames=6)
        line.send(READY)
        line.until(REACHED | STOPPED)
    line.run(0.2)
    assert line.place == pytest.approx(-2.0, abs=0.01)
    line.send(START, MDI_TARPOS=-COUNTS, **MDI, frames=6)
    line.until(REACHED | STOPPED)
    line.run(0.2)
    assert line.place == pytest.approx(-1.0, abs=0.01)


@pytest.mark.parametrize("wrong", [{"MDI_VELOCITY": 0}, {"MDI_ACC": 0}, {"MDI_DEC": 0}, {"SATZANW": 0}])
def test_5_10_2_a_task_that_cannot_be_executed_never_sets_bit_12(wrong):
    line = position_line(9)
    assert not line.send(START, MDI_TARPOS=COUNTS, **{**MDI, **wrong}, frames=20) & (ACKNOWLEDGED | ACTIVE)
    assert line.place == pytest.approx(0.0, abs=0.01)


def test_5_8_a_set_point_by_its_pnu_outlasts_the_connection_and_not_the_supply():
    line = position_line(352)
    words = {name: value for name, value in MDI.items() if name != "MDI_ACC"}
    line.send(READY, **words)
    write(line, 36, WORD, 39)
    store = line.farm.axes[0].store
    assert store.read(35) == [words["MDI_VELOCITY"]]
    faults = line.farm.injections
    faults.inject({"kind": "ar-abort", "on": "all"}, line.world.now)
    line.run(0.1)
    assert not line.farm.axes[0].device.ars
    assert (store.read(35), store.read(36)) == ([0], [39]), "MDI_VELOCITY came by frames and went with them"
    line.connect()
    line.send(READY | 0x80, **words)
    line.enable_axis(READY)
    assert line.send(START, MDI_TARPOS=COUNTS, frames=10) & ACKNOWLEDGED
    line.farm.axes[0].station.power_cycle(line.world.now)
    line.run(0.1)
    assert line.farm.axes[0].store.read(36) == [0]


def test_5_11_10_a_set_point_that_leaves_the_mapping_is_zero():
    line = HandLine(telegram=400)
    store = line.farm.axes[0].store
    line.send(0x0406, SATZANW=0x8000, MDI_ACC=39)
    assert (store.read(32), store.read(36)) == ([0x8000], [39])
    store.write(915, 7, [0])
    assert value_of(line, 922) == (400,)
    line.run(0.1)
    assert (store.read(32), store.read(36)) == ([0x8000], [0])


# 5.10.3: homing


def test_5_10_3_homing_by_bit_11_with_home_mode_by_pnu_1001():
    line = position_line(homed=False)
    write(line, 1001, WORD, 7)
    assert value_of(line, 2203) == (7,), "HOME.MODE under its second number"
    write(line, 2205, DWORD, REVOLUTION)
    write(line, 2210, DWORD, 30_000)
    line.axis.motor.position = line.axis.profile.position = line.axis.profile.raw_position = 0.3
    assert line.send(HOME, frames=6) & (REACHED | HOMED | STOPPED) == 0
    assert line.actual("AKTSATZ") == 0
    line.until(REACHED | HOMED | STOPPED)
    line.run(0.2)
    assert line.place == pytest.approx(1.0, abs=0.01)


def test_5_10_3_homing_that_is_aborted_leaves_bit_11_cleared():
    line = position_line(homed=False)
    write(line, 1001, WORD, 7)
    write(line, 2210, DWORD, 6_000)
    line.send(HOME, frames=10)
    line.send(READY, frames=40)
    assert line.zsw1 & (HOMED | STOPPED) == STOPPED
    task(line, 7, 1.0)
    assert not line.send(START, SATZANW=7) & ACKNOWLEDGED


def test_5_10_3_home_move_by_its_parameter_does_what_bit_11_does():
    line = position_line(homed=False)
    write(line, 2204, BYTE, 1)
    line.run(0.1)
    assert line.zsw1 & HOMED


def test_5_11_8_telegram_353_brings_homing_distance_and_mode():
    line = position_line(353, homed=False)
    line.send(HOME, HOME_MODE=7, HOME_DIST=-COUNTS // 2, frames=6)
    assert not line.zsw1 & HOMED
    line.until(HOMED | STOPPED | REACHED)
    line.run(0.2)
    assert line.place == pytest.approx(-0.5, abs=0.01)
    line.send(READY)
    line.send(HOME, HOME_MODE=0, frames=6)
    assert line.zsw1 & HOMED
    assert line.place == pytest.approx(0.0, abs=0.01), "mode 0: where it stands"


# 5.4: jogging in position mode


def test_5_4_jog_1_and_2_in_position_mode_clear_bits_10_and_13():
    line = position_line()
    for pnu, value in ((1004, 1638), (1005, -819), (1006, 40), (1007, 40)):
        write(line, pnu, WORD, value)
    assert line.send(0x050F, frames=20) & (REACHED | STOPPED) == 0
    assert line.axis.motor.velocity == pytest.approx(600.0, abs=1.0)
    assert line.send(0x040F, frames=20) & STOPPED
    line.send(0x060F, frames=20)
    assert line.axis.motor.velocity == pytest.approx(-300.0, abs=1.0)


def test_5_4_real_time_jogging_takes_mdi_data_and_the_direction_of_bit_13():
    line = position_line(9)
    line.send(0x143F, **MDI, frames=20)
    assert line.axis.motor.velocity == pytest.approx(600.0, abs=1.0)
    line.send(0x343F, frames=30)
    assert line.axis.motor.velocity == pytest.approx(-600.0, abs=1.0)
    line.send(0x343F, MDI_VELOCITY=2**32 // 40, frames=20)
    assert line.axis.motor.velocity == pytest.approx(-300.0, abs=1.0)
    assert line.send(READY, frames=20) & STOPPED


# 5.8, 5.11: free mapping


def map_words(line: VirtualLine, pnu: int, numbers: list[int]) -> None:
    """Map every word of one direction again, by one request."""
    values = ParameterValues(WORD, tuple(numbers))
    answer = access(line, emit_request(change_request(7, [(ParameterAddress(pnu, 0, len(numbers)), values)])))
    assert answer is not None
    assert not parse_response(answer).negative


def test_5_11_10_telegram_400_carries_feedrate_motion_status_and_inputs_by_pnu_915_and_916():
    line = HandLine(telegram=400, params="{DRV.OPMODE: 2}")
    map_words(line, 915, [1, 32, 101] + [0] * 9)
    map_words(line, 916, [2, 33, 105, 105, 106, 104, 104] + [0] * 5)
    assert value_of(line, 915, 0, 4) == (1, 32, 101, 0)
    assert value_of(line, 916, 0, 8) == (2, 33, 105, 105, 106, 104, 104, 0)
    line.enable_axis(READY)
    line.send(HOME)
    line.send(READY)
    task(line, 3, 20.0)
    # the controller fills its frames as the default mapping has them: its third word, STW2, is MT_FEEDRATE now
    line.send(START, SATZANW=3, STW2=50, frames=20)
    assert line.axis.motor.velocity == pytest.approx(300.0, abs=1.0)
    line.send(READY, STW2=100, frames=20)
    assert line.axis.motor.velocity == pytest.approx(600.0, abs=1.0)
    # and its words 3 to 5 are motion status and inputs: task active, homed, at speed; STO.STATE
    motion = line.actual("ZSW2") << 16 | line.actual("XIST_A") >> 16 & 0xFFFF
    assert motion == 0x1007
    assert line.actual("XIST_A") & 0xFFFF == 0x0040


def test_5_11_1_telegram_0_is_mapped_by_pnu_915_and_916_while_the_controller_is_connected():
    line = HandLine(telegram=0)
    write(line, 915, WORD, 1)
    answer = access(line, changing(916, WORD, 6))
    assert answer is not None
    assert not parse_response(answer).negative
    assert value_of(line, 915, 0, 2) == (1, 0)
    assert value_of(line, 916, 0, 2) == (6, 0)
    assert value_of(line, 922) == (0,)
    station = line.farm.axes[0]
    assert len(station.store.output_words()) == 12


def test_5_11_pnu_922_cannot_name_another_telegram_than_the_module_in_slot_1():
    line = HandLine(telegram=1)
    answer = access(line, changing(922, WORD, 9))
    assert answer is not None
    assert parse_response(answer).negative
    assert value_of(line, 922) == (1,)
    assert value_of(line, 2157) == (1,), "FBUS.PARAM01"


@pytest.mark.parametrize("telegram", [0, 1, 7, 9, 350, 351, 352, 353, 354, 400])
def test_5_11_every_telegram_connects_at_16_ms_and_reads_back_by_pnu_922(telegram):
    line = HandLine(telegram=telegram)
    assert value_of(line, 922) == (telegram,)
    assert line.farm.axes[0].station.config.strict


def test_5_11_6_telegram_351_brings_velocity_current_and_position():
    line = HandLine(telegram=351)
    line.enable_axis(0x047F)
    line.send(0x047F, NSOLL_A=1638, frames=40)
    assert line.actual("NIST_A") == 1638
    # a part of the 9 A of DRV.IPEAK: friction alone is to be overcome
    assert 0 < line.actual("ITIST_GLATT") < 2**14 // 9
    # a frame is as old as the cycle at most: a sixth of a revolution at 600 rpm
    assert line.actual("XIST_A") / COUNTS == pytest.approx(line.place, abs=0.17)
    assert line.place > 5.0


# 5.15, 6.4, 8.1: the controller's life


def test_6_4_pn_timeoutfthresh_is_the_watchdog_of_the_connection():
    line = HandLine(watchdog=5)
    assert value_of(line, 3022) == (80,)


def test_5_15_fbus_param02_bit_0_decides_on_fault_702_when_the_plc_stops():
    for value in (0, 1):
        line = HandLine()
        write(line, 2158, DWORD, value)
        line.enable_axis(0x047F)
        line.plc.columns.ppm[0].data_status &= ~DataStatus.RUN & 0xFF
        line.run(0.3)
        assert line.farm.axes[0].fault_counts == ({702: 1} if value else {})
        assert line.axis.drive.state == 1


def test_8_1_frames_that_the_network_loses_are_fault_702_unless_the_watchdog_bears_it():
    for watchdog, faults in ((3, {702: 1}), (16, {})):
        line = HandLine(watchdog=watchdog)
        line.enable_axis(0x047F)
        line.plc.columns.ppm[0].active = 0
        line.run(0.16)
        line.plc.columns.ppm[0].active = 1
        line.run(0.1)
        assert line.farm.axes[0].fault_counts == faults


def test_5_14_the_fault_counter_is_the_same_before_and_after_reading_the_buffer_unless_one_came():
    line = HandLine()
    station = line.farm.axes[0]
    before = value_of(line, 944)
    assert value_of(line, 947, 0, 64) == (0,) * 64
    assert value_of(line, 944) == before
    station.raise_fault(301, hold=False)
    line.run(0.05)
    assert value_of(line, 947, 0, 8) == (301, 0, 0, 0, 0, 0, 0, 0)
    assert value_of(line, 944) == (before[0] + 1,)


def test_a_request_with_sixteen_commands_and_a_restart_restarts_the_drive():
    line = HandLine()
    clear, restart = ((ParameterAddress(pnu, 0, 1), ParameterValues(DWORD, (1,))) for pnu in (2112, 3013))
    request = emit_request(change_request(1, [*[clear] * 16, restart]))
    (session,) = line.plc.sessions
    session.machine.write_record("write", API, 1, 1, 47, request)
    line.plc.touch(session, line.world.now)
    line.run(2.0)
    assert line.farm.axes[0].powered
    assert line.events("axis-01").count("power on") == 1
    line.connect()


def test_5_13_a_fault_sends_no_alarm():
    line = HandLine()
    line.farm.axes[0].raise_fault(301, hold=False)
    line.run(0.5)
    assert line.zsw1 & FAULT
    assert not [entry for entry in line.plc_log.entries("axis-01") if "alarm" in entry.event]


def test_3_6_one_request_takes_39_parameters_and_not_40():
    line = HandLine()
    most = access(line, reading(*[(930, 0, 1)] * 39))
    assert most is not None
    assert len(parse_response(most).entries) == 39
    more = access(line, reading(*[(930, 0, 1)] * 40))
    assert more is not None
    assert parse_response(more).negative


# 4.2, 5.2: what the drive denies


def test_5_2_clock_synchronous_operation_is_not_there_to_be_switched_on():
    line = HandLine()
    session = line.plc.sessions[0]
    line.plc.records.clear()
    # IsochronousModeData
    session.machine.write_record("write", 0x3A00, 1, 2, 0x8030, bytes(28))
    line.plc.touch(session, line.world.now)
    line.world.run(1.0, until=lambda: bool(line.plc.records))
    ((_, done),) = line.plc.records
    assert not done.ok
    assert line.plc.all_connected
