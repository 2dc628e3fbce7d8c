"""The rows of one drive in the tables, for the event loop."""

from __future__ import annotations

from typing import Any

from pnfarm.errors import PnfarmError
from pnfarm.table.axis_codes import COMMANDS

__all__ = ["AxisHandle", "CommandRingFullError"]


class CommandRingFullError(PnfarmError):
    """The firmware has not taken the last commands: the engine does not run or the drive is off."""

    exit_code = 3


class AxisHandle:
    """One axis record and its process image.

    ``axis`` and ``image`` are single rows (``table[i]``) of :data:`pnfarm.firmware.axis.AXIS` and
    :data:`pnfarm.table.image.IMAGE`; writing an attribute writes into the table.
    """

    __slots__ = ("axis", "image")

    def __init__(self, axis: Any, image: Any) -> None:
        self.axis = axis
        self.image = image

    def push_command(self, code: int, argument: int = 0) -> None:
        """Pass ``code`` (``CMD_*``) to the firmware; raises :class:`CommandRingFullError`.

        The entry is written before the head moves, so that the engine never takes a half-written one.
        """
        if not 0 <= code <= 0xFF:
            raise ValueError(f"command code {code} does not fit in an octet")
        head = int(self.axis.commands.settings.head)
        if (head - int(self.axis.commands.tail)) & 0xFFFFFFFF >= COMMANDS:
            raise CommandRingFullError(
                "the drive has not taken its last 16 commands; it is off or the engine does not run"
            )
        self.axis.commands.settings.ring[head % COMMANDS] = code | argument << 8
        self.axis.commands.settings.head = (head + 1) & 0xFFFFFFFF

    @property
    def in_operation(self) -> bool:
        """Whether the power stage is on: states S4 and S5."""
        return int(self.axis.drive.state) >= 4

    @property
    def controlled(self) -> bool:
        """Whether a controller sends valid set points."""
        return bool(self.image.valid)
