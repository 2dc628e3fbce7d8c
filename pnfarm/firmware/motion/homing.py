"""Homing: how an axis finds the position from which its positions count.

Methods have the numbers of HOME.MODE (AKD PROFINET manual 5.10.3).  Kollmorgen's AKD parameter reference describes 0 to
10, and of those above only what they look for (its help, "Homing"): their sequences are assumed.  HIWIN E1
manual 6.7 and Moog MSD manual 12.2 refer to other books for theirs: their models use the zero mark.

=======  =========================================================================================
0        the present position
1, 2, 3  the limit switch in the direction of homing, where the axis leaves it again
4, 5, 6  the home switch, where it closes
7        the encoder's zero mark; also 11 and 15
8, 9     an end stop; also 10
12       the home switch, reversing at an end stop
13       the encoder's absolute position: its zero is the home
14       the home switch, always in one direction
=======  =========================================================================================

With 1 and 4 the axis stops past the home; with 2, 5 and 9 it goes on to the zero mark, which is then the home; 3, 6
and 10 search for the zero mark at a reduced velocity, and stop past it.  The search consists of legs.  A home switch
counts where it closes in the direction of homing: a search that reaches a limit switch first goes back across the home
switch, and reverses again.
"""

from __future__ import annotations

from math import ceil, floor
from typing import Any

import numpy as np

from pnfarm.firmware.motion.profile_generator import begin_profile
from pnfarm.firmware.motion.travel import at_limit_switch, fastest, take_ramps
from pnfarm.table.axis_codes import PROFILE_STOP, PROFILE_TARGET, PROFILE_VELOCITY
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["homing_fails", "homing_over", "start_homing", "step_homing"]


# What a method looks for.
HERE = 0
LIMIT = 1
SWITCH = 2
END_STOP = 3
MARK = 4
ENCODER = 5
UNKNOWN = 6

_SOUGHT = np.array([
    HERE, LIMIT, LIMIT, LIMIT, SWITCH, SWITCH, SWITCH, MARK, END_STOP, END_STOP, END_STOP, MARK, SWITCH, ENCODER,
    SWITCH, MARK,
])  # fmt: skip
# What the edge of a switch or the end stop is: the home itself, or where the move to the zero mark or its search starts
ITSELF, ZERO_MARK, INDEX_SEARCH = 0, 1, 2
_BEHIND = np.array([
    ITSELF, ITSELF, ZERO_MARK, INDEX_SEARCH, ITSELF, ZERO_MARK, INDEX_SEARCH, ITSELF, ITSELF, ZERO_MARK, INDEX_SEARCH,
    ITSELF, ITSELF, ITSELF, ITSELF, ITSELF,
])  # fmt: skip
TURNS_AT_STOP = 12
ONE_WAY = 14

# Legs (``homing.leg``).
TO_THE_MARK = 0  # its position is known
WAY_OFF = 1  # the home is found, the axis goes to where homing ends
SEEK = 2  # in the direction of homing
RETREAT = 3  # back, until the switch opens
RETURN = 4  # back, until the home switch closes
FIND = 5  # again in the direction of homing, until the home switch closes
LEAVE = 6  # in the direction of homing, until the home switch opens
INDEX = 7  # on to the zero mark, slowly
BRAKE = 8  # the home is found, and the axis comes to rest past it
FAILED = 9

#: Within this distance of a zero mark, rev, the axis counts as on it, and looks for the next one.
ON_THE_MARK = 1e-6


@inlined
def _sought(homing: Any) -> int:
    method = int(homing.method_in_force)
    return int(_SOUGHT[method]) if method < len(_SOUGHT) else UNKNOWN


@inlined
def _run(motor: Any, travel: Any, profile: Any, homing: Any, way: float, velocity: float) -> None:
    """Move in a direction, without a target."""
    homing.sense = way
    take_ramps(
        profile,
        way * fastest(motor, travel, velocity, way > 0.0),
        homing.settings.acceleration,
        homing.settings.deceleration,
    )
    profile.mode = PROFILE_VELOCITY


