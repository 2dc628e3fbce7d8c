"""Positioning: traversing tasks, intermediate stop, homing and jogging inside S4 (PROFIdrive application class 3).

What an axis in position mode does while operation is enabled, as a table of its own (AKD PROFINET manual 5.10, HIWIN E1
manual 3.3.2 and 6.6 to 6.8, Moog MSD manual 10.5; their figures are missing: the profile's extension of S4 applies):

==================  ========================================================
STANDBY             standing, or braked to a stop; a task may begin
TASK                a traversing task runs
INTERMEDIATE_STOP   braked, the task waits
BRAKING             braking after a rejected task, homing or jogging
HOMING              the axis looks for its home
JOG                 jogging at a set point, or at the task's own velocity
FOLLOWING           following cyclic set points in the interpolating mode (Moog MSD manual 10.6)
HALTED              a parameter ended the task (AKD: DRV.STOP), which another one can continue
==================  ========================================================

Positions here are the shaft's; ``homing.origin`` is where the machine's zero lies on it.
"""

from __future__ import annotations

from math import floor
from typing import Any

import numpy as np

from pnfarm.firmware.faults import raise_fault
from pnfarm.firmware.motion.homing import homing_fails, homing_over, start_homing, step_homing
from pnfarm.firmware.motion.interpolation import begin_interpolation, follows, interpolates, step_interpolation
from pnfarm.firmware.motion.motion_tasks import select_task
from pnfarm.firmware.motion.profile_generator import begin_profile, profile_over, step_profile
from pnfarm.firmware.motion.travel import (
    at_limit_switch,
    fastest,
    position_number,
    software_limits,
    take_ramps,
    within_limits,
)
from pnfarm.firmware.motor.motor import brake_holds
from pnfarm.firmware.transitions import as_array, possible
from pnfarm.table.axis_codes import (
    CONFIG_RISING_EDGE,
    JOG_MINUS,
    JOG_NONE,
    JOG_REAL_TIME,
    JOG_SEQUENCE,
    JOG_STILL,
    MOTION_HALTED,
    MOTION_INTERMEDIATE_STOP,
    MOTION_TASK,
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
from pnfarm.table.compiling.compiled import compiled, inlined

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
    "asked_target",
    "positioning_command",
    "take_motion",
]


# States (``positioning.state``).
OUT = 0  # operation is not enabled, or another mode is in force
STANDBY = 1
TASK = MOTION_TASK
INTERMEDIATE_STOP = MOTION_INTERMEDIATE_STOP
BRAKING = 4
HOMING = 5
JOG = 6
HALTED = MOTION_HALTED
FOLLOWING = 8
STATES = 9

# Events.
LEAVE = 0  # operation ends
ENTER = 1  # operation begins
REJECT = 2
PAUSE = 3
RESUME = 4
START = 5  # a traversing task that can be executed
HOME = 6
HOME_OFF = 7  # homing is no longer requested
JOG_ON = 8
JOG_OFF = 9
OVER = 10  # the profile has reached its end
BLOCKED = 11  # the axis runs into a limit switch
HALT = 12  # a parameter halts what runs
CONTINUE = 13  # a parameter continues the halted task
FOLLOW = 14  # the axis is to follow cyclic positions
UNFOLLOW = 15  # it no longer is
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
    # following cyclic positions
    (STANDBY, FOLLOW): FOLLOWING,
    (FOLLOWING, LEAVE): OUT,
    (FOLLOWING, UNFOLLOW): BRAKING,
    (FOLLOWING, HOME): HOMING,
}

#: Priority of events that hold together; a task that begins in the step that ends an intermediate stop is newer.
PRIORITY = (
    LEAVE, BLOCKED, REJECT, HOME_OFF, JOG_OFF, UNFOLLOW, HALT, PAUSE, CONTINUE, START, RESUME, HOME, JOG_ON, FOLLOW,
    OVER, ENTER,
)  # fmt: skip

#: rpm of one rev/s.
RPM = 60.0
#: Number of values of a 32-bit position.
ROUND = 4294967296.0
HALF_ROUND = 2147483648.0

