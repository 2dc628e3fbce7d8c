"""The controller's requests in position mode: tasks, overrides and jogging from the telegram's signals."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.motion.jog import by_sequence, excluded
from pnfarm.firmware.motion.motion_tasks import select_task
from pnfarm.firmware.motion.positioning import HOMING
from pnfarm.firmware.profidrive.position_control import (
    forget_position_words,
    take_first_position_word,
    take_override,
    take_second_position_word,
)
from pnfarm.firmware.profidrive.real_words import DEGREES, DEGREES_A_SECOND, FARTHEST, PERCENT, is_real, real_of
from pnfarm.table.axis_codes import (
    CONFIG_PROFILE_JOG,
    CONFIG_RISING_EDGE,
    DRIVING_SETS,
    JOG_MINUS,
    JOG_NONE,
    JOG_PLUS,
    JOG_REAL_TIME,
    JOG_SEQUENCE,
    JOG_STILL,
    MDI_SELECTED,
    MOTION_TASK,
    TASK_MDI,
    TASKS_MDI,
    TASKS_NONE,
    TASKS_POS_STW,
    TASKS_TABLE,
    TASKS_TARPOS,
)
from pnfarm.table.axis_readings import REAL_TIME_JOG_WITH_TASKS, SETPOINTS_HELD, SETPOINTS_TAKEN
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.signals import (
    HOME_DIST,
    HOME_MODE,
    MDI_ACC,
    MDI_DEC,
    MDI_MOD,
    MDI_TARPOS,
    MDI_VELOCITY,
    MT_FEEDRATE,
    POS_STW2,
    SATZANW,
    TARPOS_A,
    VELOCITY_A,
)

__all__ = ["ramp_step", "take_task"]


START_BIT = 0x0040  # STW1.6
NOT_REJECTED = 0x0010  # STW1.4
JOG_1 = 1  # of ``jog.bits``: STW1.8
JOG_2 = 2  # STW1.9
RELATIVE = 0x1000  # STW1.12, Moog MSD manual 10.2.1
REAL_TIME_JOG = 0x1000  # STW1.12, AKD PROFINET manual 5.4
BACKWARDS = 0x2000  # STW1.13, as above
NO_HANDSHAKE = 0x2000  # STW1.13, Moog MSD manual 10.2.1
ENDLESS = 0x4000  # STW1.14, as above
NUMBER = 0x7FFF  # SATZANW: the other bits
ABSOLUTE = 0x0001  # MDI_MOD.0

#: The axis jogs (``positioning.state``; the table of :mod:`pnfarm.firmware.motion.positioning`).
MOTION_JOG = 6
#: DRV.OPMODE of position mode.
POSITION_MODE = 2
#: 100 % of MDI_ACC and MDI_DEC.
WHOLE = 16384.0


@compiled
def ramp_step(own: float, jog: float, ramp: float) -> float:
    """rpm/s of one increment of MDI_ACC or MDI_DEC: ``own``, or a part of the jogging ramp or of the axis' ramp."""
    if own > 0.0:
        return own
    return (jog if jog > 0.0 else ramp) / WHOLE


@inlined
def _jog_asked(orders: Any, jog: Any, asked: Any, positioning: Any, stw1: int) -> int:
    if by_sequence(jog):
        return JOG_SEQUENCE if jog.sequence else JOG_NONE
    rejected = jog.settings.real_time == REAL_TIME_JOG_WITH_TASKS and not stw1 & NOT_REJECTED
    if jog.settings.real_time and stw1 & REAL_TIME_JOG and not rejected:
        return JOG_REAL_TIME
    if asked.settings.control_config & CONFIG_PROFILE_JOG and excluded(orders, jog, positioning.state == MOTION_JOG):
        return JOG_NONE
    if jog.bits == JOG_1:
        return JOG_PLUS
    if jog.bits == JOG_2:
        return JOG_MINUS
    return JOG_STILL if jog.bits else JOG_NONE


@inlined
def _take_homing(profidrive: Any, positioning: Any, homing: Any, image: Any, step: float) -> None:
    """Homing method and distance of the telegram, where it has these signals (AKD PROFINET manual 5.11.7, 5.11.8).

    A homing that runs keeps those with which it began.
    """
    if positioning.state == HOMING:
        return
    homing.method_in_force = homing.settings.method
    homing.distance_in_force = homing.settings.distance
    homing.brought = profidrive.settings.home_signals
    if profidrive.settings.home_signals & 0x1:
        homing.method_in_force = image.received[HOME_MODE] & 0xFFFF
    if profidrive.settings.home_signals & 0x2:
        homing.distance_in_force = image.received[HOME_DIST] * step


