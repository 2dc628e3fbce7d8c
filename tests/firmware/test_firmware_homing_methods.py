"""What each homing method looks for, in a machine with switches, a cam and end stops."""

import math

import pytest
from positioner import ACTIVE, HOME, HOMED, ON_TARGET, READY, STOPPED, Positioner

from pnfarm.table.axis_codes import (
    INPUT_HOME_SWITCH,
    INPUT_LIMIT_HIGH,
    INPUT_LIMIT_LOW,
    MACHINE_CAMS,
    MACHINE_STOP_HIGH,
    MACHINE_STOP_LOW,
    MACHINE_SWITCH_HIGH,
    MACHINE_SWITCH_LOW,
)
from pnfarm.table.signals import HOME_MODE

SWITCHES = MACHINE_SWITCH_LOW | MACHINE_SWITCH_HIGH
STOPS = MACHINE_STOP_LOW | MACHINE_STOP_HIGH
#: Places of the machine, rev.
SWITCH, STOP, CAM = 5.25, 6.25, (1.3, 1.6)
#: What the fastest search covers in a step of 1 ms, and back.
STEP = 2 * 300 / 60 / 1000
#: From 300 rpm at 30,000 rpm/s, and what the position controller is behind.
BRAKING = 5**2 / (2 * 500) + 0.02


def machine(method, direction, start=0.0, parts=SWITCHES | STOPS, share=0.2):
    drive = Positioner(homed=False)
    axis = drive.axis
    axis.machine.settings.parts = parts | MACHINE_CAMS
    (
        axis.machine.settings.switch_low,
        axis.machine.settings.switch_high,
        axis.machine.settings.stop_low,
        axis.machine.settings.stop_high,
    ) = -SWITCH, SWITCH, -STOP, STOP
    axis.machine.settings.cam_inputs[0], axis.machine.settings.cam_low[0], axis.machine.settings.cam_high[0] = (
        1 << 2,
        *CAM,
    )
    axis.machine.settings.input_modes[2] = INPUT_HOME_SWITCH
    axis.homing.settings.method, axis.homing.settings.direction = method, direction
    axis.homing.settings.share, axis.homing.settings.lag, axis.homing.settings.current = share, 0.02, 2.0
    if start:
        drive.stand_at(start)
    return drive


def fail(drive, within=3000):
    """Home it, in vain."""
    drive.stw(HOME)
    for _ in range(within):
        if drive.axis.homing.error:
            drive.run(100)
            return
        drive.run(1)
    raise AssertionError("homing does not fail")


def home(drive, within=5000):
    """Home it; where it found the home, on the shaft."""
    drive.stw(HOME)
    for _ in range(within):
        if drive.zsw1 & HOMED:
            drive.run(100)
            return float(drive.axis.homing.origin)
        assert not drive.axis.homing.error, "homing failed"
        drive.run(1)
    raise AssertionError("homing does not end")


@pytest.mark.parametrize(
    ("method", "direction", "start", "place"),
    [
        (0, 1, 0.4, 0.4),
        (1, 1, 0, SWITCH),
        (1, -1, 0, -SWITCH),
        (1, 1, 5.5, SWITCH),  # it begins on the switch
        (2, 1, 0, 5),
        (3, -1, 0, -5),
        (4, 1, 0, CAM[0]),
        (4, -1, 3, CAM[1]),
        (4, 1, 1.45, CAM[0]),  # it begins on the cam
        (4, 1, 3, CAM[0]),  # it comes to the limit switch first
        (4, -1, -3, CAM[1]),
        (5, 1, 0, 2),
        (6, -1, 3, 1),
        (7, 1, 0.4, 1),
        (11, -1, 0.4, 0),
        (13, 1, 0.4, 0),
        (14, 1, 0, CAM[0]),
        (15, 1, -1.5, -1),
    ],
)
def test_5_10_3_a_homing_mode_finds_what_it_looks_for(method, direction, start, place):
    drive = machine(method, direction, start)
    assert home(drive) == pytest.approx(place, abs=STEP)
    drive.run(100)
    if method in {1, 3, 4, 6, 14}:
        assert 0.0 < abs(drive.place) < BRAKING, "it brakes behind the home"
    elif method != 13:
        assert drive.place == pytest.approx(0.0, abs=0.001), "it ends at the home"
    assert drive.zsw1 & (ON_TARGET | STOPPED) == ON_TARGET | STOPPED


@pytest.mark.parametrize(
    ("method", "direction", "place"), [(8, 1, STOP), (8, -1, -STOP), (9, 1, 6), (10, -1, -6), (12, 1, CAM[0])]
)
def test_5_10_3_homing_at_an_end_stop_pushes_with_its_own_current(method, direction, place):
    drive = machine(method, direction, 3 if method == 12 else 0, parts=STOPS)
    drive.stw(HOME)
    most = 0.0
    while not drive.zsw1 & HOMED:
        if abs(drive.axis.motor.position) >= STOP:
            most = max(most, abs(float(drive.axis.motor.current)))
        drive.run(1)
        assert drive.now < 30e9
    drive.run(100)
    assert float(drive.axis.homing.origin) == pytest.approx(place, abs=STEP)
    assert abs(drive.place) < (BRAKING if method in {10, 12} else 0.001)
    assert most == pytest.approx(2.0, rel=0.01), "the limit, and no more"
    drive.stw(READY)
    drive.move(-3.0 * direction)
    drive.settle()
    assert drive.place == pytest.approx(-3.0 * direction, abs=0.001)


