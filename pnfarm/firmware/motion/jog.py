"""Jogging: which of the two orders counts, and the sequences of both (Moog MSD manual 10.3).

In a sequence, which speed counts depends on which bit came first.

In the maker's form (table 10.10, read with STW1.8 and 9 as columns) the bit that rises first gives the direction,
the other one switches between the two speeds.  The profile's form (table 10.11, with P-1267 bit 8) has one speed for
each bit.  A jog begins when the motor stands; what the tables call "no change" leaves the state as it is.  A telegram
may bring the speeds (10.3.3).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pnfarm.table.axis_codes import CONFIG_PROFILE_JOG, JOG_SEQUENCES
from pnfarm.table.axis_readings import BOTH_FIRST_SPEED, BOTH_KEEP
from pnfarm.table.compiling.compiled import inlined

__all__ = ["ENDING_FORM", "MAKERS_FORM", "PROFILES_FORM", "by_sequence", "excluded", "take_jog", "take_jog_bits"]


# States (``jog.sequence``).
NONE = 0
FORWARD_1 = 1  # at the first speed
FORWARD_2 = 2  # at the second
BACKWARD_1 = 3  # at the first, negated
BACKWARD_2 = 4
ENDED = 5  # at no speed, until both bits are 0
STATES = 6

#: Table 10.10: state -> next state with STW1.9 and STW1.8 = 00, 01, 10 and 11.  Rows 4 and 8 have "no change" for
#: the bit that gave the direction; row 7 names P-1268, the first speed.  Both bits at once begin nothing (assumed).
MAKERS_FORM: dict[int, tuple[int, int, int, int]] = {
    NONE: (NONE, FORWARD_1, BACKWARD_1, NONE),
    FORWARD_1: (NONE, FORWARD_1, FORWARD_1, FORWARD_2),
    FORWARD_2: (NONE, FORWARD_1, FORWARD_2, FORWARD_2),
    BACKWARD_1: (NONE, BACKWARD_1, BACKWARD_1, BACKWARD_2),
    BACKWARD_2: (NONE, BACKWARD_2, BACKWARD_1, BACKWARD_2),
    ENDED: (NONE, ENDED, ENDED, ENDED),
}
#: Table 10.11; from one bit to the other the axis stops between (assumed: a jog begins at rest).
PROFILES_FORM: dict[int, tuple[int, int, int, int]] = {
    NONE: (NONE, FORWARD_1, FORWARD_2, NONE),
    FORWARD_1: (NONE, FORWARD_1, NONE, FORWARD_1),
    FORWARD_2: (NONE, NONE, FORWARD_2, FORWARD_2),
    BACKWARD_1: (NONE, NONE, NONE, NONE),
    BACKWARD_2: (NONE, NONE, NONE, NONE),
    ENDED: (NONE, NONE, NONE, NONE),
}
#: The maker's form, but a jog ends when the bit that gave its direction falls, whatever the other one is.
ENDING_FORM: dict[int, tuple[int, int, int, int]] = MAKERS_FORM | {
    FORWARD_1: (NONE, FORWARD_1, ENDED, FORWARD_2),
    FORWARD_2: (NONE, FORWARD_1, ENDED, FORWARD_2),
    BACKWARD_1: (NONE, ENDED, BACKWARD_1, BACKWARD_2),
    BACKWARD_2: (NONE, ENDED, BACKWARD_1, BACKWARD_2),
}
_FORMS = (MAKERS_FORM, PROFILES_FORM, ENDING_FORM)
_NEXT = np.array([[form[state] for state in range(STATES)] for form in _FORMS], np.int8)
MAKERS, PROFILES, ENDING = 0, 1, 2

BOTH = 0x3


@inlined
def by_sequence(jog: Any) -> bool:
    """Whether jogging follows the sequence of its bits; else each of them is a speed."""
    return jog.settings.form == JOG_SEQUENCES


@inlined
def take_jog_bits(orders: Any, jog: Any) -> None:
    """Once in each step: which of the jog bits counts.  The only writer of ``jog.bits`` and ``jog.first``."""
    bits = int(orders.jog)
    if bits != BOTH:
        jog.first = bits
    elif jog.settings.both_bits == BOTH_FIRST_SPEED:
        bits = 1
    elif jog.settings.both_bits == BOTH_KEEP and jog.first != 0:
        bits = int(jog.first)
    jog.bits = bits


@inlined
def excluded(orders: Any, jog: Any, begun: bool) -> bool:
    """Whether other orders keep a jog from beginning, or end one that has ``begun``."""
    return orders.jog_barred != 0 and not (begun and jog.settings.begun_lasts)


@inlined
def take_jog(axis: Any) -> None:
    """Once in each step: the state of jogging and its speed.  The only writer of ``jog.sequence``."""
    if not by_sequence(axis.jog):
        return
    before = int(axis.jog.sequence)
    form = ENDING if axis.jog.settings.needs_its_bit else MAKERS
    if int(axis.asked.settings.control_config) & CONFIG_PROFILE_JOG:
        form = PROFILES
    bits = int(axis.orders.jog)
    if before == NONE:
        # without sequences both bits may count as one
        bits = int(axis.jog.bits)
    following = int(_NEXT[form, before, bits])
    moves = before == NONE and abs(axis.motor.velocity) > axis.ramp.settings.standstill
    if axis.drive.state != 4 or moves or (form == PROFILES and excluded(axis.orders, axis.jog, before != NONE)):
        following = NONE
    axis.jog.sequence = following
    speed = axis.jog.speeds[1] if following in (FORWARD_2, BACKWARD_2) else axis.jog.speeds[0]
    axis.jog.speed = 0.0 if following == ENDED else -speed if following >= BACKWARD_1 else speed
