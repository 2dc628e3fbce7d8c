"""Motion by assemblies (AKD EtherNet/IP manual 6.2.2, 6.3 to 6.5): moves, jogs, torque, motion tasks, stops, homing."""

from __future__ import annotations

import pytest
from assembly_bench import (
    ENABLE,
    FORWARDS,
    HARD_STOP,
    JOG,
    LOAD,
    MOVE,
    POSITION,
    RELATIVE,
    REVOLUTION,
    SMOOTH_STOP,
    START_BLOCK,
    TORQUE,
    TORQUE_MODE,
    VELOCITY,
    AssemblyBench,
    command,
)

from pnfarm.drives.motion_tasks import MotionTask
from pnfarm.table.axis_codes import CMD_RAISE_FAULT, REACTION_QUICK_STOP
from pnfarm.table.image import LOST_CLOSED, LOST_EXPIRED, LOST_STOP

IN_MOTION, BLOCK, IN_POSITION, FAULT, DIRECTION, HOMED = 0x01, 0x02, 0x04, 0x08, 0x10, 0x20
#: 600 rpm, and 6000 rpm/s.
FAST = {"velocity": 10 * REVOLUTION, "up": 100 * REVOLUTION, "down": 100 * REVOLUTION}


def bench(mode: int = POSITION, *, homed: bool = True) -> AssemblyBench:
    drive = AssemblyBench(mode, homed=homed)
    assert drive.enable()[0] & ENABLE
    return drive


def speed(drive: AssemblyBench) -> float:
    return float(drive.axis.motor.velocity)


def turns(drive: AssemblyBench) -> float:
    return float(drive.axis.motor.position - drive.axis.homing.origin)


# 6.2.2.2


def test_the_enable_bit_switches_on_and_off() -> None:
    drive = AssemblyBench()
    assert not drive.send(command(0), 20)[0] & ENABLE
    assert drive.send(command(ENABLE), 5)[0] & ENABLE
    assert not drive.send(command(0), 2)[0] & ENABLE


def test_a_fault_takes_the_enable_away_until_it_rises_again() -> None:
    drive = bench()
    drive.store.handle.push_command(CMD_RAISE_FAULT, 501)
    drive.run(5)
    assert drive.first & FAULT
    assert not drive.first & ENABLE
    drive.store.set("DRV.CLRFAULTS", 1)
    drive.run(20)
    assert not drive.first & FAULT
    assert not drive.first & ENABLE
    assert drive.enable()[0] & ENABLE


def test_a_hard_stop_brakes_along_cs_dec_switches_off_and_needs_enable_cleared() -> None:
    drive = bench(VELOCITY)
    drive.load(ENABLE | FORWARDS, JOG, 300, **FAST)
    assert speed(drive) == pytest.approx(600, abs=5)
    drive.send(command(ENABLE | HARD_STOP), 20)
    assert 300 < speed(drive) < 500, "10000 rpm/s, the default of CS.DEC"
    drive.run(200)
    assert not drive.first & (ENABLE | IN_MOTION)
    assert not drive.send(command(ENABLE), 100)[0] & ENABLE
    assert drive.enable()[0] & ENABLE


def test_a_smooth_stop_brakes_along_the_loaded_ramp_and_stays_enabled() -> None:
    drive = bench(VELOCITY)
    drive.load(ENABLE | FORWARDS, JOG, 300, **FAST)
    drive.send(command(ENABLE | SMOOTH_STOP), 50)
    assert speed(drive) == pytest.approx(300, abs=30)
    assert drive.first & IN_MOTION
    drive.run(150)
    assert drive.first & ENABLE
    assert not drive.first & IN_MOTION
    # the jog does not come back by itself
    assert not drive.send(command(ENABLE), 100)[0] & IN_MOTION


# 6.3


def test_6_3_a_jog_turns_at_the_speed_in_the_direction_of_its_bit_and_tells_so() -> None:
    drive = bench(VELOCITY)
    drive.load(ENABLE | FORWARDS, JOG, 300, **FAST)
    assert drive.signed(12) == pytest.approx(10 * REVOLUTION, rel=0.01)
    assert drive.first & (IN_MOTION | DIRECTION | IN_POSITION) == IN_MOTION | DIRECTION
    drive.load(ENABLE, JOG, 500, **FAST)
    assert drive.signed(12) == pytest.approx(-10 * REVOLUTION, rel=0.01)
    assert drive.first & (IN_MOTION | DIRECTION) == IN_MOTION
    drive.load(ENABLE, JOG, 500, **FAST | {"velocity": 0})
    assert drive.first & (IN_MOTION | IN_POSITION) == IN_POSITION