_NEXT = as_array(TRANSITIONS, STATES, EVENTS)
_POSSIBLE = possible(TRANSITIONS, STATES)
_PRIORITY = np.array(PRIORITY, np.int64)


@inlined
def _may_move(asked: Any) -> bool:
    """Whether the requested velocity and ramps are usable."""
    return asked.velocity >= 0.0 and asked.acceleration > 0.0 and asked.deceleration > 0.0


@inlined
def _can_start(axis: Any) -> bool:
    """Whether the requested task can be executed from here."""
    if not _may_move(axis.asked) or (axis.asked.velocity == 0.0 and not axis.asked.still):
        return False
    if axis.homing.settings.required and not axis.homing.homed:
        return False
    if axis.asked.endless:
        return axis.asked.velocity == 0.0 or not at_limit_switch(axis.machine, -1.0 if axis.asked.backwards else 1.0)
    target = asked_target(axis)
    return within_limits(axis.travel, axis.homing, target) and not at_limit_switch(
        axis.machine, target - axis.profile.position
    )


@inlined
def asked_target(axis: Any) -> float:
    """Target of the requested task on the shaft; a relative one counts from where the running one leads to.

    A motion task stored in the drive may define another base.  One without a target leads nowhere: from where it is.
    """
    if axis.asked.relative:
        if axis.asked.counts_from == TASK_FROM_COMMAND:
            return axis.profile.position + axis.asked.position
        if axis.asked.counts_from == TASK_FROM_TARGET:
            return axis.profile.target + axis.asked.position
        if axis.asked.counts_from == TASK_FROM_ACTUAL:
            return axis.motor.position + axis.asked.position
        leads = axis.positioning.state in (TASK, INTERMEDIATE_STOP) and not axis.positioning.endless
        return (axis.profile.target if leads else axis.profile.position) + axis.asked.position
    return axis.homing.origin + _rounds(axis.motor, axis.travel, axis.positioning, axis.homing) + axis.asked.position


@inlined
def _rounds(motor: Any, travel: Any, positioning: Any, homing: Any) -> float:
    """By how much XIST_A has wrapped at its 32 bits, rev: an absolute target is a number that XIST_A shows."""
    if positioning.settings.targets_counted_on:
        return 0.0
    rounds = floor((position_number(travel, homing, motor.measured_position) + HALF_ROUND) / ROUND)
    return rounds * ROUND * travel.settings.position_step


@inlined
def _fastest_there(motor: Any, travel: Any, positioning: Any, profile: Any, velocity: float) -> float:
    """The velocity of a task, with a target or without, within the limits of its direction."""
    if positioning.endless:
        return fastest(motor, travel, velocity, not positioning.backwards)
    return fastest(motor, travel, velocity, profile.target >= profile.position)


@inlined
def _start_task(axis: Any) -> None:
    if not axis.asked.endless:
        axis.profile.target = asked_target(axis)
    axis.asked.renewed = 0
    axis.positioning.task = axis.asked.number
    axis.positioning.over_ns = 0
    axis.positioning.endless = axis.asked.endless
    axis.positioning.relative = axis.asked.relative
    axis.positioning.backwards = axis.asked.backwards
    axis.positioning.top = _fastest_there(axis.motor, axis.travel, axis.positioning, axis.profile, axis.asked.velocity)
    take_ramps(axis.profile, axis.positioning.top, axis.asked.acceleration, axis.asked.deceleration)
    axis.positioning.target_reached = 0
    _aim(axis)


@inlined
def _passes(positioning: Any, motion_tasks: Any) -> bool:
    """Whether the running task changes over to the next one at its target without a stop."""
    if positioning.task < 0:
        return False
    both = TASK_CHAINED | TASK_PASSING
    return int(motion_tasks.settings.kind[int(positioning.task)]) & both == both


