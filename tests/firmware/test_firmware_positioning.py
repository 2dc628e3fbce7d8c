"""Position mode: traversing tasks by MDI, intermediate stop, homing, jogging, limits."""

import math

import pytest
from positioner import (
    ACCELERATION_UNIT,
    ACKNOWLEDGED,
    ACTIVE,
    COUNTS,
    HOME,
    HOMED,
    ON_TARGET,
    READY,
    START,
    STOPPED,
    Positioner,
)

from pnfarm.firmware.motion import positioning
from pnfarm.table.axis_codes import (
    CMD_START_TASK,
    HOME_MARK,
    REACTION_QUICK_STOP,
    TASK_DEFINED,
    TASKS_POS_STW,
    TASKS_TARPOS,
)
from pnfarm.table.signals import (
    DRIVE_INPUTS,
    HOME_DIST,
    HOME_MODE,
    MDI_ACC,
    MDI_DEC,
    MDI_VELOCITY,
    OVERRIDE,
    POS_STW1,
    POS_STW2,
    POS_ZSW1,
    POS_ZSW2,
    SATZANW,
    STW1,
    TARPOS_A,
    VELOCITY_A,
)


def test_a_task_moves_to_its_absolute_target_and_shows_it_in_zsw1():
    drive = Positioner()
    assert drive.zsw1 & (ON_TARGET | HOMED | ACKNOWLEDGED | STOPPED | ACTIVE) == ON_TARGET | HOMED | STOPPED
    drive.data(3.0)
    assert drive.stw(START) & (ACKNOWLEDGED | ACTIVE | ON_TARGET) == ACKNOWLEDGED | ACTIVE
    assert not drive.stw(START, 10) & STOPPED
    drive.stw(READY)
    took = drive.until(ON_TARGET | STOPPED)
    # 10 rev/s with 500 rev/s^2: 3 rev take 0.32 s; what is left is the position controller's
    assert took == pytest.approx(320, abs=150)
    assert drive.place == pytest.approx(3.0, abs=2e-3)
    assert not drive.zsw1 & ACTIVE


def test_a_relative_task_counts_from_where_the_last_one_led():
    drive = Positioner()
    for _ in range(3):
        drive.move(-1.5, relative=True)
        drive.settle()
    assert drive.place == pytest.approx(-4.5, abs=2e-3)


def test_velocity_and_acceleration_stay_at_what_the_task_says():
    drive = Positioner()
    drive.move(20.0, velocity=1200.0, up=12_000.0, down=6_000.0)
    before, top, most_up, most_down = float(drive.axis.profile.velocity), 0.0, 0.0, 0.0
    while not drive.zsw1 & ON_TARGET:
        drive.run(1)
        command = float(drive.axis.profile.velocity)
        most_up, most_down = max(most_up, command - before), max(most_down, before - command)
        top, before = max(top, command), command
    assert top == pytest.approx(1200.0, rel=1e-4)
    # in rpm each millisecond, as the nearest increments have it
    assert most_up == pytest.approx(16 * ACCELERATION_UNIT / 1000, rel=1e-6)
    assert most_down == pytest.approx(8 * ACCELERATION_UNIT / 1000, rel=1e-6)


@pytest.mark.parametrize(
    ("own", "jog", "full"), [(0.5, 4_000.0, 0.5 * 0x4000), (0.0, 4_000.0, 4_000.0), (0.0, 0.0, 10_000.0)]
)
def test_0x4000_of_mdi_acc_is_its_own_step_or_the_jogging_ramp_or_the_axis_ramp(own, jog, full):
    """HIWIN E1 manual 6.6.1 for the share of a ramp; without a jogging ramp it is, as for jogging, that of the axis."""
    drive = Positioner()
    axis = drive.axis
    axis.profidrive.settings.task_acceleration_step = axis.profidrive.settings.task_deceleration_step = own
    axis.jog.settings.acceleration = axis.jog.settings.deceleration = jog
    axis.ramp.settings.acceleration = axis.ramp.settings.deceleration = 10_000.0
    drive.data(20.0)
    drive.image.received[MDI_ACC] = drive.image.received[MDI_DEC] = 0x4000
    assert drive.stw(START) & ACKNOWLEDGED
    drive.run(10)
    before = float(axis.profile.velocity)
    drive.run(1)
    assert float(axis.profile.velocity) - before == pytest.approx(full / 1000, rel=1e-6)