@inlined
def _acceleration(profidrive: Any, image: Any) -> int:
    """MDI_ACC; if the telegram's is 0, its PNU, where the model says so (AKD: telegram 352)."""
    word = int(image.received[MDI_ACC]) & 0xFFFF
    return word or int(profidrive.settings.spare_acceleration)


@inlined
def _ramp(profidrive: Any, word: int) -> int:
    """MDI_ACC or MDI_DEC; a negative value is not a valid ramp where the word has a sign (HIWIN E1 manual 3.1)."""
    word &= 0xFFFF
    return 0 if profidrive.settings.task_ramps_signed and word & 0x8000 else word


@inlined
def _share(bits: int) -> float:
    """A ramp in percent, as float32: 0 to 1."""
    return min(max(real_of(bits) / PERCENT, 0.0), 1.0)


@inlined
def _take_command(commands: Any, asked: Any, motion_tasks: Any) -> bool:
    """The motion task that a command starts; false for none."""
    if commands.task == 0:
        return False
    asked.begins = 1
    select_task(asked, motion_tasks, int(commands.task) - 1)
    commands.task = 0
    return True


@inlined
def _take_data(profidrive: Any, ramp: Any, jog: Any, asked: Any, image: Any, step: float) -> None:
    """The data of a task from MDI_*: telegram 9 and similar ones."""
    if profidrive.settings.real_tasks:
        place = int(image.received[MDI_TARPOS])
        asked.position = min(max(real_of(place), -FARTHEST), FARTHEST) / DEGREES
        # nothing begins without a target
        velocity = real_of(int(image.received[MDI_VELOCITY])) if is_real(place) else 0.0
        asked.velocity = velocity / DEGREES_A_SECOND
    else:
        asked.position = image.received[MDI_TARPOS] * step
        increments = int(image.received[MDI_VELOCITY])
        if profidrive.settings.task_velocity_unsigned:
            increments &= 0xFFFFFFFF
        # a negative velocity is not valid for a task
        asked.velocity = increments * profidrive.settings.task_velocity_step
    if profidrive.settings.task_ramps_scaled:
        up = down = profidrive.settings.acceleration_step
    else:
        up = ramp_step(
            profidrive.settings.task_acceleration_step,
            jog.settings.acceleration,
            ramp.settings.acceleration,
        )
        down = ramp_step(
            profidrive.settings.task_deceleration_step,
            jog.settings.deceleration,
            ramp.settings.deceleration,
        )
    if profidrive.settings.real_tasks:
        asked.acceleration = _share(int(image.received[MDI_ACC])) * WHOLE * up
        asked.deceleration = _share(int(image.received[MDI_DEC])) * WHOLE * down
    else:
        asked.acceleration = _ramp(profidrive, _acceleration(profidrive, image)) * up
        asked.deceleration = _ramp(profidrive, int(image.received[MDI_DEC])) * down
    asked.backwards = 1 if profidrive.stw1 & BACKWARDS else 0


@inlined
def _take_target(profidrive: Any, ramp: Any, asked: Any, positioning: Any, image: Any, position: float) -> None:
    """A target of the telegram, or a driving set's, with the telegram's velocity and the ramps in force.

    Moog MSD manual 10.2.1 and 10.5: with STW1.13 every change applies at once, or as soon as it can begin (assumed),
    and the feed enable has no meaning; with STW1.14 the axis runs at the velocity, in the direction of its sign,
    without a target; at 0 it stands.
    """
    stw1 = int(profidrive.stw1)
    asked.feed_free = 1 if stw1 & NO_HANDSHAKE else 0
    relative = 1 if stw1 & RELATIVE else 0
    velocity = image.received[VELOCITY_A] * profidrive.settings.task_velocity_step
    endless = 1 if stw1 & ENDLESS else 0
    runs = positioning.state == MOTION_TASK and not relative
    if stw1 & NO_HANDSHAKE:
        other = abs(velocity) != asked.velocity or (velocity < 0.0) != (asked.backwards != 0)
        other = other or ramp.up != asked.acceleration or ramp.down != asked.deceleration
        other = other or (stw1 ^ int(profidrive.stw1_before)) & ENDLESS != 0
        if position != asked.position or (other and (runs or endless)):
            asked.renewed = 1
        if asked.renewed:
            asked.begins = 1
    else:
        asked.renewed = 0
    asked.still = 1 if endless or (runs and stw1 & NO_HANDSHAKE) else 0
    asked.relative = relative
    asked.endless = endless
    asked.velocity = abs(velocity)
    asked.backwards = 1 if velocity < 0.0 else 0
    asked.acceleration = ramp.up
    asked.deceleration = ramp.down
    asked.position = position