def test_6_3_a_jog_accelerates_as_it_was_loaded() -> None:
    drive = bench(VELOCITY)
    drive.load(ENABLE | FORWARDS, JOG, 51, **FAST)
    assert speed(drive) == pytest.approx(300, abs=25)


def test_6_2_2_2_a_target_velocity_alone_starts_a_jog_in_velocity_mode() -> None:
    drive = bench(VELOCITY)
    drive.load(ENABLE | FORWARDS, 0x02, 500, data=5 * REVOLUTION)
    assert speed(drive) == pytest.approx(300, abs=5)


# 6.4


def test_6_4_3_a_position_move_goes_to_its_target_and_tells_so() -> None:
    drive = bench()
    drive.load(ENABLE, MOVE, position=3 * REVOLUTION, **FAST)
    assert drive.first & (IN_MOTION | IN_POSITION) == IN_MOTION, "from the first step on"
    drive.run(200)
    assert drive.first & DIRECTION
    drive.run(1000)
    assert drive.first & (IN_MOTION | IN_POSITION | HOMED) == IN_POSITION | HOMED
    assert drive.signed(8) == pytest.approx(3 * REVOLUTION, abs=700)
    assert not drive.first & BLOCK


def test_6_4_3_a_new_target_interrupts_the_move_and_a_relative_one_counts_on() -> None:
    drive = bench()
    drive.load(ENABLE, MOVE, 100, position=10 * REVOLUTION, **FAST)
    drive.load(ENABLE, MOVE, 1500, position=-REVOLUTION, **FAST)
    assert turns(drive) == pytest.approx(-1.0, abs=0.02)
    drive.load(ENABLE | RELATIVE, MOVE, 1000, position=-2 * REVOLUTION, **FAST)
    assert turns(drive) == pytest.approx(-3.0, abs=0.02)


def test_6_4_3_a_position_move_is_motion_task_0_once_it_was_reported() -> None:
    drive = bench()
    drive.load(ENABLE, MOVE, position=3 * REVOLUTION, **FAST)
    assert int(drive.image.parameter_task) >> 24 & 0xFF == 4
    assert int(drive.image.parameter_task) != int(drive.image.parameter_answered)


def test_6_2_2_5_a_jog_in_position_mode_blends_into_a_move_without_a_stop() -> None:
    drive = bench()
    drive.load(ENABLE | FORWARDS, JOG, 300, **FAST)
    assert speed(drive) == pytest.approx(600, abs=10)
    assert drive.first & IN_MOTION
    place = turns(drive)
    drive.send(command(ENABLE, MOVE))
    target = round((place + 5.0) * REVOLUTION)
    drive.send(command(ENABLE | LOAD, MOVE, position=target, **FAST))
    slowest = min((drive.run(10), speed(drive))[1] for _ in range(20))
    assert slowest > 550
    drive.run(1000)
    assert drive.signed(8) == pytest.approx(target, abs=700)
    drive.load(ENABLE, JOG, 300, **FAST)
    assert speed(drive) == pytest.approx(-600, abs=10)
    drive.send(command(ENABLE | SMOOTH_STOP), 300)
    assert drive.first & (IN_MOTION | ENABLE) == ENABLE


def test_6_2_2_5_a_relative_move_that_a_jog_in_position_mode_blends_into_counts_from_the_axis() -> None:
    drive = bench()
    drive.load(ENABLE | FORWARDS, JOG, 300, **FAST)
    drive.send(command(ENABLE | RELATIVE, MOVE))
    place = turns(drive)
    drive.send(command(ENABLE | RELATIVE | LOAD, MOVE, position=5 * REVOLUTION, **FAST), 2000)
    assert turns(drive) == pytest.approx(place + 5.0, abs=0.05)


def test_6_2_2_4_a_relative_move_beyond_a_software_limit_is_refused_by_where_it_counts_from() -> None:
    """With the reading ``here`` of ``relative-task`` it counts from the axis, not from the running move's target."""
    drive = AssemblyBench(POSITION, behaviour={"relative-task": "here"})
    drive.enable()
    drive.store.set("SWLS.LIMIT1", 12 * 2**32)
    drive.store.set("SWLS.EN", 2)
    drive.load(ENABLE, MOVE, 100, position=10 * REVOLUTION, **FAST)
    drive.load(ENABLE | RELATIVE, MOVE, position=5 * REVOLUTION, **FAST)
    assert drive.error == (0, 0)
    drive.run(2000)
    assert turns(drive) < 7.0