def test_the_following_error_at_a_constant_velocity_is_zero_with_the_velocity_fed_forward():
    drive = Positioner()
    drive.move(100.0, velocity=600.0)
    drive.run(1000)
    assert drive.axis.positioning.following_error == pytest.approx(0.0, abs=0.01)
    assert drive.zsw1 & 0x0100


def test_a_new_target_on_the_fly_needs_the_handshake_and_no_stop():
    drive = Positioner()
    drive.move(5.0)
    drive.run(200)
    drive.data(10.0)
    drive.run(50)
    assert drive.axis.profile.target == pytest.approx(5.0), "data alone start nothing"
    drive.move(10.0)
    for _ in range(500):
        drive.run(1)
        assert drive.axis.profile.velocity > 500.0
    drive.settle()
    assert drive.place == pytest.approx(10.0, abs=2e-3)


def test_a_level_of_bit_6_starts_nothing():
    drive = Positioner()
    drive.data(1.0)
    drive.stw(READY & ~0x0020)
    drive.stw(START & ~0x0020)
    assert not drive.stw(START, 50) & ACKNOWLEDGED, "the edge came in an intermediate stop"
    assert drive.place == 0.0


@pytest.mark.parametrize("missing", ["velocity", "up", "down"])
def test_a_task_that_cannot_be_executed_is_not_acknowledged(missing):
    drive = Positioner()
    drive.data(1.0, **{missing: 0.0})
    assert not drive.stw(START, 50) & (ACKNOWLEDGED | ACTIVE)
    assert drive.place == 0.0


def test_a_task_without_home_position_is_not_acknowledged():
    drive = Positioner(homed=False)
    drive.data(1.0)
    assert not drive.stw(START, 50) & (ACKNOWLEDGED | HOMED)


def test_a_task_without_mdi_selected_is_not_acknowledged():
    drive = Positioner()
    drive.data(1.0)
    drive.image.received[SATZANW] = 0
    assert not drive.stw(START, 50) & ACKNOWLEDGED


def test_an_intermediate_stop_brakes_and_goes_on_with_the_task():
    drive = Positioner()
    drive.move(5.0)
    drive.run(200)
    drive.stw(READY & ~0x0020, 200)
    assert drive.zsw1 & (STOPPED | ACTIVE | ON_TARGET) == STOPPED | ACTIVE
    held = drive.place
    assert 1.0 < held < 4.0
    drive.run(300)
    assert drive.place == pytest.approx(held, abs=1e-3)
    drive.stw(READY)
    drive.settle()
    assert drive.place == pytest.approx(5.0, abs=2e-3)


@pytest.mark.parametrize(("relative", "place"), [(False, 2.0), (True, 7.0)])
def test_5_10_2_bits_5_and_6_that_rise_in_one_frame_begin_the_new_task_in_place_of_the_one_that_waits(relative, place):
    """AKD PROFINET manual 5.10.1, 5.10.2: bit 5 activates the task again, and an edge of bit 6 then begins another."""
    drive = Positioner()
    drive.move(5.0)
    drive.run(200)
    drive.stw(READY & ~0x0020, 200)
    drive.data(2.0, relative=relative)
    assert drive.stw(START) & (ACKNOWLEDGED | ACTIVE) == ACKNOWLEDGED | ACTIVE
    drive.stw(READY)
    drive.settle()
    assert drive.place == pytest.approx(place, abs=2e-3)


def test_5_10_2_a_task_that_cannot_be_executed_leaves_the_one_that_waits_to_go_on_with_bit_5():
    drive = Positioner()
    drive.move(5.0)
    drive.run(200)
    drive.stw(READY & ~0x0020, 200)
    drive.data(2.0, velocity=0.0)
    assert drive.stw(START) & (ACKNOWLEDGED | ACTIVE) == ACTIVE
    drive.settle()
    assert drive.place == pytest.approx(5.0, abs=2e-3)