def test_the_way_after_the_home_leads_off_by_the_homing_distance():
    drive = machine(4, 1)
    drive.axis.homing.settings.distance = -0.5
    drive.axis.homing.settings.position = 10.0
    assert home(drive) == pytest.approx(CAM[0] - 10.0, abs=STEP)
    drive.settle()
    assert drive.place == pytest.approx(9.5, abs=0.001)


def test_5_10_3_the_index_is_looked_for_at_a_part_of_the_velocity():
    drive = machine(6, 1, share=0.1)
    drive.stw(HOME)
    while drive.axis.motor.position < 1.8:
        drive.run(1)
    assert drive.axis.motor.velocity == pytest.approx(30, abs=1)
    assert home(drive) == 2.0


def test_a_home_switch_that_is_closed_from_the_beginning_must_close_on_the_way():
    """It leaves the switch in the direction of homing, turns at the limit switch, crosses the cam, and turns again."""
    drive = machine(4, 1, 1.45)
    drive.stw(HOME)
    furthest = 0.0
    while not drive.zsw1 & HOMED:
        furthest = max(furthest, float(drive.axis.motor.position))
        drive.run(1)
    assert furthest > SWITCH
    assert float(drive.axis.homing.origin) == pytest.approx(CAM[0], abs=STEP)


@pytest.mark.parametrize("inverted", [False, True])
def test_an_input_as_limit_switch_is_pressed_while_it_is_low(inverted):
    """AKD parameter reference, DINx.MODE 18 and 19, DINx.INV."""
    drive = machine(1, 1, parts=0)
    axis = drive.axis
    axis.machine.settings.input_modes[0], axis.machine.settings.input_inverted[0] = INPUT_LIMIT_HIGH, inverted
    axis.machine.settings.cam_inputs[1], axis.machine.settings.cam_low[1], axis.machine.settings.cam_high[1] = (
        1,
        *((2.2, 9.0) if inverted else (-9.0, 2.2)),
    )
    assert home(drive) == pytest.approx(2.2, abs=STEP)
    axis.machine.settings.input_modes[1] = INPUT_LIMIT_LOW
    drive.run(1)
    assert axis.machine.limit_switch & 1, "nothing is wired to it"


@pytest.mark.parametrize(
    ("method", "start", "parts"),
    [
        (14, 1.45, SWITCHES),  # it does not turn round
        (8, 0, SWITCHES | STOPS),  # a switch before the end stop
        (7, 5.1, SWITCHES),  # the mark is behind the switch
        (16, 0, SWITCHES),  # no such mode
        (0xFFFF, 0, 0),
    ],
)
def test_homing_that_cannot_succeed_ends_at_rest_without_a_home_position(method, start, parts):
    drive = machine(0, 1, start, parts)
    # the telegram brings the mode, unchecked
    drive.axis.profidrive.settings.home_signals = 1
    drive.image.received[HOME_MODE] = method
    fail(drive)
    assert drive.zsw1 & (HOMED | STOPPED | ACTIVE) == STOPPED
    assert not drive.axis.homing.homed


def test_a_mode_that_the_telegram_changes_during_homing_counts_for_the_next_one():
    drive = machine(1, 1)
    drive.axis.profidrive.settings.home_signals = 1
    drive.image.received[HOME_MODE] = 1
    drive.stw(HOME, 100)
    drive.image.received[HOME_MODE] = 99
    assert home(drive) == pytest.approx(SWITCH, abs=STEP)
    drive.stw(READY)
    fail(drive)


def test_a_search_without_end_ends_at_the_farthest_way():
    drive = machine(4, 1, parts=0)
    drive.axis.machine.settings.cam_inputs[0] = 0
    drive.axis.homing.settings.farthest = 7.0
    fail(drive)
    assert float(drive.axis.motor.position) == pytest.approx(7.0, abs=0.1)


def test_homing_that_is_taken_back_in_any_leg_ends_at_rest():
    for milliseconds in (1, 300, 470, 900, 1230, 1275, 1293):
        drive = machine(4, 1, 3)
        drive.stw(HOME, milliseconds)
        drive.stw(READY, 100)
        assert drive.zsw1 & (STOPPED | ACTIVE) == STOPPED
        assert not drive.axis.homing.current_limit


def test_an_axis_that_hits_an_end_stop_stops_and_loses_its_energy():
    drive = machine(0, 1, parts=STOPS)
    drive.axis.positioning.settings.following_limit = 0.0
    home(drive)
    drive.stw(READY)
    drive.data(20.0)
    drive.stw(READY | 0x0040)
    drive.run(3000)
    assert float(drive.axis.motor.position) == STOP
    assert float(drive.axis.motor.velocity) == 0.0
    assert drive.axis.motor.current == pytest.approx(drive.axis.motor.settings.peak_current), (
        "it pushes with all that it has"
    )
    assert math.isfinite(drive.axis.supply.voltage)


def test_the_axis_runs_onto_a_limit_switch_by_itself_and_back():
    drive = machine(0, 1)
    home(drive)
    drive.stw(READY)
    drive.data(20.0)
    drive.stw(READY | 0x0040)
    drive.run(3000)
    assert SWITCH <= drive.axis.motor.position <= SWITCH + 0.3, "braked behind the switch"
    assert drive.axis.machine.limit_switch == 2
    drive.stw(READY)
    drive.move(4.0)
    drive.settle()
    assert drive.axis.machine.limit_switch == 0
