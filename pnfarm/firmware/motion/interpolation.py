"""Set points of each cycle: positions to follow (application class 5) and dynamic servo control (class 4).

*Positions* (Moog MSD manual 10.6): each frame brings XSOLL_A.  The drive goes there within one cycle along a cubic
curve that begins with its present velocity and ends with that of the last two set points, so that it is one cycle
behind; P-0370 calls that a cubic spline.  If a frame is missing, the axis continues for one more cycle, so that the
next frame finds it where it would have been; the cycle is the connection's, so that frames may come early or
late.  XSOLL_A wraps at 32 bits as XIST_A does: of the positions with that number the nearest one is meant.

*Dynamic servo control* (10.8; PROFIdrive 4.2, 6.3.4): the controller sends its position deviation XERR, in steps of
G1_XIST1, and the position controller's gain KPC, in 1/1000 per second.  The drive closes that loop itself, with the
shaft's motion since the position that the controller knows; NSOLL_B is the feed-forward.  No word reports which
position that is: the one in the last frame that left before the set points came (assumed).
"""

from __future__ import annotations

from math import floor
from typing import Any

from pnfarm.table.axis_codes import RAMP_GENERATED, RAMP_PASSED_BY
from pnfarm.table.compiling.compiled import inlined

__all__ = [
    "POSITION_MODE",
    "begin_interpolation",
    "follows",
    "generator_in_force",
    "interpolates",
    "servo_command",
    "step_interpolation",
    "take_position",
]


#: A pause between two frames that is too long for a cycle, ns.
LONGEST_CYCLE_NS = 1_000_000_000
#: A frame that deviates from its due time by less than this part of a cycle is on time ...
IN_STEP = 0.6
#: ... and this part of its deviation is corrected at once.
MADE_UP = 0.05
#: The axis continues for this many known cycles: a frame may get lost and the next one be late.
GONE_ON = 1.5
#: Number of values of a 32-bit signal.
NUMBERS = 4294967296.0
RPM = 60.0
POSITION_MODE = 2


@inlined
def follows(drive: Any, orders: Any, ramp: Any, interpolation: Any) -> bool:
    """Whether cyclic positions move the axis now: interpolating mode, and nothing holds set points back."""
    return (
        interpolates(drive, ramp, interpolation) and orders.ramp != 0 and orders.ramp_runs != 0 and orders.setpoint != 0
    )


@inlined
def generator_in_force(ramp: Any) -> int:
    """``ramp.generator``, or its value since homing changed it (Moog MSD manual 12.1), until it is set again."""
    left = ramp.generator_left != 0 and ramp.generator_left == ramp.settings.generator_set + 1
    return RAMP_GENERATED if left else int(ramp.settings.generator)


@inlined
def interpolates(drive: Any, ramp: Any, interpolation: Any) -> bool:
    """Whether the axis is in a mode in which it follows cyclic positions."""
    return (
        drive.settings.opmode == POSITION_MODE
        and generator_in_force(ramp) == RAMP_PASSED_BY
        and not interpolation.settings.servo_control
    )


@inlined
def begin_interpolation(profile: Any, interpolation: Any) -> None:
    """Begin at the commanded position; the next frame gives the first curve."""
    interpolation.start = profile.position
    interpolation.end = profile.position
    interpolation.start_speed = profile.velocity / RPM
    interpolation.end_speed = 0.0
    interpolation.time = 0.0
    interpolation.pause = 0.0
    interpolation.elapsed = 0.0
    interpolation.frames_ns = 0


@inlined
def _nearest_place(travel: Any, profile: Any, homing: Any, number: int) -> float:
    """Shaft position of a 32-bit number: of all positions with this number, the nearest one."""
    here = (profile.position - homing.origin) / travel.settings.position_step
    rounds = floor((here - number) / NUMBERS + 0.5)
    return homing.origin + (number + rounds * NUMBERS) * travel.settings.position_step


