"""Positioning: traversing tasks, intermediate stop, homing and jogging inside S4 (PROFIdrive application class 3).

What an axis in position mode does while operation is enabled, as a table of its own (AKD PROFINET manual 5.10, HIWIN E1
manual 3.3.2 and 6.6 to 6.8, Moog MSD manual 10.5; their figures are missing: the profile's extension of S4 holds):

==================  ========================================================
STANDBY             standing, or braked to a stop; a task may begin
TASK                a traversing task runs
INTERMEDIATE_STOP   STW1.5 = 0: braked, the task waits
BRAKING             rejected (STW1.4 = 0), homing or jogging ended
HOMING              STW1.11 = 1
JOG                 STW1.8 or STW1.9, or real-time jogging
FOLLOWING           STW1.4 to 6 = 1 in the interpolating mode (Moog MSD manual 10.6)
HALTED              a parameter ended the task (AKD: DRV.STOP), which another one can continue
==================  ========================================================

Positions here are the shaft's; ``origin`` is where the machine's zero lies on it.
"""

from __future__ import annotations

from math import floor
from typing import Any

import numpy as np

from pnfarm.firmware.faults import raise_fault
from pnfarm.firmware.homing import homing_fails, homing_over, start_homing, step_homing
from pnfarm.firmware.interpolation import begin_interpolation, follows, interpolates, step_interpolation
from pnfarm.firmware.motor import brake_holds
from pnfarm.firmware.profile_generator import begin_profile, profile_over, step_profile
from pnfarm.firmware.tasks import select_task
from pnfarm.firmware.transitions import as_array
from pnfarm.firmware.travel import at_limit_switch, fastest, position_number, take_ramps, within_limits
from pnfarm.table.axis_codes import (
    CONFIG_RISING_EDGE,
    JOG_MINUS,
    JOG_NONE,
    JOG_REAL_TIME,
    JOG_SEQUENCE,
    JOG_STILL,
    MOTION_HALTED,
    PROFILE_STOP,
    PROFILE_TARGET,
    PROFILE_VELOCITY,
    STOP_DROP,
    STOP_HALT,
    TASK_CHAINED,
    TASK_FROM_ACTUAL,
    TASK_FROM_COMMAND,
    TASK_FROM_TARGET,
    TASK_MDI,
    TASK_PASSING,
)
from pnfarm.table.compiled import compiled

__all__ = [
    "BRAKING",
    "FOLLOWING",
    "HALTED",
    "HOMING",
    "INTERMEDIATE_STOP",
    "JOG",
    "OUT",
    "PRIORITY",
    "STANDBY",
    "TASK",
    "TRANSITIONS",
    "positioning_command",
    "take_motion",
]

# States (``motion``).
OUT = 0  # operation is not enabled, or another mode is
STANDBY = 1
TASK = 2
INTERMEDIATE_STOP = 3
BRAKING = 4
HOMING = 5
JOG = 6
HALTED = MOTION_HALTED
FOLLOWING = 8
STATES = 9

# Events.
LEAVE = 0  # operation ends
ENTER = 1  # operation begins
REJECT = 2  # STW1.4 = 0
PAUSE = 3  # STW1.5 = 0
RESUME = 4  # STW1.5 = 1
START = 5  # a traversing task that can be executed
HOME = 6  # STW1.11 = 1
HOME_OFF = 7  # STW1.11, seen to fall
JOG_ON = 8
JOG_OFF = 9
OVER = 10  # the profile stands where it was to end
BLOCKED = 11  # it runs into a limit switch
HALT = 12  # a parameter ends what runs
CONTINUE = 13  # a parameter goes on with the halted task
FOLLOW = 14  # positions of each cycle lead the axis
UNFOLLOW = 15  # they do not
EVENTS = 16

