"""The position controller in front of an axis: a command assembly becomes its orders, its state a response assembly.

Besides the three functions of every front it says what the event loop has to do for it.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.ethernetip.commands import forget_commands, take_commands
from pnfarm.firmware.ethernetip.control_word import forget_control_word, take_control_word
from pnfarm.firmware.ethernetip.maps import take_map
from pnfarm.firmware.ethernetip.status import show_response
from pnfarm.firmware.motion.jog import take_jog_bits
from pnfarm.table.compiling.compiled import inlined

__all__ = ["forget_assembly", "show_assembly", "take_assembly"]


@inlined
def forget_assembly(axis: Any) -> None:
    """The drive was switched on: reset everything known of the controller."""
    forget_control_word(axis.ethernetip)
    forget_commands(axis.ethernetip)


@inlined
def take_assembly(axis: Any, image: Any, now: int) -> None:
    """Input, before the drive acts: orders, set points and tasks."""
    word = take_control_word(axis, image, now)
    take_jog_bits(axis.orders, axis.jog)
    take_commands(axis, image, word, now)
    take_map(axis, image)


@inlined
def show_assembly(axis: Any, image: Any) -> None:
    """Output, after motor and load."""
    show_response(axis, image)
