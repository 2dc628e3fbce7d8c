"""The profile generator of positioning: from the present position to a target, in the least time that the limits allow.

A trapezoid: up at the task's acceleration, along at its velocity, down at its deceleration, so that the axis reaches
the target at rest.  Every step is solved in closed form and not integrated, so that the result does not depend on the
length of the steps: the axis arrives exactly, at the time that the formulas of a trapezoid give.  Target and limits may
change at any time ("change on the fly"); an axis that can no longer stop at its target passes it and comes back.

With a jerk time the trapezoid is averaged over that time: acceleration then changes by at most acceleration / time per
second, and the axis arrives later by that time, exactly at the target.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from pnfarm.table.axis_codes import JERK_TAPS, PROFILE_TARGET, PROFILE_VELOCITY
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["begin_profile", "profile_over", "step_profile"]


#: rev/s of one rpm.
PER_SECOND = 1.0 / 60.0
#: Within this distance the target is reached, rev: a thousandth of an increment of the finest encoder.
THERE = 1e-10
#: Times below this count as over, s.
NO_TIME = 1e-12
#: Most sections of a trapezoid: a reversal, two changes of velocity, constant velocity and the way down.
PIECES = 8


@inlined
def _trapezoid(profile: Any, seconds: float) -> None:
    """Move the raw position and velocity (rev, rev/s) by ``seconds`` along the time-optimal trapezoid."""
    position = profile.raw_position
    velocity = profile.raw_velocity
    target = profile.target
    top = profile.top * PER_SECOND
    up = profile.acceleration * PER_SECOND / (1.0 + profile.settings.slowness)
    down = profile.deceleration * PER_SECOND / (1.0 + profile.settings.slowness)
    left = seconds
    for _ in range(PIECES):
        if left <= NO_TIME:
            break
        stopping = velocity * abs(velocity) / (2.0 * down)
        beyond = target - (position + stopping)
        if velocity == 0.0 and abs(target - position) <= THERE:
            position = target
            break
        # decelerating to the target; otherwise towards it, unless the axis moves the other way
        landing = abs(beyond) <= THERE and velocity != 0.0
        forward = 1.0 if (velocity if landing else beyond) > 0.0 else -1.0
        speed = velocity * forward
        if landing or speed < 0.0 or speed > top + NO_TIME:
            floor = 0.0 if landing or speed < 0.0 else top
            rate = -down if velocity > 0.0 else down
            needed = (abs(velocity) - floor) / down
            time = min(left, needed)
            position += velocity * time + 0.5 * rate * time * time
            velocity += rate * time
            if needed <= left:
                velocity = floor if velocity >= 0.0 and rate < 0.0 else -floor
                if landing:
                    position = target
            left -= time
            continue
        distance = (target - position) * forward
        # the velocity at which acceleration changes to the deceleration that ends at the target
        peak = sqrt(max(0.0, (2.0 * up * down * distance + down * speed * speed) / (up + down)))
        wanted = min(top, peak)
        if wanted > speed + NO_TIME:
            needed = (wanted - speed) / up
            time = min(left, needed)
            position += forward * (speed * time + 0.5 * up * time * time)
            velocity = forward * (wanted if needed <= left else speed + up * time)
            left -= time
            continue
        if speed <= 0.0:
            break
        needed = max(0.0, (distance - speed * speed / (2.0 * down)) / speed)
        time = min(left, needed)
        position += velocity * time
        left -= time
        if needed <= time:
            # from here on it decelerates, despite rounding
            position = target - velocity * abs(velocity) / (2.0 * down)
    profile.raw_position = position
    profile.raw_velocity = velocity


@compiled
def _run_up(profile: Any, target: float, seconds: float) -> None:
    """Move by ``seconds`` towards a velocity of ``target`` rev/s, and continue at it."""
    velocity = profile.raw_velocity
    up = profile.acceleration * PER_SECOND / (1.0 + profile.settings.slowness)
    down = profile.deceleration * PER_SECOND / (1.0 + profile.settings.slowness)
    position = profile.raw_position
    left = seconds
    for _ in range(3):
        if left <= NO_TIME:
            break
        if velocity == target:
            position += velocity * left
            break
        slower = velocity * target < 0.0 or abs(target) < abs(velocity)
        # a reversal stops first
        end = 0.0 if velocity * target < 0.0 else target
        rate = down if slower else up
        needed = abs(end - velocity) / rate
        time = min(left, needed)
        signed = rate if end > velocity else -rate
        position += velocity * time + 0.5 * signed * time * time
        velocity = end if needed <= left else velocity + signed * time
        left -= time
    profile.raw_position = position
    profile.raw_velocity = velocity


@inlined
def _move(profile: Any, seconds: float) -> None:
    if profile.mode == PROFILE_TARGET:
        _trapezoid(profile, seconds)
    elif profile.mode == PROFILE_VELOCITY:
        _run_up(profile, profile.top * PER_SECOND, seconds)
    else:
        _run_up(profile, 0.0, seconds)


@inlined
def begin_profile(profile: Any) -> None:
    """Start from the axis' present commanded position and velocity."""
    velocity = profile.velocity * PER_SECOND
    profile.raw_velocity = velocity
    # an average over some time lags behind by half of it
    profile.raw_position = profile.position + 0.5 * profile.settings.jerk_time * velocity
    for i in range(JERK_TAPS):
        profile.taps[i] = velocity
    profile.mean_velocity = velocity
    profile.tap_left = 0.0


@inlined
def _next_tap(profile: Any, spacing: float) -> None:
    """Advance the trapezoid by one tap; its mean velocity replaces the oldest one."""
    before = profile.raw_position
    _move(profile, spacing)
    profile.taps[profile.tap_next] = (profile.raw_position - before) / spacing
    profile.tap_next = (profile.tap_next + 1) % JERK_TAPS
    total = 0.0
    for i in range(JERK_TAPS):
        total += profile.taps[i]
    profile.mean_velocity = total / JERK_TAPS
    profile.tap_left = spacing


@inlined
def step_profile(profile: Any, seconds: float) -> None:
    """Advance ``profile.position`` and ``profile.velocity`` by ``seconds`` of the running profile."""
    if profile.settings.jerk_time <= 0.0:
        _move(profile, seconds)
        profile.position = profile.raw_position
        profile.velocity = profile.raw_velocity / PER_SECOND
        return
    spacing = profile.settings.jerk_time / JERK_TAPS
    velocity = profile.velocity * PER_SECOND
    left = seconds
    while left > NO_TIME:
        if profile.tap_left <= NO_TIME:
            _next_tap(profile, spacing)
        time = min(left, profile.tap_left)
        following = profile.mean_velocity
        if profile.tap_left - time > NO_TIME:
            following = velocity + (profile.mean_velocity - velocity) * time / profile.tap_left
        profile.position += 0.5 * (velocity + following) * time
        velocity = following
        profile.tap_left -= time
        left -= time
    profile.velocity = velocity / PER_SECOND
    if profile_over(profile):
        profile.position = profile.raw_position


@inlined
def profile_over(profile: Any) -> bool:
    """Whether the axis stands at its target, or has come to the requested stop."""
    if profile.raw_velocity != 0.0 or profile.velocity != 0.0:
        return False
    if profile.mode == PROFILE_TARGET and profile.raw_position != profile.target:
        return False
    if profile.mode == PROFILE_VELOCITY:
        # endless motion is never over: an override of 0 does not end it
        return False
    if profile.settings.jerk_time > 0.0:
        for i in range(JERK_TAPS):
            if profile.taps[i] != 0.0:
                return False
    return True