TRANSITIONS: dict[tuple[int, int], int] = {
    (OUT, ENTER): STANDBY,
    (STANDBY, LEAVE): OUT,
    (STANDBY, START): TASK,
    (STANDBY, HOME): HOMING,
    (STANDBY, JOG_ON): JOG,
    # a running task
    (TASK, LEAVE): OUT,
    (TASK, REJECT): BRAKING,
    (TASK, BLOCKED): BRAKING,
    (TASK, PAUSE): INTERMEDIATE_STOP,
    (TASK, HALT): HALTED,
    (TASK, START): TASK,
    (TASK, OVER): STANDBY,
    # its intermediate stop
    (INTERMEDIATE_STOP, LEAVE): OUT,
    (INTERMEDIATE_STOP, REJECT): BRAKING,
    (INTERMEDIATE_STOP, START): TASK,
    (INTERMEDIATE_STOP, RESUME): TASK,
    (INTERMEDIATE_STOP, HALT): HALTED,
    # halted by a parameter
    (HALTED, LEAVE): OUT,
    (HALTED, REJECT): BRAKING,
    (HALTED, CONTINUE): TASK,
    (HALTED, START): TASK,
    (HALTED, HOME): HOMING,
    (HALTED, JOG_ON): JOG,
    # braking
    (BRAKING, LEAVE): OUT,
    (BRAKING, OVER): STANDBY,
    # homing
    (HOMING, LEAVE): OUT,
    (HOMING, HOME_OFF): BRAKING,
    (HOMING, BLOCKED): BRAKING,
    (HOMING, HALT): BRAKING,
    (HOMING, OVER): STANDBY,
    # jogging
    (JOG, LEAVE): OUT,
    (JOG, JOG_OFF): BRAKING,
    # following positions of each cycle
    (STANDBY, FOLLOW): FOLLOWING,
    (FOLLOWING, LEAVE): OUT,
    (FOLLOWING, UNFOLLOW): BRAKING,
    (FOLLOWING, HOME): HOMING,
}

#: Which event wins when several hold; a task that begins in the step that ends an intermediate stop is the newer one.
PRIORITY = (
    LEAVE, BLOCKED, REJECT, HOME_OFF, JOG_OFF, UNFOLLOW, HALT, PAUSE, CONTINUE, START, RESUME, HOME, JOG_ON, FOLLOW,
    OVER, ENTER,
)  # fmt: skip

REJECT_BIT = 0x0010  # STW1.4, 0 = reject
PAUSE_BIT = 0x0020  # STW1.5, 0 = intermediate stop
START_BIT = 0x0040  # STW1.6
HOME_BIT = 0x0800  # STW1.11

#: rpm of one rev/s.
RPM = 60.0
#: Numbers of a position of 32 bits.
ROUND = 4294967296.0
HALF_ROUND = 2147483648.0

_NEXT = as_array(TRANSITIONS, STATES, EVENTS)
_PRIORITY = np.array(PRIORITY, np.int64)


@compiled
def _may_move(axis: Any) -> bool:
    """Whether velocity and ramps that are asked for are any."""
    return axis.asked_velocity >= 0.0 and axis.asked_acceleration > 0.0 and axis.asked_deceleration > 0.0


@compiled
def _can_start(axis: Any) -> bool:
    """Whether the task that is asked for can be executed from here."""
    if not _may_move(axis) or (axis.asked_velocity == 0.0 and not axis.asked_still):
        return False
    if axis.home_required and not axis.homed:
        return False
    if axis.asked_endless:
        return axis.asked_velocity == 0.0 or not at_limit_switch(axis, -1.0 if axis.asked_backwards else 1.0)
    target = _asked_target(axis)
    return within_limits(axis, target) and not at_limit_switch(axis, target - axis.commanded_position)


@compiled
def _asked_target(axis: Any) -> float:
    """Where the asked task leads to, on the shaft; a relative one counts from where the last one leads to.

    A motion task of the drive's own may say otherwise.
    """
    if axis.asked_relative:
        if axis.asked_base == TASK_FROM_COMMAND:
            return axis.commanded_position + axis.asked_position
        if axis.asked_base == TASK_FROM_TARGET:
            return axis.target + axis.asked_position
        if axis.asked_base == TASK_FROM_ACTUAL:
            return axis.position + axis.asked_position
        has_task = axis.motion in (TASK, INTERMEDIATE_STOP)
        return (axis.target if has_task else axis.commanded_position) + axis.asked_position
    return axis.origin + _rounds(axis) + axis.asked_position


