"""PROFIdrive in front of an axis: the words of a telegram become its orders, and its state becomes words."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.motion.jog import take_jog_bits
from pnfarm.firmware.profidrive.control_word import forget_control_word, take_control_word
from pnfarm.firmware.profidrive.sensor_interface import ENCODER_1, ENCODER_2, forget_sensor, step_sensor
from pnfarm.firmware.profidrive.setpoints import take_cyclic, take_jog_speeds, take_torque_limits
from pnfarm.firmware.profidrive.sign_of_life import check_life
from pnfarm.firmware.profidrive.smoothed import forget_smoothed, show_smoothed
from pnfarm.firmware.profidrive.status_msd import take_generator
from pnfarm.firmware.profidrive.status_word import status_word
from pnfarm.firmware.profidrive.tasks import take_task
from pnfarm.firmware.profidrive.telegram import to_actuals
from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.signals import G1_STW, G2_STW

__all__ = ["forget_words", "show_words", "take_words"]

#: Of ``profidrive.shows``.
SMOOTHED = 0x04


@inlined
def forget_words(axis: Any, image: Any) -> None:
    """The drive was switched on: reset everything known of the controller, and what the words show of before."""
    forget_control_word(axis.profidrive, image)
    axis.asked.pos_stw2 = 0
    axis.life.sent = 0
    forget_smoothed(axis.profidrive, int(axis.last_ns))
    forget_sensor(axis.sensor)
    forget_sensor(axis.sensor_2)


@inlined
def take_words(axis: Any, image: Any, now: int) -> None:
    """Input, before the drive acts: orders, set points and tasks."""
    take_control_word(axis, image, now)
    check_life(axis.faults, axis.life, now)
    take_torque_limits(axis, image)
    take_jog_bits(axis.orders, axis.jog)
    take_jog_speeds(axis.profidrive, axis.jog, image)
    take_task(axis, image)
    take_cyclic(axis, image, now)


@inlined
def show_words(axis: Any, image: Any) -> None:
    """Output, after motor and load: status words, actual values, and the encoders' own words."""
    take_generator(axis)
    axis.profidrive.zsw1 = status_word(axis)
    to_actuals(axis, image)
    if int(axis.profidrive.settings.shows) & SMOOTHED:
        show_smoothed(axis, image)
    step_sensor(axis, axis.sensor, image, int(image.received[G1_STW]), ENCODER_1)
    if axis.sensor_2.settings.step > 0.0:
        step_sensor(axis, axis.sensor_2, image, int(image.received[G2_STW]), ENCODER_2)
