"""The profile generator, against the formulas of a trapezoid."""

import math
from itertools import pairwise

import numpy as np
import pytest
from from_python import called
from hypothesis import assume, example, given
from hypothesis import strategies as st

from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.motion.profile_generator import begin_profile, profile_over, step_profile
from pnfarm.table.axis_codes import PROFILE_STOP, PROFILE_TARGET, PROFILE_VELOCITY
from pnfarm.table.compiling.compiled import compiled

RPM = 60.0


@compiled
def walk(axes, step, steps, over, path):
    """Positions and velocities after each of ``steps`` steps, or until the profile is over; how many."""
    axis = axes[0]
    for i in range(steps):
        if over and profile_over(axis.profile):
            return i
        step_profile(axis.profile, step)
        path[i, 0] = axis.profile.position
        path[i, 1] = axis.profile.velocity
    return steps


class Profile:
    """An axis with a profile alone; positions in rev, velocities in rev/s."""

    def __init__(self, position=0.0, velocity=0.0, *, jerk=0.0):
        self.axes = np.zeros(1, AXIS.dtype).view(np.recarray)
        self.axis = self.axes[0]
        self.axis.profile.position = position
        self.axis.profile.velocity = velocity * RPM
        self.axis.profile.settings.jerk_time = jerk
        self.time = 0.0
        called(begin_profile)(self.axis.profile)

    def task(self, target=0.0, velocity=10.0, up=100.0, down=100.0, profile=PROFILE_TARGET):
        axis = self.axis
        axis.profile.mode, axis.profile.target = profile, target
        axis.profile.top, axis.profile.acceleration, axis.profile.deceleration = velocity * RPM, up * RPM, down * RPM
        return self

    def run(self, seconds, step=0.001):
        """Positions and velocities after each step."""
        return self._walk(round(seconds / step), step, over=False)

    def until_over(self, step=0.001, most=100.0):
        path = self._walk(math.ceil((most - self.time) / step), step, over=True)
        assert called(profile_over)(self.axis.profile), "it never arrives"
        return path

    def _walk(self, steps, step, *, over):
        path = np.empty((min(steps, 100_000), 2))
        walked = []
        while steps > 0:
            taken = walk(self.axes, step, min(steps, len(path)), over, path)
            walked += [(position, velocity / RPM) for position, velocity in path[:taken].tolist()]
            self.time += taken * step
            if taken < len(path):
                break
            steps -= taken
        return walked


def trapezoid_time(distance, velocity, up, down):
    """Seconds from rest to rest."""
    ramps = velocity * velocity / 2 * (1 / up + 1 / down)
    if ramps <= distance:
        return velocity / up + velocity / down + (distance - ramps) / velocity
    peak = math.sqrt(2 * distance * up * down / (up + down))
    return peak / up + peak / down


limits = st.floats(0.1, 1000.0)


@given(
    distance=st.floats(1e-4, 1e4), velocity=limits, up=limits, down=limits, forward=st.booleans(),
    step=st.sampled_from([0.0000625, 0.001, 0.004, 0.016]),
)  # fmt: skip
def test_a_move_takes_the_time_of_its_trapezoid_whatever_the_step(distance, velocity, up, down, forward, step):
    needed = trapezoid_time(distance, velocity, up, down)
    assume(needed / step < 3000)
    profile = Profile().task(distance if forward else -distance, velocity, up, down)
    profile.until_over(step)
    assert needed - 1e-6 <= profile.time <= needed + step + 1e-6
    assert profile.axis.profile.position == (distance if forward else -distance)


@given(distance=st.floats(-50, 50), start=st.floats(-20, 20), velocity=st.floats(0.5, 30), up=limits, down=limits)
def test_a_move_from_any_velocity_ends_in_its_target_within_its_limits(distance, start, velocity, up, down):
    profile = Profile(0.0, start).task(distance, velocity, up, down)
    path = [(0.0, start), *profile.until_over(0.004, 5000.0)] if up > 1 and down > 1 else [(0.0, start)]
    if len(path) == 1:
        return
    assert path[-1][0] == distance
    for (_, before), (_, after) in pairwise(path):
        assert abs(after) <= max(velocity, abs(start)) + 1e-6
        assert abs(after - before) <= max(up, down) * 0.004 + 1e-6