@compiled
def _rounds(axis: Any) -> float:
    """How far XIST_A has counted round its 32 bits, rev: an absolute target is the number that it shows there."""
    if axis.targets_counted_on:
        return 0.0
    rounds = floor((position_number(axis, axis.measured_position) + HALF_ROUND) / ROUND)
    return rounds * ROUND * axis.position_step


@compiled
def _fastest_there(axis: Any, velocity: float) -> float:
    """A velocity on the way to the target, or of a task without one, within its limits."""
    if axis.task_endless:
        return fastest(axis, velocity, not axis.task_backwards)
    return fastest(axis, velocity, axis.target >= axis.commanded_position)


@compiled
def _start_task(axis: Any) -> None:
    axis.target = _asked_target(axis)
    axis.task_new = 0
    axis.task = axis.asked_task
    axis.over_ns = 0
    axis.task_endless = axis.asked_endless
    axis.task_relative = axis.asked_relative
    axis.task_backwards = axis.asked_backwards
    axis.task_top = _fastest_there(axis, axis.asked_velocity)
    take_ramps(axis, axis.task_top, axis.asked_acceleration, axis.asked_deceleration)
    axis.target_reached = 0
    _aim(axis)


@compiled
def _passes(axis: Any) -> bool:
    """Whether the task at hand hands its target over to the next one without a stop."""
    if axis.task < 0:
        return False
    both = TASK_CHAINED | TASK_PASSING
    return int(axis.mt_flags[int(axis.task)]) & both == both


@compiled
def _aim(axis: Any) -> None:
    """Towards the target of the task at hand; what passes it does not brake for it."""
    axis.task_velocity = _fastest_there(axis, axis.task_top * axis.override)
    axis.profile = PROFILE_TARGET
    if axis.task_endless:
        axis.profile = PROFILE_VELOCITY
        if axis.task_backwards:
            axis.task_velocity = -axis.task_velocity
    elif _passes(axis) and axis.target != axis.commanded_position:
        axis.profile = PROFILE_VELOCITY
        axis.task_backwards = 1 if axis.target < axis.commanded_position else 0
        if axis.task_backwards:
            axis.task_velocity = -axis.task_velocity


@compiled
def _jog(axis: Any) -> None:
    """Velocity and ramps of the jog at hand; with software limits the way ends at one of them."""
    if axis.jog == JOG_REAL_TIME:
        velocity = -axis.asked_velocity if axis.asked_backwards else axis.asked_velocity
        up = axis.asked_acceleration
        down = axis.asked_deceleration
    elif axis.jog == JOG_SEQUENCE:
        velocity = axis.jog_speed
        up = axis.jog_acceleration if axis.jog_acceleration > 0.0 else axis.ramp_up
        down = axis.jog_deceleration if axis.jog_deceleration > 0.0 else axis.ramp_down
    else:
        velocity = 0.0 if axis.jog == JOG_STILL else axis.jog_velocity[0]
        if axis.jog == JOG_MINUS:
            velocity = -velocity if axis.jog_mirrored else axis.jog_velocity[1]
        up = axis.jog_acceleration if axis.jog_acceleration > 0.0 else axis.acceleration
        down = axis.jog_deceleration if axis.jog_deceleration > 0.0 else axis.deceleration
    axis.target_reached = 0
    if up <= 0.0 or down <= 0.0 or at_limit_switch(axis, velocity):
        axis.profile = PROFILE_STOP
        return
    forwards = velocity > 0.0
    top = fastest(axis, abs(velocity), forwards)
    take_ramps(axis, top if forwards else -top, up, down)
    axis.profile = PROFILE_VELOCITY
    if axis.homed and velocity != 0.0 and axis.software_limits & (0x2 if forwards else 0x1):
        _jog_to_limit(axis, top, forwards)


