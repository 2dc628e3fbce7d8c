"""What the controller asks of an axis in position mode: tasks, overrides and jogging out of the telegram's signals."""

from __future__ import annotations

from typing import Any

from pnfarm.table.axis import (
    CONFIG_PROFILE_JOG,
    CONFIG_RISING_EDGE,
    JOG_MINUS,
    JOG_NONE,
    JOG_PLUS,
    JOG_REAL_TIME,
    TASKS_MDI,
    TASKS_NONE,
    TASKS_POS_STW,
)
from pnfarm.table.compiled import compiled
from pnfarm.table.signals import (
    MDI_ACC,
    MDI_DEC,
    MDI_MOD,
    MDI_TARPOS,
    MDI_VELOCITY,
    OVERRIDE,
    POS_STW1,
    POS_STW2,
    SATZANW,
    TARPOS_A,
    VELOCITY_A,
)

__all__ = ["take_task"]

START_BIT = 0x0040  # STW1.6
JOG_EXCLUDES = 0x0070  # STW1.4 to 6
JOG_1 = 0x0100  # STW1.8
JOG_2 = 0x0200  # STW1.9
RELATIVE = 0x1000  # STW1.12, Moog MSD manual 10.2.1
REAL_TIME_JOG = 0x1000  # STW1.12, AKD PROFINET manual 5.4
BACKWARDS = 0x2000  # STW1.13, as above
NO_HANDSHAKE = 0x2000  # STW1.13, Moog MSD manual 10.2.1
MDI_SELECTED = 0x8000  # SATZANW.15, POS_STW1.15
ABSOLUTE = 0x0001  # MDI_MOD.0
POS_ABSOLUTE = 0x0100  # POS_STW1.8
HERE = 0x0002  # POS_STW2.1

#: Override of 100 % (HIWIN E1 manual 6.6.1 has this figure for the other percentages).
WHOLE = 16384.0


@compiled
def _jog_asked(axis: Any, stw1: int) -> int:
    if axis.real_time_jog and stw1 & REAL_TIME_JOG:
        return JOG_REAL_TIME
    if axis.control_config & CONFIG_PROFILE_JOG and stw1 & JOG_EXCLUDES:
        return JOG_NONE
    if stw1 & (JOG_1 | JOG_2) == JOG_1:
        return JOG_PLUS
    if stw1 & (JOG_1 | JOG_2) == JOG_2:
        return JOG_MINUS
    return JOG_NONE


@compiled
def take_task(axis: Any, image: Any) -> None:
    """The signals of this step in physical units; ``asked`` is set on the edge that starts a task."""
    stw1 = axis.stw1
    axis.asked = 0
    axis.jog = JOG_NONE
    axis.mdi = 0
    if axis.task_form == TASKS_NONE or not image.valid:
        return
    axis.jog = _jog_asked(axis, stw1)
    changed = (stw1 ^ axis.motion_seen) & START_BIT
    if changed and (stw1 & START_BIT or not axis.control_config & CONFIG_RISING_EDGE):
        axis.asked = 1
    axis.override = 1.0
    target_step = axis.target_step if axis.target_step > 0.0 else axis.position_step
    if axis.task_form == TASKS_MDI or axis.task_form == TASKS_POS_STW:  # noqa: PLR1714 - a tuple would allocate
        axis.asked_position = image.received[MDI_TARPOS] * target_step
        axis.asked_velocity = (int(image.received[MDI_VELOCITY]) & 0xFFFFFFFF) * axis.task_velocity_step
        up = axis.task_acceleration_step if axis.task_acceleration_step > 0.0 else axis.jog_acceleration / WHOLE
        down = axis.task_deceleration_step if axis.task_deceleration_step > 0.0 else axis.jog_deceleration / WHOLE
        axis.asked_acceleration = (image.received[MDI_ACC] & 0xFFFF) * up
        axis.asked_deceleration = (image.received[MDI_DEC] & 0xFFFF) * down
        axis.asked_backwards = 1 if stw1 & BACKWARDS else 0
        if axis.task_form == TASKS_MDI:
            axis.asked_relative = 0 if image.received[MDI_MOD] & ABSOLUTE else 1
            selected = image.received[SATZANW] & MDI_SELECTED
        else:
            axis.asked_relative = 0 if image.received[POS_STW1] & POS_ABSOLUTE else 1
            axis.override = (image.received[OVERRIDE] & 0xFFFF) / WHOLE
            selected = image.received[POS_STW1] & MDI_SELECTED
            word = image.received[POS_STW2] & 0xFFFF
            if word & ~axis.pos_stw2 & HERE:
                axis.origin = axis.position - axis.home_position
                axis.homed = 1
            axis.pos_stw2 = word
        axis.mdi = 1 if selected else 0
        if not selected:
            axis.asked = 0
        return
    axis.asked_relative = 1 if stw1 & RELATIVE else 0
    axis.asked_velocity = abs(image.received[VELOCITY_A] * axis.task_velocity_step)
    axis.asked_acceleration = axis.ramp_up
    axis.asked_deceleration = axis.ramp_down
    position = image.received[TARPOS_A] * target_step
    if stw1 & NO_HANDSHAKE and stw1 & START_BIT == axis.motion_seen & START_BIT:
        axis.asked = 1 if position != axis.asked_position else 0
    axis.asked_position = position
