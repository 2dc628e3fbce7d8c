"""Set points of each cycle: positions to follow (application class 5) and dynamic servo control (class 4).

*Positions* (Moog MSD manual 10.6): each frame brings XSOLL_A.  The drive goes there within one cycle along a cubic
curve that begins with the velocity that it has and ends with that of the last two set points, so that it is one cycle
behind; P-0370 calls that a cubic spline.  A frame that does not come leaves the axis going on for one cycle more, and
the one after it finds it where it would have been; the cycle is the connection's, so that frames may come early and
late.  XSOLL_A counts round at its 32 bits as XIST_A does: it is the place of that number that is the nearest.

*Dynamic servo control* (10.8; PROFIdrive 4.2, 6.3.4): the controller sends its position deviation XERR, in steps of
G1_XIST1, and the position controller's gain KPC, in 1/1000 per second.  The drive closes that loop itself, with what
the shaft did since the position that the controller knows; NSOLL_B is the feed-forward.  Which position that is no
word tells: the one in the last frame that left before the set points came (assumed).
"""

from __future__ import annotations

from math import floor
from typing import Any

from pnfarm.table.axis_codes import RAMP_GENERATED, RAMP_PASSED_BY
from pnfarm.table.compiled import compiled

__all__ = [
    "begin_interpolation",
    "follows",
    "generator_in_force",
    "interpolates",
    "servo_command",
    "step_interpolation",
    "take_position",
]


#: A pause between two frames that is no cycle, ns.
LONGEST_CYCLE_NS = 1_000_000_000
#: A frame that comes nearer to its time than this part of a cycle is in step ...
IN_STEP = 0.6
#: ... and of what it is beside its time, so much is made up for at once.
MADE_UP = 0.05
#: For so many cycles that are known the axis goes on: a frame may get lost and the next one be late.
GONE_ON = 1.5
#: Numbers of a signal of 32 bits.
NUMBERS = 4294967296.0
RPM = 60.0
POSITION_MODE = 2


@compiled
def follows(drive: Any, orders: Any, ramp: Any, interpolation: Any) -> bool:
    """Whether positions of each cycle lead the axis now: interpolating mode, and nothing holds set points back."""
    return (
        interpolates(drive, ramp, interpolation) and orders.ramp != 0 and orders.ramp_runs != 0 and orders.setpoint != 0
    )


@compiled
def generator_in_force(ramp: Any) -> int:
    """``ramp.generator``, or what homing made of it (Moog MSD manual 12.1) since it was set last."""
    left = ramp.generator_left != 0 and ramp.generator_left == ramp.settings.generator_set + 1
    return RAMP_GENERATED if left else int(ramp.settings.generator)


@compiled
def interpolates(drive: Any, ramp: Any, interpolation: Any) -> bool:
    """Whether the axis is in a mode where positions of each cycle lead it."""
    return (
        drive.settings.opmode == POSITION_MODE
        and generator_in_force(ramp) == RAMP_PASSED_BY
        and not interpolation.settings.servo_control
    )


@compiled
def begin_interpolation(profile: Any, interpolation: Any) -> None:
    """From where the axis is commanded to be; the next frame gives the first curve."""
    interpolation.start = profile.position
    interpolation.end = profile.position
    interpolation.start_speed = profile.velocity / RPM
    interpolation.end_speed = 0.0
    interpolation.time = 0.0
    interpolation.pause = 0.0
    interpolation.elapsed = 0.0
    interpolation.frames_ns = 0


@compiled
def _nearest_place(travel: Any, profile: Any, homing: Any, number: int) -> float:
    """Where a position of 32 bits lies on the shaft: of all places that have this number, the nearest one."""
    here = (profile.position - homing.origin) / travel.settings.position_step
    rounds = floor((here - number) / NUMBERS + 0.5)
    return homing.origin + (number + rounds * NUMBERS) * travel.settings.position_step


@compiled
def _in_step(interpolation: Any, pause: float, cycle: float) -> int:
    """How many cycles a frame is behind the one before; 0 where the curve at hand does not end when it was to come.

    The curve at hand ends when the frame behind it is due, so that what comes early or late is seen against that.
    """
    late = pause - interpolation.time
    cycles = max(1, 1 + floor(late / cycle + 0.5))
    return cycles if abs(interpolation.time - pause + (cycles - 1) * cycle) <= IN_STEP * cycle else 0


@compiled
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


@compiled
def step_interpolation(profile: Any, interpolation: Any, seconds: float) -> None:
    """Advance ``profile.position`` and ``profile.velocity`` along the curve at hand."""
    time = interpolation.time
    if time <= 0.0:
        profile.position = interpolation.end
        profile.velocity = 0.0
        return
    longest = 2.0 * time
    if interpolation.settings.cycle_ns > 0:
        longest = time + GONE_ON * interpolation.settings.cycle_ns * 1e-9
    if interpolation.elapsed >= longest:
        # the frame behind the one that did not come is late, too
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
    # Hermite: place and velocity at both ends
    cubic = time * (interpolation.start_speed + interpolation.end_speed) - 2.0 * way
    square = 3.0 * way - time * (2.0 * interpolation.start_speed + interpolation.end_speed)
    linear = time * interpolation.start_speed
    profile.position = interpolation.start + share * (linear + share * (square + share * cubic))
    profile.velocity = (linear + share * (2.0 * square + share * 3.0 * cubic)) / time * RPM


@compiled
def servo_command(motor: Any, ramp: Any, profile: Any, interpolation: Any) -> float:
    """The velocity command of dynamic servo control, rpm: NSOLL_B, and KPC times what is left of the deviation."""
    if interpolation.servo_gain <= 0.0:
        profile.position = motor.measured_position
        return ramp.setpoint
    profile.position = interpolation.servo_target
    return ramp.setpoint + interpolation.servo_gain * (interpolation.servo_target - motor.measured_position) * RPM