@compiled
def _jog_to_limit(axis: Any, top: float, forwards: bool) -> None:
    """The way of a jog ends at the software limit; an axis beyond it goes no further, and not back either."""
    limit = axis.origin + (axis.limit_high if forwards else axis.limit_low)
    beyond = axis.commanded_position > limit if forwards else axis.commanded_position < limit
    axis.profile = PROFILE_STOP if beyond else PROFILE_TARGET
    axis.target = limit
    axis.task_velocity = top


@compiled
def _held(axis: Any, enabled: bool, waits: bool) -> int:
    """The events that hold now, as a bit set.  A task that ``waits`` for the one behind it is not over."""
    held = 1 << (ENTER if enabled else LEAVE)
    stw1 = int(axis.stw1)
    if axis.feed_free:
        stw1 |= PAUSE_BIT
    if not stw1 & REJECT_BIT or (axis.mdi_rejects and axis.task == TASK_MDI and not axis.mdi):
        held |= 1 << REJECT
    held |= 1 << (RESUME if stw1 & PAUSE_BIT else PAUSE)
    begins = axis.motion == FOLLOWING or not axis.interpolation_by_edge or axis.stw1_changed & START_BIT != 0
    held |= 1 << (FOLLOW if follows(axis) and begins else UNFOLLOW)
    resumes = axis.motion == INTERMEDIATE_STOP and stw1 & ~int(axis.motion_seen) & PAUSE_BIT != 0
    ready = (
        not interpolates(axis)
        and not (axis.resume_first and resumes)
        and (stw1 & (REJECT_BIT | PAUSE_BIT)) == (REJECT_BIT | PAUSE_BIT)
    )
    if axis.asked and ready and _can_start(axis):
        held |= 1 << START
    if axis.motion_seen & HOME_BIT and not stw1 & HOME_BIT:
        held |= 1 << HOME_OFF
    rises = not axis.home_by_edge or axis.stw1_changed & HOME_BIT != 0
    if axis.home_command or (stw1 & HOME_BIT and not axis.home_seen and rises):
        held |= 1 << HOME
    if axis.jog == JOG_NONE:
        held |= 1 << JOG_OFF
    elif axis.profile_velocity == 0.0:
        held |= 1 << JOG_ON
    if axis.stop_command == STOP_HALT:
        held |= 1 << HALT
    elif axis.stop_command == STOP_DROP:
        held |= 1 << REJECT | 1 << HOME_OFF
    if axis.continue_command and (stw1 & (REJECT_BIT | PAUSE_BIT)) == (REJECT_BIT | PAUSE_BIT):
        held |= 1 << CONTINUE
    if profile_over(axis) and not waits:
        held |= 1 << OVER
    if homing_fails(axis) if axis.motion == HOMING else at_limit_switch(axis, axis.profile_velocity):
        held |= 1 << BLOCKED
    return held


@compiled
def _advance(axis: Any, held: int) -> int:
    """Take at most one transition and do what belongs to it: the only writer of ``motion``.

    Returns the event that was taken, -1 for none.
    """
    for event in _PRIORITY:
        if not held & (1 << event):
            continue
        following = _NEXT[axis.motion, event]
        if following < 0:
            continue
        if event == OVER and axis.motion == HOMING and not homing_over(axis):
            return event
        if event == OVER and axis.motion == TASK:
            axis.target_reached = 1
        if event == BLOCKED and axis.motion == HOMING:
            axis.home_error = 1
        if event == ENTER:
            # where a stop without a position controller ended: nothing of the way that it took is made up for
            axis.commanded_position = axis.position
            axis.profile_velocity = axis.velocity
            begin_profile(axis)
            axis.profile = PROFILE_STOP
            # a shaft that turns when operation begins comes to rest as after jogging
            axis.task_deceleration = axis.jog_deceleration if axis.jog_deceleration > 0.0 else axis.deceleration
        elif event == START:
            _start_task(axis)
            axis.acknowledged = 1 if axis.control_config & CONFIG_RISING_EDGE else 1 - axis.acknowledged
        elif event in (RESUME, CONTINUE):
            _aim(axis)
        elif event == HOME:
            if axis.motion == FOLLOWING:
                begin_profile(axis)
            if interpolates(axis):
                # Moog MSD manual 12.1: the profile generator takes over
                axis.ramp_generator_left = axis.ramp_generator_set + 1
            start_homing(axis)
        elif event == FOLLOW:
            begin_interpolation(axis)
        elif event == UNFOLLOW:
            begin_profile(axis)
            take_ramps(axis, 0.0, axis.ramp_up, axis.ramp_down)
            axis.profile = PROFILE_STOP
        elif event != OVER:
            axis.profile = PROFILE_STOP
        axis.motion = following
        return event
    return -1