@inlined
def _go(axis: Any, target: float, velocity: float) -> None:
    """Move to a position."""
    axis.profile.target = target
    axis.positioning.top = velocity
    top = fastest(axis.motor, axis.travel, velocity, target >= axis.profile.position)
    take_ramps(axis.profile, top, axis.homing.settings.acceleration, axis.homing.settings.deceleration)
    axis.profile.mode = PROFILE_TARGET


@inlined
def _next_mark(place: float, way: float) -> float:
    return ceil(place + ON_THE_MARK) if way > 0.0 else floor(place - ON_THE_MARK)


@inlined
def _way(homing: Any) -> float:
    """The direction of homing in force, 1 forwards, -1 backwards."""
    return 1.0 if (homing.settings.direction > 0.0) != (homing.reversed != 0) else -1.0


@inlined
def start_homing(axis: Any) -> None:
    """Begin; the home position is unknown until it is found."""
    axis.homing.homed = 0
    axis.homing.seen = 1
    axis.positioning.endless = 0
    axis.homing.error = 0
    axis.positioning.target_reached = 0
    axis.commands.home = 0
    axis.homing.start = axis.profile.position
    way = _way(axis.homing)
    axis.homing.sense = way
    sought = _sought(axis.homing)
    if sought == UNKNOWN:
        axis.homing.leg = FAILED
    elif sought in (HERE, ENCODER):
        axis.homing.leg = TO_THE_MARK
        _go(axis, axis.profile.position, axis.homing.settings.velocity)
    elif sought == MARK:
        axis.homing.leg = TO_THE_MARK
        _go(axis, _next_mark(axis.profile.position, way), axis.homing.settings.velocity)
    else:
        axis.homing.leg = LEAVE if sought == SWITCH and axis.machine.home_switch else SEEK
        _run(axis.motor, axis.travel, axis.profile, axis.homing, way, axis.homing.settings.velocity)


@inlined
def _brake(profile: Any, homing: Any, home: float) -> None:
    """The home is found: come to rest."""
    homing.origin = home - homing.settings.position
    homing.leg = BRAKE
    profile.mode = PROFILE_STOP


@compiled
def _found(axis: Any, place: float, way: float) -> None:
    """The switch or the end stop is at ``place``; the next leg goes in the direction ``way``."""
    behind = int(_BEHIND[int(axis.homing.method_in_force)])
    if behind == ITSELF:
        _brake(axis.profile, axis.homing, place)
    elif behind == ZERO_MARK:
        axis.homing.leg = TO_THE_MARK
        _go(axis, _next_mark(place, way), axis.homing.settings.velocity)
    else:
        axis.homing.leg = INDEX
        axis.profile.target = _next_mark(place, way)
        _run(
            axis.motor,
            axis.travel,
            axis.profile,
            axis.homing,
            way,
            axis.homing.settings.velocity * axis.homing.settings.share,
        )


@inlined
def _turn(motor: Any, travel: Any, profile: Any, homing: Any, leg: int) -> None:
    homing.leg = leg
    _run(motor, travel, profile, homing, -homing.sense, homing.settings.velocity)


@inlined
def _against_a_stop(positioning: Any, homing: Any) -> bool:
    """Whether the axis no longer follows: PL.ERR is larger than HOME.PERRTHRESH."""
    return homing.settings.lag > 0.0 and abs(positioning.following_error) > homing.settings.lag


@inlined
def _give_up_the_way(motor: Any, profile: Any) -> None:
    """Drop the commanded motion beyond the end stop."""
    profile.position = motor.measured_position
    profile.velocity = 0.0
    begin_profile(profile)


@inlined
def _seek_limit(axis: Any) -> None:
    if axis.homing.leg == SEEK and at_limit_switch(axis.machine, axis.homing.sense):
        _turn(axis.motor, axis.travel, axis.profile, axis.homing, RETREAT)
    elif axis.homing.leg == RETREAT and not at_limit_switch(axis.machine, -axis.homing.sense):
        _found(axis, axis.motor.measured_position, axis.homing.sense)