@inlined
def _aim(axis: Any) -> None:
    """Head for the target of the running task; a task that passes it does not brake for it."""
    axis.profile.top = _fastest_there(
        axis.motor, axis.travel, axis.positioning, axis.profile, axis.positioning.top * axis.asked.override
    )
    axis.profile.mode = PROFILE_TARGET
    if axis.positioning.endless:
        axis.profile.mode = PROFILE_VELOCITY
        if axis.positioning.backwards:
            axis.profile.top = -axis.profile.top
    elif _passes(axis.positioning, axis.motion_tasks) and axis.profile.target != axis.profile.position:
        axis.profile.mode = PROFILE_VELOCITY
        axis.positioning.backwards = 1 if axis.profile.target < axis.profile.position else 0
        if axis.positioning.backwards:
            axis.profile.top = -axis.profile.top


@compiled
def _jog(axis: Any) -> None:
    """Velocity and ramps of the running jog; with software limits it ends at one of them."""
    if axis.jog.asked == JOG_REAL_TIME:
        velocity = -axis.asked.velocity if axis.asked.backwards else axis.asked.velocity
        up = axis.asked.acceleration
        down = axis.asked.deceleration
    elif axis.jog.asked == JOG_SEQUENCE:
        velocity = axis.jog.speed
        up = axis.jog.settings.acceleration if axis.jog.settings.acceleration > 0.0 else axis.ramp.up
        down = axis.jog.settings.deceleration if axis.jog.settings.deceleration > 0.0 else axis.ramp.down
    else:
        velocity = 0.0 if axis.jog.asked == JOG_STILL else axis.jog.settings.velocity[0]
        if axis.jog.asked == JOG_MINUS:
            velocity = -velocity if axis.jog.settings.mirrored else axis.jog.settings.velocity[1]
        up = axis.jog.settings.acceleration if axis.jog.settings.acceleration > 0.0 else axis.ramp.settings.acceleration
        down = (
            axis.jog.settings.deceleration if axis.jog.settings.deceleration > 0.0 else axis.ramp.settings.deceleration
        )
    axis.positioning.target_reached = 0
    if up <= 0.0 or down <= 0.0 or at_limit_switch(axis.machine, velocity):
        axis.profile.mode = PROFILE_STOP
        return
    forwards = velocity > 0.0
    top = fastest(axis.motor, axis.travel, abs(velocity), forwards)
    take_ramps(axis.profile, top if forwards else -top, up, down)
    axis.profile.mode = PROFILE_VELOCITY
    if axis.jog.incremental and velocity != 0.0:
        distance = axis.jog.settings.distance[1 if axis.jog.asked == JOG_MINUS else 0]
        axis.profile.mode = PROFILE_TARGET
        axis.profile.target = axis.jog.start + (distance if forwards else -distance)
        axis.profile.top = top
    _end_at_limit(axis.travel, axis.profile, axis.homing, top, forwards)


@inlined
def _end_at_limit(travel: Any, profile: Any, homing: Any, top: float, forwards: bool) -> None:
    """End a motion at the software limit; an axis beyond it goes no further, and not back either."""
    if not homing.homed or top == 0.0 or not software_limits(travel) & (0x2 if forwards else 0x1):
        return
    limit = homing.origin + (travel.settings.high if forwards else travel.settings.low)
    if profile.mode == PROFILE_TARGET and (profile.target <= limit if forwards else profile.target >= limit):
        return
    beyond = profile.position > limit if forwards else profile.position < limit
    profile.mode = PROFILE_STOP if beyond else PROFILE_TARGET
    profile.target = limit
    profile.top = top


