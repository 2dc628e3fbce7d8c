"""The rows of one drive in the tables, for the event loop."""

from __future__ import annotations

from typing import Any

from pnfarm.errors import PnfarmError
from pnfarm.table.axis_codes import CMD_POWER_ON, COMMANDS

__all__ = ["AxisHandle", "CommandRingFullError"]


class CommandRingFullError(PnfarmError):
    """The firmware has not taken the last commands: the engine does not run or the drive is off."""

    exit_code = 3


class AxisHandle:
    """One axis record and its process image.

    ``axis`` and ``image`` are single rows (``table[i]``) of :data:`pnfarm.firmware.axis.AXIS` and
    :data:`pnfarm.table.image.IMAGE`; writing an attribute writes into the table.
    """

    __slots__ = ("_boots_before", "axis", "image")

    def __init__(self, axis: Any, image: Any) -> None:
        self.axis = axis
        self.image = image
        #: Where the ring's tail is when the firmware has taken the command that boots the drive; None once it has.
        self._boots_before: int | None = None

    def push_command(self, code: int, argument: int = 0) -> None:
        """Pass ``code`` (``CMD_*``) to the firmware; raises :class:`CommandRingFullError`.

        One place is kept for the command that boots the drive; where it waits as the last one, once is enough.  The
        entry is written before the head moves, so that the engine never takes a half-written one.
        """
        if not 0 <= code <= 0xFF:
            raise ValueError(f"command code {code} does not fit in an octet")
        commands = self.axis.commands
        head = int(commands.settings.head)
        waiting = (head - int(commands.tail)) & 0xFFFFFFFF
        if code == CMD_POWER_ON and waiting and int(commands.settings.ring[(head - 1) % COMMANDS]) == CMD_POWER_ON:
            return
        if code != CMD_POWER_ON and waiting >= COMMANDS - 1:
            raise CommandRingFullError(
                f"the drive has not taken its last {COMMANDS - 1} commands; it is off or the engine does not run"
            )
        commands.settings.ring[head % COMMANDS] = code | argument << 8
        commands.settings.head = (head + 1) & 0xFFFFFFFF
        if code == CMD_POWER_ON:
            self._boots_before = (head + 1) & 0xFFFFFFFF

    @property
    def is_to_boot(self) -> bool:
        """Whether the firmware has not taken the command that boots the drive: what it shows is from before."""
        # each reading of a condition asks: the table is read only until the answer is no
        if self._boots_before is None:
            return False
        if not 0 < (self._boots_before - int(self.axis.commands.tail)) & 0xFFFFFFFF <= COMMANDS:
            self._boots_before = None
        return self._boots_before is not None

    @property
    def in_operation(self) -> bool:
        """Whether the power stage is on: states S4 and S5."""
        return int(self.axis.drive.state) >= 4

    @property
    def controlled(self) -> bool:
        """Whether a controller sends valid set points."""
        return bool(self.image.valid)