@inlined
def _take_set(axis: Any, image: Any, step: float) -> None:
    """The driving set that SATZANW names; one that does not exist begins nothing."""
    number = int(image.received[SATZANW]) & NUMBER
    if number < DRIVING_SETS:
        axis.asked.number = number
        _take_target(
            axis.profidrive,
            axis.ramp,
            axis.asked,
            axis.positioning,
            image,
            axis.driving_sets.settings.position[number] * step,
        )
        return
    axis.asked.feed_free = 1 if axis.profidrive.stw1 & NO_HANDSHAKE else 0
    axis.asked.begins = 0


@inlined
def _take_mode(asked: Any, image: Any) -> None:
    """MDI_MOD, and the MDI bit of SATZANW: telegram 9 of the profile and similar ones."""
    asked.relative = 0 if image.received[MDI_MOD] & ABSOLUTE else 1
    asked.mdi = 1 if image.received[SATZANW] & MDI_SELECTED else 0


@inlined
def _take_signals(axis: Any, image: Any, step: float) -> None:
    """Take the requested task from the telegram's signals; ``profidrive.task_form`` is evaluated here only."""
    form = int(axis.profidrive.settings.task_form)
    if form != TASKS_POS_STW:
        forget_position_words(axis)
    if form == TASKS_TABLE:
        _take_set(axis, image, step)
        return
    if form == TASKS_TARPOS:
        _take_target(axis.profidrive, axis.ramp, axis.asked, axis.positioning, image, image.received[TARPOS_A] * step)
        return
    asked = axis.asked
    before = (asked.position, asked.velocity, asked.acceleration, asked.deceleration, asked.backwards)
    _take_data(axis.profidrive, axis.ramp, axis.jog, asked, image, step)
    if form == TASKS_POS_STW:
        take_first_position_word(axis, image, before)
        take_second_position_word(axis, image)
    elif form == TASKS_MDI:
        _take_mode(axis.asked, image)
    if form == TASKS_POS_STW or axis.profidrive.settings.position_words:
        take_override(axis, image)
    if axis.profidrive.settings.feedrate_signal:
        axis.asked.override = (image.received[MT_FEEDRATE] & 0xFFFF) / axis.asked.settings.feedrate_whole
    if _take_command(axis.commands, axis.asked, axis.motion_tasks) or axis.asked.mdi:
        return
    if form == TASKS_NONE:
        axis.asked.begins = 0
    elif form == TASKS_MDI and axis.asked.begins:
        # only then: jogging uses the data of the telegram
        select_task(axis.asked, axis.motion_tasks, int(image.received[SATZANW]) & NUMBER)


@inlined
def take_task(axis: Any, image: Any) -> None:
    """The signals of this step in physical units; ``asked.begins`` is set on the edge that starts a task."""
    axis.asked.begins = 0
    if not image.valid:
        # what the telegram brought last is kept while only its data is invalid
        axis.homing.brought = int(axis.homing.brought) & int(axis.profidrive.settings.home_signals)
    if axis.profidrive.setpoints == SETPOINTS_HELD:
        # nothing of the telegram is accepted: the last request stays, and edges are ignored
        if image.valid:
            axis.asked.pos_stw2 = image.received[POS_STW2] & 0xFFFF
        axis.homing.inputs = axis.machine.inputs
        _take_command(axis.commands, axis.asked, axis.motion_tasks)
        return
    axis.jog.asked = JOG_NONE
    axis.asked.mdi = 0
    axis.asked.feed_free = 0
    axis.asked.endless = 0
    axis.asked.still = 0
    if by_sequence(axis.jog):
        axis.jog.asked = _jog_asked(axis.orders, axis.jog, axis.asked, axis.positioning, axis.profidrive.stw1)
    here = (
        axis.profidrive.setpoints == SETPOINTS_TAKEN
        and axis.profidrive.settings.reference_source == axis.profidrive.settings.bus_source
    )
    if not here or (axis.profidrive.settings.task_form == TASKS_NONE and axis.drive.settings.opmode != POSITION_MODE):
        forget_position_words(axis)
        axis.commands.task = 0
        axis.asked.renewed = 0
        return
    axis.jog.asked = _jog_asked(axis.orders, axis.jog, axis.asked, axis.positioning, axis.profidrive.stw1)
    if axis.profidrive.stw1_changed & START_BIT and (
        axis.profidrive.stw1 & START_BIT or not axis.asked.settings.control_config & CONFIG_RISING_EDGE
    ):
        axis.asked.begins = 1
    axis.asked.override = axis.ramp.settings.speed_override
    axis.asked.counts_from = axis.asked.settings.relative_base
    target_step = (
        axis.profidrive.settings.target_step
        if axis.profidrive.settings.target_step > 0.0
        else axis.travel.settings.position_step
    )
    _take_homing(axis.profidrive, axis.positioning, axis.homing, image, target_step)
    axis.asked.number = TASK_MDI
    _take_signals(axis, image, target_step)
    axis.commands.task = 0