@compiled
def _held(axis: Any, enabled: bool, waits: bool) -> int:
    """The events that hold now, as a bit set.  A task that ``waits`` for the next one is not over."""
    held = 1 << (ENTER if enabled else LEAVE)
    paused = axis.orders.pause != 0 and not axis.asked.feed_free
    goes_on = not paused and not axis.orders.reject
    if axis.orders.reject or (
        axis.asked.settings.mdi_rejects and axis.positioning.task == TASK_MDI and not axis.asked.mdi
    ):
        held |= 1 << REJECT
    held |= 1 << (PAUSE if paused else RESUME)
    begins = (
        axis.positioning.state == FOLLOWING
        or not axis.positioning.settings.interpolation_by_edge
        or axis.orders.start_changed != 0
    )
    held |= 1 << (FOLLOW if follows(axis.drive, axis.orders, axis.ramp, axis.interpolation) and begins else UNFOLLOW)
    resumes = axis.positioning.state == INTERMEDIATE_STOP and not paused and not axis.positioning.free_before
    ready = (
        not interpolates(axis.drive, axis.ramp, axis.interpolation)
        and not (axis.positioning.settings.resume_first and resumes)
        and goes_on
    )
    if axis.asked.begins and ready and _can_start(axis):
        held |= 1 << START
    if axis.positioning.home_before and not axis.orders.home:
        held |= 1 << HOME_OFF
    rises = not axis.homing.settings.by_edge or axis.orders.home_changed != 0
    if axis.commands.home or (axis.orders.home and not axis.homing.seen and rises):
        held |= 1 << HOME
    if axis.jog.asked == JOG_NONE:
        held |= 1 << JOG_OFF
    elif axis.profile.velocity == 0.0:
        held |= 1 << JOG_ON
    if axis.commands.stop == STOP_HALT:
        held |= 1 << HALT
    elif axis.commands.stop == STOP_DROP:
        held |= 1 << REJECT | 1 << HOME_OFF
    if axis.commands.resume and goes_on:
        held |= 1 << CONTINUE
    if profile_over(axis.profile) and not waits:
        held |= 1 << OVER
    if (
        homing_fails(axis.machine, axis.profile, axis.homing)
        if axis.positioning.state == HOMING
        else at_limit_switch(axis.machine, axis.profile.velocity)
    ):
        held |= 1 << BLOCKED
    return held


@compiled
def _advance(axis: Any, held: int) -> int:
    """Take at most one transition and carry out its action: the only writer of ``positioning.state``.

    Returns the event that was taken, -1 for none.
    """
    held &= _POSSIBLE[axis.positioning.state]
    if held == 0:
        return -1
    for event in _PRIORITY:
        if not held & (1 << event):
            continue
        following = _NEXT[axis.positioning.state, event]
        if event == OVER and axis.positioning.state == HOMING and not homing_over(axis):
            return event
        if event == OVER and axis.positioning.state == TASK:
            axis.positioning.target_reached = 1
        if event == BLOCKED and axis.positioning.state == HOMING:
            axis.homing.error = 1
        if event == ENTER:
            # from where a stop without position control ended: its distance is not made up for
            axis.profile.position = axis.motor.position
            axis.profile.velocity = axis.motor.velocity
            begin_profile(axis.profile)
            axis.profile.mode = PROFILE_STOP
            # a shaft that turns when operation begins comes to rest as after jogging
            axis.profile.deceleration = (
                axis.jog.settings.deceleration
                if axis.jog.settings.deceleration > 0.0
                else axis.ramp.settings.deceleration
            )
        elif event == START:
            _start_task(axis)
            axis.positioning.acknowledged = (
                1 if axis.asked.settings.control_config & CONFIG_RISING_EDGE else 1 - axis.positioning.acknowledged
            )
        elif event in (RESUME, CONTINUE):
            _aim(axis)
        elif event == HOME:
            if axis.positioning.state == FOLLOWING:
                begin_profile(axis.profile)
            if interpolates(axis.drive, axis.ramp, axis.interpolation):
                # Moog MSD manual 12.1: the profile generator takes over
                axis.ramp.generator_left = axis.ramp.settings.generator_set + 1
            start_homing(axis)
        elif event == JOG_ON:
            axis.jog.start = axis.profile.position
        elif event == FOLLOW:
            begin_interpolation(axis.profile, axis.interpolation)
        elif event == UNFOLLOW:
            begin_profile(axis.profile)
            take_ramps(axis.profile, 0.0, axis.ramp.up, axis.ramp.down)
            axis.profile.mode = PROFILE_STOP
        elif event != OVER:
            axis.profile.mode = PROFILE_STOP
        axis.positioning.state = following
        return event
    return -1


