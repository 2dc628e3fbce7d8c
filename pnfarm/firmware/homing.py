"""Homing: how an axis looks for the place from which its positions count.

Methods have the numbers of HOME.MODE (AKD PROFINET manual 5.10.3).  What 0 to 10 do stands in Kollmorgen's AKD
parameter reference, of those above only what they look for (its help, "Homing"): their ways are assumed.  HIWIN E1
manual 6.7 and Moog MSD manual 12.2 leave theirs to other books: their models take the zero mark.

=======  =========================================================================================
0        where the axis stands
1, 2, 3  the limit switch in the direction of homing, where the axis leaves it again
4, 5, 6  the home switch, where it closes
7        the encoder's zero mark; 11 and 15 alike
8, 9     an end stop, 10 alike
12       the home switch, turning round at an end stop
13       what the encoder says: its zero is the home
14       the home switch, always in one direction
=======  =========================================================================================

The axis brakes behind the home of 1 and 4; with 2, 5 and 9 it goes on to the zero mark, which is the home then; 3, 6
and 10 look for that at a part of the velocity, and brake behind it.  The search goes in legs.  A home switch counts
where it closes in the direction of homing: a search that comes to a limit switch first goes back across it, and turns
again.
"""

from __future__ import annotations

from math import ceil, floor
from typing import Any

import numpy as np

from pnfarm.firmware.profile_generator import begin_profile
from pnfarm.firmware.travel import at_limit_switch, fastest, take_ramps
from pnfarm.table.axis_codes import PROFILE_STOP, PROFILE_TARGET, PROFILE_VELOCITY
from pnfarm.table.compiled import compiled

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
# What the edge of a switch or the end stop is: the home itself, or where the way to the zero mark or its search begins.
ITSELF, ZERO_MARK, INDEX_SEARCH = 0, 1, 2
_BEHIND = np.array([
    ITSELF, ITSELF, ZERO_MARK, INDEX_SEARCH, ITSELF, ZERO_MARK, INDEX_SEARCH, ITSELF, ITSELF, ZERO_MARK, INDEX_SEARCH,
    ITSELF, ITSELF, ITSELF, ITSELF, ITSELF,
])  # fmt: skip
TURNS_AT_STOP = 12
ONE_WAY = 14

# Legs (``home_leg``).
TO_THE_MARK = 0  # its place is known
WAY_OFF = 1  # the home is found, the axis goes to where homing ends
SEEK = 2  # in the direction of homing
RETREAT = 3  # back, until the switch is left
RETURN = 4  # back, until the home switch closes
FIND = 5  # again in the direction of homing, until the home switch closes
LEAVE = 6  # in the direction of homing, until the home switch opens
INDEX = 7  # on to the zero mark, slowly
BRAKE = 8  # the home is found, and the axis comes to rest behind it
FAILED = 9

#: Nearer to a zero mark than this, rev, the axis stands on it, and looks for the next one.
ON_THE_MARK = 1e-6


@compiled
def _sought(axis: Any) -> int:
    method = int(axis.asked_home_method)
    return int(_SOUGHT[method]) if method < len(_SOUGHT) else UNKNOWN


@compiled
def _run(axis: Any, way: float, velocity: float) -> None:
    """In a direction, without an end."""
    axis.home_way = way
    take_ramps(axis, way * fastest(axis, velocity, way > 0.0), axis.home_acceleration, axis.home_deceleration)
    axis.profile = PROFILE_VELOCITY


@compiled
def _go(axis: Any, target: float, velocity: float) -> None:
    """To a place."""
    axis.target = target
    axis.task_top = velocity
    top = fastest(axis, velocity, target >= axis.commanded_position)
    take_ramps(axis, top, axis.home_acceleration, axis.home_deceleration)
    axis.profile = PROFILE_TARGET


@compiled
def _next_mark(place: float, way: float) -> float:
    return ceil(place + ON_THE_MARK) if way > 0.0 else floor(place - ON_THE_MARK)


@compiled
def start_homing(axis: Any) -> None:
    """Begin; the home position is unknown until it is found."""
    axis.homed = 0
    axis.home_seen = 1
    axis.task_endless = 0
    axis.home_error = 0
    axis.target_reached = 0
    axis.home_command = 0
    axis.home_start = axis.commanded_position
    way = 1.0 if axis.home_direction > 0.0 else -1.0
    axis.home_way = way
    sought = _sought(axis)
    if sought == UNKNOWN:
        axis.home_leg = FAILED
    elif sought in (HERE, ENCODER):
        axis.home_leg = TO_THE_MARK
        _go(axis, axis.commanded_position, axis.home_velocity)
    elif sought == MARK:
        axis.home_leg = TO_THE_MARK
        _go(axis, _next_mark(axis.commanded_position, way), axis.home_velocity)
    else:
        axis.home_leg = LEAVE if sought == SWITCH and axis.home_switch else SEEK
        _run(axis, way, axis.home_velocity)


@compiled
def _brake(axis: Any, home: float) -> None:
    """The home is found: come to rest."""
    axis.origin = home - axis.home_position
    axis.home_leg = BRAKE
    axis.profile = PROFILE_STOP