@pytest.mark.parametrize("step", [0.0000625, 0.001, 0.007])
def test_the_path_does_not_depend_on_the_step(step):
    profile = Profile().task(3.0, 5.0, 20.0, 40.0)
    fine = Profile().task(3.0, 5.0, 20.0, 40.0)
    for _ in range(40):
        profile.run(0.007, step)
        fine.run(0.007, 0.0005)
        assert profile.axis.profile.position == pytest.approx(fine.axis.profile.position, abs=1e-9)
        assert profile.axis.profile.velocity == pytest.approx(fine.axis.profile.velocity, abs=1e-6)


def test_a_target_within_the_stopping_distance_is_reached_after_turning_back():
    profile = Profile(0.0, 10.0).task(0.1, 10.0, 100.0, 100.0)
    path = profile.until_over()
    assert max(position for position, _ in path) == pytest.approx(0.5, abs=1e-3), "10 rev/s stop in 0.5 rev"
    assert path[-1][0] == 0.1
    # down from 10 rev/s, and back over 0.4 rev
    assert profile.time == pytest.approx(0.1 + trapezoid_time(0.4, 10.0, 100.0, 100.0), abs=0.0011)


def test_a_target_that_changes_on_the_fly_is_met_without_a_stop():
    profile = Profile().task(10.0)
    profile.run(0.5)
    profile.task(20.0)
    path = profile.until_over()
    assert profile.time == pytest.approx(trapezoid_time(20.0, 10.0, 100.0, 100.0), abs=0.0011)
    assert min(velocity for _, velocity in path[:1500]) == pytest.approx(10.0)


def test_a_lower_velocity_on_the_fly_is_reached_along_the_deceleration():
    profile = Profile().task(10.0, 10.0)
    profile.run(0.5)
    profile.task(10.0, 2.0)
    path = profile.run(0.2)
    assert [round(v, 6) for _, v in path[:2]] == [9.9, 9.8]
    assert path[-1][1] == pytest.approx(2.0)


def test_a_stop_takes_v_over_a_and_v_squared_over_two_a():
    profile = Profile(0.0, 8.0).task(profile=PROFILE_STOP, down=40.0)
    profile.until_over()
    assert profile.time == pytest.approx(0.2, abs=0.0011)
    assert profile.axis.profile.position == pytest.approx(0.8)


@given(start=st.floats(-20, 20), wanted=st.floats(-20, 20), up=limits, down=limits)
def test_a_velocity_is_reached_over_a_rest_when_it_has_the_other_sign(start, wanted, up, down):
    time = (
        abs(start) / down + abs(wanted) / up
        if start * wanted < 0
        else abs(wanted - start) / (up if abs(wanted) > abs(start) else down)
    )
    assume(time < 5.0)
    profile = Profile(0.0, start).task(velocity=wanted, up=up, down=down, profile=PROFILE_VELOCITY)
    profile.run(time + 0.002)
    assert profile.axis.profile.velocity / RPM == pytest.approx(wanted, abs=1e-9)


def test_with_a_jerk_time_the_axis_arrives_that_much_later_and_exactly():
    profile = Profile(jerk=0.04).task(3.0, 10.0, 100.0, 100.0)
    profile.until_over()
    assert profile.time == pytest.approx(trapezoid_time(3.0, 10.0, 100.0, 100.0) + 0.04, abs=0.004)
    assert profile.axis.profile.position == 3.0


@pytest.mark.parametrize("step", [0.00025, 0.001, 0.004])
def test_with_a_jerk_time_acceleration_changes_by_acceleration_over_time(step):
    profile = Profile(jerk=0.08).task(5.0, 10.0, 100.0, 100.0)
    path = [(0.0, 0.0)] * 50 + profile.until_over(step)
    velocities = np.array([velocity for _, velocity in path])
    accelerations = np.diff(velocities) / step
    assert np.abs(accelerations).max() <= 100.0 * 1.001
    # in stairs, tap by tap: over whole taps it is what it should be
    taps = max(1, round(0.01 / step))
    assert np.abs(accelerations[taps:] - accelerations[:-taps]).max() <= 100.0 / 0.08 * taps * step * 1.51


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(2, 20), st.floats(0, 0.1)), min_size=1, max_size=5))
@example([(8.461244957269072e-308, 1.0, 0.0)])
def test_with_a_jerk_time_the_path_has_no_step_whatever_is_asked(tasks):
    profile = Profile(jerk=0.032)
    path = [(0.0, 0.0)]
    for target, velocity, seconds in tasks:
        profile.task(target, velocity)
        path += profile.run(seconds)
    path += profile.until_over()
    assert path[-1][0] == tasks[-1][0]
    for (before, _), (after, _) in pairwise(path):
        assert abs(after - before) <= 20.0 * 0.001 * 1.01