@inlined
def _in_step(interpolation: Any, pause: float, cycle: float) -> int:
    """How many cycles a frame follows the one before; 0 where the frame is not on time at the end of the present curve.

    The present curve ends when the next frame is due, so that early and late frames are measured against its end.
    """
    late = pause - interpolation.time
    cycles = max(1, 1 + floor(late / cycle + 0.5))
    return cycles if abs(interpolation.time - pause + (cycles - 1) * cycle) <= IN_STEP * cycle else 0


@inlined
def take_position(axis: Any, number: int, now: int) -> None:
    """A new curve to the position ``number``, in position steps, of a frame that came since the last step.

    It ends when the next frame is due.  Where the connection does not say its cycle, that is the shorter one of the
    last two pauses, in one of which a frame may have got lost.
    """
    place = _nearest_place(axis.travel, axis.profile, axis.homing, number)
    since = now - axis.interpolation.frames_ns
    first = axis.interpolation.frames_ns == 0 or since <= 0 or since > LONGEST_CYCLE_NS
    pause = (axis.step_ns if first else since) * 1e-9
    cycle = axis.interpolation.settings.cycle_ns * 1e-9
    time = pause if first or axis.interpolation.pause <= 0.0 else min(pause, float(axis.interpolation.pause))
    way_time = pause
    if cycle > 0.0 and not first:
        cycles = _in_step(axis.interpolation, pause, cycle)
        time = cycle
        if cycles > 0:
            due = axis.interpolation.time - pause + cycles * cycle
            time = due + MADE_UP * (cycle - due)
            way_time = cycles * cycle
    axis.interpolation.start = axis.profile.position
    axis.interpolation.start_speed = axis.profile.velocity / RPM
    axis.interpolation.end_speed = 0.0 if first else (place - axis.interpolation.end) / way_time
    axis.interpolation.end = place
    axis.interpolation.time = cycle if first and cycle > 0.0 else time
    axis.interpolation.pause = 0.0 if first else pause
    axis.interpolation.elapsed = 0.0
    axis.interpolation.frames_ns = now


@inlined
def step_interpolation(profile: Any, interpolation: Any, seconds: float) -> None:
    """Advance ``profile.position`` and ``profile.velocity`` along the present curve."""
    time = interpolation.time
    if time <= 0.0:
        profile.position = interpolation.end
        profile.velocity = 0.0
        return
    longest = 2.0 * time
    if interpolation.settings.cycle_ns > 0:
        longest = time + GONE_ON * interpolation.settings.cycle_ns * 1e-9
    if interpolation.elapsed >= longest:
        # the frame after the missing one is late, too
        profile.velocity = 0.0
        return
    interpolation.elapsed = min(interpolation.elapsed + seconds, longest)
    elapsed = interpolation.elapsed
    if elapsed > time:
        late = elapsed - time
        profile.position = interpolation.end + interpolation.end_speed * late
        profile.velocity = interpolation.end_speed * RPM
        return
    share = elapsed / time
    way = interpolation.end - interpolation.start
    # Hermite: position and velocity at both ends
    cubic = time * (interpolation.start_speed + interpolation.end_speed) - 2.0 * way
    square = 3.0 * way - time * (2.0 * interpolation.start_speed + interpolation.end_speed)
    linear = time * interpolation.start_speed
    profile.position = interpolation.start + share * (linear + share * (square + share * cubic))
    profile.velocity = (linear + share * (2.0 * square + share * 3.0 * cubic)) / time * RPM


@inlined
def servo_command(motor: Any, ramp: Any, profile: Any, interpolation: Any) -> float:
    """The velocity command of dynamic servo control, rpm: NSOLL_B plus KPC times the remaining deviation."""
    if interpolation.servo_gain <= 0.0:
        profile.position = motor.measured_position
        return ramp.setpoint
    profile.position = interpolation.servo_target
    return ramp.setpoint + interpolation.servo_gain * (interpolation.servo_target - motor.measured_position) * RPM