@compiled
def _found(axis: Any, place: float, way: float) -> None:
    """The switch or the end stop is at ``place``; what is behind it lies in the direction ``way``."""
    behind = int(_BEHIND[int(axis.asked_home_method)])
    if behind == ITSELF:
        _brake(axis, place)
    elif behind == ZERO_MARK:
        axis.home_leg = TO_THE_MARK
        _go(axis, _next_mark(place, way), axis.home_velocity)
    else:
        axis.home_leg = INDEX
        axis.target = _next_mark(place, way)
        _run(axis, way, axis.home_velocity * axis.home_share)


@compiled
def _turn(axis: Any, leg: int) -> None:
    axis.home_leg = leg
    _run(axis, -axis.home_way, axis.home_velocity)


@compiled
def _against_a_stop(axis: Any) -> bool:
    """Whether the axis no longer follows: PL.ERR is larger than HOME.PERRTHRESH."""
    return axis.home_lag > 0.0 and abs(axis.following_error) > axis.home_lag


@compiled
def _give_up_the_way(axis: Any) -> None:
    """Command nothing beyond the end stop."""
    axis.commanded_position = axis.measured_position
    axis.profile_velocity = 0.0
    begin_profile(axis)


@compiled
def _seek_limit(axis: Any) -> None:
    if axis.home_leg == SEEK and at_limit_switch(axis, axis.home_way):
        _turn(axis, RETREAT)
    elif axis.home_leg == RETREAT and not at_limit_switch(axis, -axis.home_way):
        _found(axis, axis.measured_position, axis.home_way)


@compiled
def _seek_switch(axis: Any) -> None:
    ended = at_limit_switch(axis, axis.home_way)
    if axis.asked_home_method == TURNS_AT_STOP and _against_a_stop(axis):
        _give_up_the_way(axis)
        ended = True
    if axis.home_leg in (SEEK, FIND):
        if axis.home_switch:
            _found(axis, axis.measured_position, axis.home_way)
        elif ended and axis.home_leg == SEEK and axis.asked_home_method != ONE_WAY:
            _turn(axis, RETURN)
        elif ended:
            axis.home_leg = FAILED
    elif axis.home_leg == LEAVE:
        # a switch that is closed from the beginning has not closed on the way
        if not axis.home_switch or ended:
            axis.home_leg = SEEK
    elif axis.home_leg == RETURN and axis.home_switch:
        axis.home_leg = RETREAT
    elif axis.home_leg == RETREAT and not axis.home_switch:
        _turn(axis, FIND)
    elif ended:
        axis.home_leg = FAILED


@compiled
def step_homing(axis: Any) -> None:
    """Once in each step of an axis in homing: does its search come to an end of a leg?"""
    axis.home_held = 0.0
    if axis.home_leg == BRAKE:
        return
    if axis.home_leg in (TO_THE_MARK, WAY_OFF):
        # the way behind the mark may lead back, where another limit counts
        axis.task_velocity = fastest(axis, axis.task_top, axis.target >= axis.commanded_position)
        return
    sought = _sought(axis)
    if axis.home_leg == INDEX:
        if (axis.measured_position - axis.target) * axis.home_way >= 0.0:
            _brake(axis, axis.target)
    elif sought == LIMIT:
        _seek_limit(axis)
    elif sought == SWITCH:
        _seek_switch(axis)
    elif sought == END_STOP and _against_a_stop(axis):
        _give_up_the_way(axis)
        _found(axis, axis.measured_position, -axis.home_way)
    if SEEK <= axis.home_leg <= LEAVE:
        if axis.home_farthest > 0.0 and abs(axis.commanded_position - axis.home_start) > axis.home_farthest:
            axis.home_leg = FAILED
        if sought == END_STOP or axis.asked_home_method == TURNS_AT_STOP:
            axis.home_held = axis.home_current


@compiled
def homing_fails(axis: Any) -> bool:
    """Whether the home cannot be found, or a switch bars the way that is left."""
    if axis.home_leg == FAILED:
        return True
    sought = _sought(axis)
    if sought != END_STOP and axis.home_leg not in (TO_THE_MARK, WAY_OFF, INDEX):
        return False
    # the axis may come back to the limit switch that it was homed on
    own = sought == LIMIT and axis.profile_velocity * axis.home_direction > 0.0
    return not own and at_limit_switch(axis, axis.profile_velocity)


@compiled
def homing_over(axis: Any) -> bool:
    """A place is reached, or the axis is at rest: true once homing is over."""
    if axis.home_leg != WAY_OFF:
        sought = _sought(axis)
        if axis.home_leg == TO_THE_MARK:
            found = 0.0 if sought == ENCODER else axis.target
            axis.origin = found - axis.home_position
        axis.home_leg = WAY_OFF
        if axis.asked_home_distance != 0.0 and sought not in (HERE, ENCODER):
            _go(axis, axis.origin + axis.home_position + axis.asked_home_distance, axis.home_velocity)
            return False
        axis.target = axis.commanded_position
    axis.homed = 1
    axis.target_reached = 1
    return True