def test_6_2_2_an_axis_that_is_not_homed_gets_a_fault_that_must_be_cleared() -> None:
    drive = bench(homed=False)
    drive.load(ENABLE, MOVE, 20, position=REVOLUTION, **FAST)
    assert drive.first & FAULT
    assert abs(turns(drive)) < 0.01
    assert drive.store.get("DRV.FAULT1") == 139
    drive.store.set("DRV.CLRFAULTS", 1)
    drive.axis.homing.homed = 1
    drive.enable()
    drive.load(ENABLE, MOVE, 500, position=REVOLUTION, **FAST)
    assert turns(drive) == pytest.approx(1.0, abs=0.02)


def test_6_4_2_homing_sets_the_homed_bit() -> None:
    drive = bench(homed=False)
    assert not drive.first & HOMED
    drive.store.set("HOME.MOVE", 1)
    drive.run(50)
    assert drive.first & HOMED


def with_tasks(drive: AssemblyBench) -> AssemblyBench:
    drive.store.keep_task(MotionTask(5, 2.0, 600.0, 6000.0, 6000.0, following=7))
    drive.store.keep_task(MotionTask(7, 1.0, 600.0, 6000.0, 6000.0))
    return drive


def test_6_4_4_a_stored_task_and_the_one_behind_it_run_and_their_numbers_are_shown() -> None:
    drive = with_tasks(bench())
    drive.send(command(ENABLE, block=5))
    drive.send(command(ENABLE | START_BLOCK, block=5), 20)
    assert drive.first & (BLOCK | IN_MOTION) == BLOCK | IN_MOTION
    assert drive.response[1] == 5
    drive.run(400)
    assert drive.response[1] == 7
    drive.run(600)
    assert not drive.first & BLOCK
    assert drive.response[1] == 0
    assert turns(drive) == pytest.approx(1.0, abs=0.02)


def test_6_4_4_a_smooth_stop_ends_a_sequence() -> None:
    drive = with_tasks(bench())
    drive.send(command(ENABLE | START_BLOCK, block=5), 100)
    drive.send(command(ENABLE | SMOOTH_STOP), 500)
    assert not drive.first & (BLOCK | IN_MOTION)
    assert drive.first & ENABLE
    stood = turns(drive)
    drive.send(command(ENABLE), 300)
    assert turns(drive) == pytest.approx(stood, abs=0.01)


def test_6_2_2_2_a_block_does_not_start_while_load_start_is_set() -> None:
    drive = with_tasks(bench())
    drive.send(command(ENABLE | LOAD, 0x02, data=1))
    drive.send(command(ENABLE | LOAD | START_BLOCK, 0x02, block=5, data=1), 50)
    assert not drive.first & BLOCK


# 6.5


def test_6_5_a_torque_in_milliamperes_acts_at_once_and_is_read_back() -> None:
    drive = bench(TORQUE_MODE)
    drive.load(ENABLE, TORQUE, 20, data=1500, response=0x05)
    assert drive.signed(4) == pytest.approx(1500, abs=20)
    assert drive.response[3] == 0x25
    assert drive.first & (IN_MOTION | IN_POSITION) == IN_MOTION
    assert speed(drive) > 50
    drive.load(ENABLE, TORQUE, 20, data=-1500, response=0x05)
    assert drive.signed(4) == pytest.approx(-1500, abs=20)


def test_6_5_a_smooth_stop_brakes_in_torque_mode_and_stays_enabled() -> None:
    drive = bench(TORQUE_MODE)
    drive.load(ENABLE, TORQUE, 100, data=2000)
    turning = speed(drive)
    assert turning > 500
    drive.send(command(ENABLE | SMOOTH_STOP), 2000)
    assert drive.first & (IN_MOTION | ENABLE) == ENABLE
    assert abs(speed(drive)) < 1.0


# 6.2.3


def test_6_2_3_3_limits_by_software_and_by_switch_have_their_bits() -> None:
    drive = bench()
    for switch, bit in ((0x1, 0x04), (0x2, 0x02)):
        drive.axis.machine.settings.parts = 0
        drive.axis.machine.limit_switch = switch
        drive.store.set("SWLS.EN", 0)
        found = drive.second
        drive.axis.machine.limit_switch = 0
        assert found in {0, bit}
    drive.store.set("SWLS.LIMIT0", 0)
    drive.store.set("SWLS.LIMIT1", 4 << 32)
    drive.store.set("SWLS.EN", 3)
    drive.run(2)
    assert drive.second & 0x18 == 0x10
    drive.load(ENABLE, MOVE, 1500, position=4 * REVOLUTION, **FAST)
    assert drive.second & 0x18 == 0x08
    drive.load(ENABLE, MOVE, position=5 * REVOLUTION, **FAST)
    assert drive.error == (0x09, 0xFF)