def test_a_rejected_task_brakes_and_is_gone():
    drive = Positioner()
    drive.move(5.0)
    drive.run(200)
    start = float(drive.axis.profile.position)
    drive.stw(READY & ~0x0010, 200)
    assert drive.zsw1 & (STOPPED | ACTIVE | ON_TARGET) == STOPPED
    assert drive.axis.profile.position - start == pytest.approx(10.0**2 / (2 * 500.0), rel=0.1)
    drive.stw(READY, 200)
    assert drive.place < 4.0


def test_a_target_beyond_the_software_limits_is_refused_and_jogging_ends_at_them():
    drive = Positioner()
    drive.axis.travel.settings.software_limits, drive.axis.travel.settings.low, drive.axis.travel.settings.high = (
        3,
        -1.0,
        2.0,
    )
    drive.data(2.1)
    assert not drive.stw(START, 20) & ACKNOWLEDGED
    drive.stw(READY)
    drive.move(2.0)
    drive.until(ON_TARGET | STOPPED)
    drive.stw(0x060F, 6000)
    assert drive.place == pytest.approx(-1.0, abs=2e-3)
    assert drive.image.sent[DRIVE_INPUTS] == 1, "5.8.1: the negative one"


def test_a_velocity_beyond_the_motors_is_limited_and_a_negative_one_is_not_taken():
    drive = Positioner()
    drive.axis.motor.settings.max_velocity = 900.0
    drive.move(50.0, velocity=1800.0)
    drive.run(500)
    assert drive.axis.profile.velocity == pytest.approx(900.0)
    drive.axis.profidrive.settings.task_velocity_unsigned = 0
    drive.data(0.0)
    drive.image.received[MDI_VELOCITY] = -1000
    assert not drive.stw(START, 5) & ACKNOWLEDGED


def test_a_limit_switch_stops_what_runs_into_it_and_lets_it_back():
    drive = Positioner()
    drive.move(50.0)
    drive.run(300)
    drive.axis.machine.settings.fault_limits = 2
    drive.run(300)
    assert drive.image.sent[DRIVE_INPUTS] == 8, "5.8.1"
    assert drive.zsw1 & (STOPPED | ACTIVE) == STOPPED
    drive.data(60.0)
    assert not drive.stw(START, 5) & ACKNOWLEDGED
    drive.stw(READY)
    drive.move(0.0)
    drive.until(ON_TARGET | STOPPED)


def test_a_following_error_beyond_its_limit_is_the_models_fault():
    drive = Positioner()
    drive.axis.positioning.settings.following_limit, drive.axis.positioning.settings.following_fault = (
        0.2,
        439 | REACTION_QUICK_STOP << 24,
    )
    drive.axis.load.settings.torque = 100.0
    drive.move(5.0)
    drive.run(500)
    assert drive.zsw1 & 0x0008
    assert drive.axis.faults.code[0] & 0xFFFF == 439


def test_leaving_operation_ends_the_task_for_good():
    drive = Positioner()
    drive.move(5.0)
    drive.run(200)
    drive.stw(0x043E, 2000)
    assert drive.axis.drive.state == 2
    for word in (0x0437, READY):
        drive.stw(word)
    drive.stw(READY, 300)
    assert drive.axis.drive.state == 4
    assert drive.zsw1 & (STOPPED | ACTIVE | ON_TARGET) == STOPPED
    assert drive.place < 4.5


def test_power_off_forgets_the_home_position():
    drive = Positioner()
    drive.command(5)
    drive.run(200)
    assert not drive.zsw1 & HOMED


def test_111_pos_stw1_selects_and_pos_zsw_shows():
    drive = Positioner()
    drive.axis.profidrive.settings.task_form = TASKS_POS_STW
    drive.image.received[OVERRIDE] = 0x4000
    drive.image.received[POS_STW1] = 0x8100
    drive.data(4.0)
    assert drive.stw(START, 100) & ACKNOWLEDGED
    assert drive.image.sent[POS_ZSW1] == 0x8000
    assert drive.image.sent[POS_ZSW2] == 0x8014
    drive.image.received[OVERRIDE] = 0x2000
    drive.run(150)
    assert drive.axis.motor.velocity == pytest.approx(300.0, abs=2.0)
    drive.image.received[POS_STW1] = 0x8000
    drive.data(-1.0)
    drive.stw(READY)
    drive.stw(START)
    drive.settle()
    assert drive.place == pytest.approx(3.0, abs=2e-3)