@compiled
def _follow_on(axis: Any, now: int) -> bool:
    """Begin the task behind a chained one, once its dwell is over; true while there is one to come or begun."""
    if axis.motion != TASK or axis.task < 0:
        return False
    if axis.asked:
        # what is asked for in this step goes before
        return True
    number = int(axis.task)
    if axis.profile == PROFILE_VELOCITY:
        left = axis.target - axis.commanded_position
        if left < 0.0 if axis.task_backwards else left > 0.0:
            return False
        # not further than the target, should nothing follow
        axis.profile = PROFILE_TARGET
        axis.task_velocity = abs(axis.task_velocity)
    elif not profile_over(axis) or not int(axis.mt_flags[number]) & TASK_CHAINED:
        return False
    if axis.over_ns == 0:
        axis.over_ns = now
    if now - axis.over_ns < axis.mt_dwell_ns[number]:
        return True
    select_task(axis, int(axis.mt_next[number]))
    follows = _can_start(axis)
    axis.task_error = 0 if follows else 2
    if follows:
        _start_task(axis)
    return follows


@compiled
def _change_way(axis: Any) -> None:
    """A way that began ends where it was to; velocity and ramps without a handshake count for it at once."""
    if not axis.feed_free or not axis.asked_relative or axis.task_endless or not _may_move(axis):
        return
    axis.task_top = axis.asked_velocity
    axis.task_acceleration = axis.asked_acceleration
    axis.task_deceleration = axis.asked_deceleration


@compiled
def take_motion(axis: Any, now: int) -> None:
    """Once in each firmware step: what the controller asks for, and what becomes of it."""
    enabled = axis.state == 4 and axis.opmode == 2 and not axis.servo_control and not brake_holds(axis)
    waits = enabled and _follow_on(axis, now)
    event = _advance(axis, _held(axis, enabled, waits))
    if enabled and axis.asked:
        axis.task_error = 0 if event == START else 1
    axis.home_command = 0
    axis.stop_command = 0
    axis.continue_command = 0
    if axis.motion == OUT or not axis.stw1 & HOME_BIT:
        axis.home_seen = 0
    if axis.motion == JOG:
        _jog(axis)
    elif axis.motion == TASK:
        _change_way(axis)
        top = _fastest_there(axis, axis.task_top * axis.override)
        axis.task_velocity = -top if axis.profile == PROFILE_VELOCITY and axis.task_backwards else top
    elif axis.motion == HOMING:
        step_homing(axis)
    if axis.motion != HOMING:
        axis.home_held = 0.0
        if not axis.homing_ends_interpolation:
            axis.ramp_generator_left = 0
    if enabled and axis.following_limit > 0.0 and abs(axis.following_error) > axis.following_limit:
        raise_fault(axis, axis.following_fault, now)
    if axis.control_config & CONFIG_RISING_EDGE and not axis.stw1 & START_BIT:
        axis.acknowledged = 0
    axis.motion_seen = axis.stw1


@compiled
def positioning_command(axis: Any, seconds: float) -> float:
    """The velocity command, rpm: that of the profile, fed forward, and what the position controller adds."""
    # both places of the same moment, the beginning of the step
    error = axis.commanded_position - axis.measured_position
    if axis.motion == FOLLOWING:
        step_interpolation(axis, seconds)
    else:
        step_profile(axis, seconds)
    return axis.speed_feed_forward * axis.profile_velocity + axis.position_gain * error * RPM
