"""Jogging by sequences of STW1.8 and STW1.9 (Moog MSD manual 10.3): which speed counts depends on which bit came first.

Of the maker's form (table 10.10), to be read with STW1.8 and 9 as columns: the bit that rises first says the direction,
the other one switches between the two speeds.  The profile's form (table 10.11, with P-1267 bit 8) has one speed for
each bit.  A jog begins when the motor stands; what the tables call "no change" leaves the state as it is.  A telegram
may bring the speeds (10.3.3).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pnfarm.table.axis_codes import CONFIG_PROFILE_JOG, CONTROL_BY_PLC, JOG_SEQUENCES
from pnfarm.table.compiled import compiled
from pnfarm.table.signals import JOG_SPEED_1, STW1

__all__ = ["MAKERS_FORM", "PROFILES_FORM", "take_jog"]

# States (``jog_sequence``).
NONE = 0
FORWARD_1 = 1  # at the first speed
FORWARD_2 = 2  # at the second
BACKWARD_1 = 3  # at the first, negated
BACKWARD_2 = 4
STATES = 5

#: Table 10.10: state -> the following one with STW1.9 and STW1.8 = 00, 01, 10 and 11.  Rows 4 and 8 say "no change" of
#: the bit that gave the direction; row 7 names P-1268, the first speed.  Both bits at once begin nothing (assumed).
MAKERS_FORM: dict[int, tuple[int, int, int, int]] = {
    NONE: (NONE, FORWARD_1, BACKWARD_1, NONE),
    FORWARD_1: (NONE, FORWARD_1, FORWARD_1, FORWARD_2),
    FORWARD_2: (NONE, FORWARD_1, FORWARD_2, FORWARD_2),
    BACKWARD_1: (NONE, BACKWARD_1, BACKWARD_1, BACKWARD_2),
    BACKWARD_2: (NONE, BACKWARD_2, BACKWARD_1, BACKWARD_2),
}
#: Table 10.11; from one bit to the other the axis stops between (assumed: a jog begins at rest).
PROFILES_FORM: dict[int, tuple[int, int, int, int]] = {
    NONE: (NONE, FORWARD_1, FORWARD_2, NONE),
    FORWARD_1: (NONE, FORWARD_1, NONE, FORWARD_1),
    FORWARD_2: (NONE, NONE, FORWARD_2, FORWARD_2),
    BACKWARD_1: (NONE, NONE, NONE, NONE),
    BACKWARD_2: (NONE, NONE, NONE, NONE),
}
_NEXT = np.array([[form[state] for state in range(STATES)] for form in (MAKERS_FORM, PROFILES_FORM)], np.int8)

JOG_BITS = 8
EXCLUDES = 0x0070  # STW1.4 to 6


@compiled
def _take_speeds(axis: Any, image: Any) -> None:
    """The two speeds, by parameters or by a telegram whose set points count."""
    for which in range(2):
        if not image.valid or not axis.jog_signals & (1 << which):
            axis.jog_asked[which] = axis.jog_velocity[which]
        elif image.received[STW1] & CONTROL_BY_PLC:
            axis.jog_asked[which] = image.received[JOG_SPEED_1 + which] * axis.velocity_step


@compiled
def take_jog(axis: Any, image: Any) -> None:
    """Once in each step: the state of jogging and its speed.  The only writer of ``jog_sequence``."""
    if axis.jog_form != JOG_SEQUENCES:
        return
    before = int(axis.jog_sequence)
    profiles = 1 if int(axis.control_config) & CONFIG_PROFILE_JOG else 0
    stw1 = int(axis.stw1)
    following = int(_NEXT[profiles, before, (stw1 >> JOG_BITS) & 0x3])
    if axis.state != 4 or (profiles and stw1 & EXCLUDES) or (before == NONE and abs(axis.velocity) > axis.standstill):
        following = NONE
    axis.jog_sequence = following
    _take_speeds(axis, image)
    speed = axis.jog_asked[1] if following in (FORWARD_2, BACKWARD_2) else axis.jog_asked[0]
    axis.jog_speed = -speed if following >= BACKWARD_1 else speed