@inlined
def _follow_on(axis: Any, now: int) -> bool:
    """Begin the task after a chained one, once its dwell is over; true while one is to come or has begun."""
    if axis.positioning.state != TASK or axis.positioning.task < 0 or axis.positioning.endless:
        return False
    if axis.asked.begins:
        # a request in this step takes precedence
        return True
    number = int(axis.positioning.task)
    if axis.profile.mode == PROFILE_VELOCITY:
        left = axis.profile.target - axis.profile.position
        if left < 0.0 if axis.positioning.backwards else left > 0.0:
            return False
        # stop at the target, should nothing follow
        axis.profile.mode = PROFILE_TARGET
        axis.profile.top = abs(axis.profile.top)
    elif not profile_over(axis.profile) or not int(axis.motion_tasks.settings.kind[number]) & TASK_CHAINED:
        return False
    if axis.positioning.over_ns == 0:
        axis.positioning.over_ns = now
    if now - axis.positioning.over_ns < axis.motion_tasks.settings.dwell_ns[number]:
        return True
    select_task(axis.asked, axis.motion_tasks, int(axis.motion_tasks.settings.next[number]))
    follows = _can_start(axis)
    axis.positioning.error = 0 if follows else 2
    if follows:
        _start_task(axis)
    return follows


@inlined
def _change_way(asked: Any, positioning: Any, profile: Any) -> None:
    """Change a running task: its target stays; velocity and ramps without a handshake apply at once."""
    if not asked.feed_free or not asked.relative or positioning.endless or not _may_move(asked):
        return
    positioning.top = asked.velocity
    profile.acceleration = asked.acceleration
    profile.deceleration = asked.deceleration


@inlined
def take_motion(axis: Any, now: int) -> None:
    """Once in each firmware step: take the controller's requests and advance the state."""
    enabled = (
        axis.drive.state == 4
        and axis.drive.settings.opmode == 2
        and not axis.interpolation.settings.servo_control
        and not brake_holds(axis.brake)
    )
    waits = enabled and _follow_on(axis, now)
    # from there nothing but the beginning of operation leads anywhere
    out = axis.positioning.state == OUT and not enabled
    event = -1 if out else _advance(axis, _held(axis, enabled, waits))
    if enabled and axis.asked.begins:
        axis.positioning.error = 0 if event == START else 1
    axis.commands.home = 0
    axis.commands.stop = 0
    axis.commands.resume = 0
    if axis.positioning.state == OUT or not axis.orders.home:
        axis.homing.seen = 0
    if axis.positioning.state == JOG:
        _jog(axis)
    elif axis.positioning.state == TASK:
        _change_way(axis.asked, axis.positioning, axis.profile)
        top = _fastest_there(
            axis.motor, axis.travel, axis.positioning, axis.profile, axis.positioning.top * axis.asked.override
        )
        axis.profile.top = -top if axis.profile.mode == PROFILE_VELOCITY and axis.positioning.backwards else top
        if axis.positioning.endless:
            # in each step: limits count from when the home is known, or a telegram switches them on
            _end_at_limit(axis.travel, axis.profile, axis.homing, top, not axis.positioning.backwards)
    elif axis.positioning.state == HOMING:
        step_homing(axis)
    if axis.positioning.state != HOMING:
        axis.homing.current_limit = 0.0
        if not axis.homing.settings.ends_interpolation:
            axis.ramp.generator_left = 0
    if (
        enabled
        and axis.positioning.settings.following_limit > 0.0
        and abs(axis.positioning.following_error) > axis.positioning.settings.following_limit
    ):
        raise_fault(axis.faults, axis.positioning.settings.following_fault, now)
    if axis.asked.settings.control_config & CONFIG_RISING_EDGE and not axis.orders.start:
        axis.positioning.acknowledged = 0
    axis.positioning.home_before = axis.orders.home
    axis.positioning.free_before = 0 if axis.orders.pause else 1


@inlined
def positioning_command(motor: Any, positioning: Any, profile: Any, interpolation: Any, seconds: float) -> float:
    """The velocity command, rpm: that of the profile, fed forward, and what the position controller adds."""
    # both positions are those at the beginning of the step
    error = profile.position - motor.measured_position
    if positioning.state == FOLLOWING:
        step_interpolation(profile, interpolation, seconds)
    else:
        step_profile(profile, seconds)
    return motor.settings.speed_feed_forward * profile.velocity + positioning.settings.gain * error * RPM