def test_hiwin_3_13_pos_stw2_bit_1_makes_the_place_the_reference_point():
    drive = Positioner(homed=False)
    drive.axis.profidrive.settings.task_form, drive.axis.homing.settings.position = TASKS_POS_STW, 0.5
    drive.stand_at(2.25)
    assert not drive.zsw1 & HOMED
    drive.image.received[POS_STW2] = 2
    drive.run(2)
    assert drive.zsw1 & HOMED
    assert drive.place == 0.5
    drive.stand_at(3.25)
    assert drive.place == 1.5, "the bit still stands: no edge"


def test_moog_10_5_both_edges_of_bit_6_start_and_bit_12_changes_with_each():
    drive = Positioner()
    axis = drive.axis
    (
        axis.profidrive.settings.task_form,
        axis.asked.settings.control_config,
        axis.profidrive.settings.task_velocity_step,
        axis.jog.settings.real_time,
    ) = TASKS_TARPOS, 0, 1.0, 0
    drive.image.received[VELOCITY_A] = 600
    seen = []
    for position, word in ((1.0, START), (2.0, READY), (3.0, START)):
        drive.image.received[TARPOS_A] = round(position * COUNTS)
        seen.append(drive.stw(word) & ACKNOWLEDGED)
        drive.settle()
        assert drive.place == pytest.approx(position, abs=2e-3)
    assert seen[0] != seen[1] != seen[2]


def test_moog_10_2_1_bit_13_takes_new_targets_without_an_edge_and_bit_12_makes_them_relative():
    drive = Positioner()
    axis = drive.axis
    (
        axis.profidrive.settings.task_form,
        axis.asked.settings.control_config,
        axis.profidrive.settings.task_velocity_step,
        axis.jog.settings.real_time,
    ) = TASKS_TARPOS, 0, 1.0, 0
    drive.image.received[VELOCITY_A] = 600
    drive.image.received[TARPOS_A] = 2 * COUNTS
    drive.stw(READY | 0x2000, 10)
    drive.settle()
    assert drive.place == pytest.approx(2.0, abs=2e-3)
    drive.stw(READY)
    drive.stw(START | 0x1000, 10)
    drive.settle()
    assert drive.place == pytest.approx(4.0, abs=2e-3)


def test_5_11_8_home_mode_and_home_dist_of_the_telegram_take_the_place_of_the_parameters():
    drive = Positioner(homed=False)
    drive.axis.profidrive.settings.home_signals = 3
    drive.image.received[HOME_MODE] = 0
    drive.stand_at(0.4)
    drive.stw(HOME, 20)
    assert drive.zsw1 & HOMED
    assert drive.axis.motor.position == pytest.approx(0.4, abs=1e-3), "it took the place where it stood"
    drive.stw(READY)
    drive.image.received[HOME_MODE], drive.image.received[HOME_DIST] = HOME_MARK, COUNTS // 4
    drive.stw(HOME, 20)
    drive.until(ON_TARGET | HOMED | STOPPED)
    assert drive.axis.motor.position == pytest.approx(1.25, abs=1e-3)
    assert drive.place == pytest.approx(0.25, abs=1e-3)


def test_every_state_of_positioning_can_be_left_and_none_is_a_trap():
    states = {state for state, _ in positioning.TRANSITIONS} | set(positioning.TRANSITIONS.values())
    assert states == set(range(positioning.STATES))
    for state in states - {positioning.OUT}:
        assert (state, positioning.LEAVE) in positioning.TRANSITIONS
    assert sorted(positioning.PRIORITY) == list(range(positioning.EVENTS))


def test_the_axis_takes_the_time_of_the_trapezoid():
    drive = Positioner()
    drive.move(8.0, velocity=1200.0, up=24_000.0, down=12_000.0)
    steps = 2
    while drive.axis.positioning.state == positioning.TASK:
        drive.run(1)
        steps += 1
    up, down, top = 400.0, 200.0, 20.0
    assert steps == pytest.approx(1000 * (top / up / 2 + top / down / 2 + 8.0 / top), abs=4)
    assert math.isclose(float(drive.axis.profile.position), 8.0, abs_tol=1e-9)
    assert drive.image.received[STW1] == READY