def test_6_2_3_1_motion_status_is_drv_motionstat() -> None:
    drive = bench()
    drive.load(ENABLE, MOVE, 20, position=3 * REVOLUTION, **FAST)
    assert drive.signed(16) == drive.store.get("DRV.MOTIONSTAT")
    assert drive.signed(16) & 0x7 == 0x7


# 8


def test_8_units_scale_positions_speeds_and_ramps() -> None:
    drive = bench()
    drive.store.set("EIP.POSUNIT", 1 << 22)
    drive.store.set("EIP.PROFUNIT", 1 << 24)
    drive.load(ENABLE, MOVE, position=2 << 10, velocity=10 << 8, up=100 << 8, down=100 << 8)
    drive.run(51)
    assert speed(drive) == pytest.approx(300, abs=25)
    assert drive.signed(12) == pytest.approx(5 << 8, rel=0.1)
    drive.run(1000)
    assert turns(drive) == pytest.approx(2.0, abs=0.02)
    assert drive.signed(8) == pytest.approx(2 << 10, abs=12)


# 5.3


def test_5_3_data_that_stop_raise_f702_and_the_axis_brakes_and_goes_off() -> None:
    drive = bench(VELOCITY)
    drive.load(ENABLE | FORWARDS, JOG, 300, **FAST)
    drive.lose(LOST_EXPIRED)
    assert drive.first & FAULT
    assert drive.store.get("DRV.FAULT1") == 702
    drive.run(20)
    assert 200 < speed(drive) < 590, "a controlled stop"
    drive.run(500)
    assert not drive.first & ENABLE
    assert abs(speed(drive)) < 1.0


@pytest.mark.parametrize("why", [LOST_STOP, LOST_CLOSED])
def test_an_idle_controller_and_a_closed_connection_switch_off_without_a_fault(why: int) -> None:
    drive = bench(VELOCITY)
    drive.load(ENABLE | FORWARDS, JOG, 300, **FAST)
    drive.lose(why, 5)
    assert not drive.first & (FAULT | ENABLE)
    # an Enable that was set all the time counts as its edge when data are valid again
    assert drive.send(command(ENABLE), 5)[0] & ENABLE


def test_fault_702_is_not_raised_while_its_parameter_switches_it_off() -> None:
    drive = bench(VELOCITY)
    drive.store.set("FAULT702.ACTION", 1)
    drive.lose(LOST_EXPIRED, 5)
    assert not drive.first & FAULT


# attributes of the position controller as settings


def test_7_1_a_trajectory_started_by_attribute_goes_to_its_target() -> None:
    drive = bench()
    settings = drive.axis.ethernetip.settings
    settings.target, settings.velocity, settings.targets_set = 2 * REVOLUTION, 10 * REVOLUTION, 1
    settings.starts = 1
    drive.run(2000)
    assert turns(drive) == pytest.approx(2.0, abs=0.02)


def test_7_1_enable_by_attribute_counts_while_no_controller_sends_assemblies() -> None:
    drive = AssemblyBench()
    settings = drive.axis.ethernetip.settings
    settings.enable, settings.enables = 1, 1
    drive.run(10)
    assert drive.first & ENABLE
    assert not drive.send(command(0), 2)[0] & ENABLE, "the assembly's bit decides"
    drive.lose(LOST_CLOSED, 10)
    assert not drive.first & ENABLE


def test_7_1_enable_cleared_by_attribute_ends_operation_until_the_bit_rises() -> None:
    drive = bench()
    settings = drive.axis.ethernetip.settings
    settings.enable, settings.enables = 0, 1
    drive.run(10)
    assert not drive.first & ENABLE
    assert drive.enable()[0] & ENABLE


def test_drv_dis_ends_operation_until_the_bit_rises() -> None:
    drive = bench()
    drive.store.set("DRV.DIS", 1)
    drive.run(20)
    assert not drive.first & ENABLE
    assert drive.enable()[0] & ENABLE


def test_6_6_every_fault_of_the_product_is_shown_and_stops_the_drive_as_its_row_says() -> None:
    drive = bench(VELOCITY)
    for fault in [fault for fault in drive.store.model.faults.values() if not fault.warning]:
        drive.load(ENABLE | FORWARDS, JOG, 100, **FAST)
        drive.store.handle.push_command(CMD_RAISE_FAULT, fault.code)
        drive.run(1)
        assert drive.first & FAULT, fault
        assert (int(drive.axis.drive.state) == 5) is (fault.reaction == REACTION_QUICK_STOP), fault
        assert drive.store.get("DRV.FAULT1") == fault.number
        drive.run(200)
        assert not drive.first & ENABLE, fault
        drive.store.set("DRV.CLRFAULTS", 1)
        drive.axis.motor.velocity = 0.0
        assert drive.enable()[0] & (ENABLE | FAULT) == ENABLE, fault