@inlined
def _seek_switch(axis: Any) -> None:
    ended = at_limit_switch(axis.machine, axis.homing.sense)
    if axis.homing.method_in_force == TURNS_AT_STOP and _against_a_stop(axis.positioning, axis.homing):
        _give_up_the_way(axis.motor, axis.profile)
        ended = True
    if axis.homing.leg in (SEEK, FIND):
        if axis.machine.home_switch:
            _found(axis, axis.motor.measured_position, axis.homing.sense)
        elif ended and axis.homing.leg == SEEK and axis.homing.method_in_force != ONE_WAY:
            _turn(axis.motor, axis.travel, axis.profile, axis.homing, RETURN)
        elif ended:
            axis.homing.leg = FAILED
    elif axis.homing.leg == LEAVE:
        # a switch that was closed from the start has not closed during the search
        if not axis.machine.home_switch or ended:
            axis.homing.leg = SEEK
    elif axis.homing.leg == RETURN and axis.machine.home_switch:
        axis.homing.leg = RETREAT
    elif axis.homing.leg == RETREAT and not axis.machine.home_switch:
        _turn(axis.motor, axis.travel, axis.profile, axis.homing, FIND)
    elif ended:
        axis.homing.leg = FAILED


@inlined
def step_homing(axis: Any) -> None:
    """Once in each step of an axis in homing: check for the end of a leg, and begin the next one."""
    axis.homing.current_limit = 0.0
    if axis.homing.leg == BRAKE:
        return
    if axis.homing.leg in (TO_THE_MARK, WAY_OFF):
        # the move after the mark may lead back, where the other limit counts
        axis.profile.top = fastest(
            axis.motor, axis.travel, axis.positioning.top, axis.profile.target >= axis.profile.position
        )
        return
    sought = _sought(axis.homing)
    if axis.homing.leg == INDEX:
        if (axis.motor.measured_position - axis.profile.target) * axis.homing.sense >= 0.0:
            _brake(axis.profile, axis.homing, axis.profile.target)
    elif sought == LIMIT:
        _seek_limit(axis)
    elif sought == SWITCH:
        _seek_switch(axis)
    elif sought == END_STOP and _against_a_stop(axis.positioning, axis.homing):
        _give_up_the_way(axis.motor, axis.profile)
        _found(axis, axis.motor.measured_position, -axis.homing.sense)
    if SEEK <= axis.homing.leg <= LEAVE:
        if (
            axis.homing.settings.farthest > 0.0
            and abs(axis.profile.position - axis.homing.start) > axis.homing.settings.farthest
        ):
            axis.homing.leg = FAILED
        if sought == END_STOP or axis.homing.method_in_force == TURNS_AT_STOP:
            axis.homing.current_limit = axis.homing.settings.current


@inlined
def homing_fails(machine: Any, profile: Any, homing: Any) -> bool:
    """Whether the home cannot be found, or a limit switch blocks the remaining move."""
    if homing.leg == FAILED:
        return True
    sought = _sought(homing)
    if sought != END_STOP and homing.leg not in (TO_THE_MARK, WAY_OFF, INDEX):
        return False
    # the axis may come back to the limit switch that it was homed on
    own = sought == LIMIT and profile.velocity * _way(homing) > 0.0
    return not own and at_limit_switch(machine, profile.velocity)


@inlined
def homing_over(axis: Any) -> bool:
    """True once homing is over: its target is reached, or the axis is at rest."""
    if axis.homing.leg != WAY_OFF:
        sought = _sought(axis.homing)
        if axis.homing.leg == TO_THE_MARK:
            found = 0.0 if sought == ENCODER else axis.profile.target
            axis.homing.origin = found - axis.homing.settings.position
        axis.homing.leg = WAY_OFF
        if axis.homing.distance_in_force != 0.0 and sought not in (HERE, ENCODER):
            _go(
                axis,
                axis.homing.origin + axis.homing.settings.position + axis.homing.distance_in_force,
                axis.homing.settings.velocity,
            )
            return False
        axis.profile.target = axis.profile.position
    axis.homing.homed = 1
    axis.positioning.target_reached = 1
    return True