def test_a_task_can_begin_with_the_step_that_shows_the_axis_stopped():
    drive = Positioner()
    drive.stw(0x050F, 200)
    drive.stw(READY)
    drive.data(1.0)
    while not drive.zsw1 & STOPPED:
        drive.run(1)
    assert drive.stw(START) & ACKNOWLEDGED


@pytest.mark.parametrize(("word", "taken"), [(0x7FFF, True), (0x8000, False), (0xFFFF, False), (1, True)])
def test_hiwin_3_1_a_task_with_negative_ramps_is_not_taken(word, taken):
    for signal in (MDI_ACC, MDI_DEC):
        drive = Positioner()
        drive.axis.profidrive.settings.task_ramps_signed = 1
        drive.data(1.0)
        drive.image.received[signal] = word
        assert bool(drive.stw(START) & ACKNOWLEDGED) == taken


def test_an_override_beyond_100_percent_ends_at_the_velocity_limit():
    drive = Positioner()
    drive.axis.profidrive.settings.task_form = TASKS_POS_STW
    drive.axis.travel.settings.velocity_limit = 900.0
    drive.image.received[POS_STW1] = 0x8100
    drive.image.received[OVERRIDE] = 0xFFFF
    drive.data(100.0)
    assert drive.stw(START) & ACKNOWLEDGED
    drive.run(500)
    assert drive.axis.motor.velocity == pytest.approx(900.0, abs=1.0)
    assert abs(drive.axis.positioning.following_error) < 0.05


def test_without_control_by_plc_nothing_is_taken_over_but_a_command_is():
    drive = Positioner()
    drive.axis.motion_tasks.settings.kind[3], drive.axis.motion_tasks.settings.position[3] = TASK_DEFINED, 1.0
    (
        drive.axis.motion_tasks.settings.velocity[3],
        drive.axis.motion_tasks.settings.acceleration[3],
        drive.axis.motion_tasks.settings.deceleration[3],
    ) = 300.0, 3e4, 3e4
    drive.image.received[SATZANW] = 0
    drive.stw((START | HOME) & ~0x0400, 50)
    assert drive.axis.positioning.state == positioning.STANDBY
    assert drive.axis.asked.mdi, "as before"
    drive.command(CMD_START_TASK, 3)
    drive.run(2)
    assert drive.axis.positioning.state == positioning.TASK


@pytest.mark.parametrize(("jog_deceleration", "milliseconds"), [(1_000.0, 600), (0.0, 120)])
def test_a_shaft_that_turns_when_operation_begins_is_brought_to_rest_before_any_task(jog_deceleration, milliseconds):
    drive = Positioner(homed=False)
    drive.axis.jog.settings.deceleration = jog_deceleration
    drive.axis.motor.settings.coast_method = 2
    drive.stw(0x0436)
    drive.axis.motor.velocity = 600.0
    for word in (0x0437, READY):
        drive.stw(word)
    drive.run(milliseconds * 3 // 4)
    assert drive.axis.motor.velocity > 50.0
    drive.run(milliseconds // 2)
    assert abs(drive.axis.motor.velocity) < 1.0
    assert drive.zsw1 & STOPPED


def test_fed_forward_acceleration_takes_most_of_the_following_error_of_a_profile_away():
    def worst(gain):
        drive = Positioner()
        drive.axis.load.settings.friction = 0.0
        drive.axis.motor.settings.acceleration_gain = gain
        drive.move(5.0)
        return max(abs(float(drive.axis.positioning.following_error)) for _ in range(600) if drive.stw(READY) | 1)

    assert worst(1.0) < 0.3 * worst(0.0)


@pytest.mark.parametrize("part", [0.0, 0.5, 1.0])
def test_the_following_error_of_a_steady_move_is_what_is_not_fed_forward_over_the_gain(part):
    drive = Positioner()
    drive.axis.motor.settings.speed_feed_forward = part
    drive.move(20.0)
    drive.stw(READY, 1000)
    speed = float(drive.axis.profile.velocity) / 60
    assert speed == pytest.approx(10.0)
    assert drive.axis.positioning.following_error == pytest.approx(
        (1.0 - part) * speed / float(drive.axis.positioning.settings.gain), abs=1e-3
    )
