"""The sign of life of PROFIdrive: a count from 1 to 15 in bits 12..15 of STW2 and ZSW2."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.effects.parts import DrivePart, Part
from pnfarm.table.channel import RUN
from pnfarm.table.signals import PART_HIGH, STW2, WORD_NONE, ZSW2

if TYPE_CHECKING:
    from typing import Any

    from pnfarm.engine.columns import Columns
    from pnfarm.station.axis import Axis
    from pnfarm.wire.direction import Direction

__all__ = ["LIFE", "SignOfLife", "SignOfLifeEffect"]

_SLOTS: dict[str, int] = {"out": ZSW2, "in": STW2}
_NAMES = {"out": "ZSW2", "in": "STW2"}


class SignOfLife(DrivePart):
    """That of an axis."""

    def __init__(self, axis: Axis, columns: Columns) -> None:
        self._axis = axis
        self._columns = columns

    def check(self, directions: tuple[Direction, ...]) -> None:
        """Raises :class:`ConfigError` where there is no sign of life: in the drive, or in its present telegram."""
        name = self._axis.configured_name
        if self._axis.number:
            raise ConfigError(
                f"{name} is not the first axis of its station: only that one's sign of life can be changed"
            )
        if not self._axis.handle.axis.life.settings.watched:
            raise ConfigError(
                f"{name} ({self._axis.model.name}) has no sign of life: as it is set up, it neither sends nor "
                "monitors one"
            )
        for direction in directions:
            rows = self._channels(direction)
            if rows and not any(_carries(row, _SLOTS[direction]) for row in rows):
                raise ConfigError(f"{name} has no sign of life at present: its telegram lacks {_NAMES[direction]}")

    def _channels(self, direction: Direction) -> list[Any]:
        table = self._columns.cpm if direction == "in" else self._columns.ppm
        return [row for row in table if row.active and row.state == RUN and row.image == self._axis.station.index]


def _carries(channel: Any, slot: int) -> bool:
    codes = (int(code) for code in channel.word_code[: int(channel.words)])
    return any(code != WORD_NONE and code >> 2 == slot and code & 3 != PART_HIGH for code in codes)


LIFE: Part[SignOfLife] = Part("sign of life")


class SignOfLifeEffect(FramesEffect):
    """Changes the count in each frame that is hit."""

    life = LIFE
    acyclic = None

    def begin(self, now: int) -> None:
        self.life.check(self.spec.directions)
        super().begin(now)

    def settings(self, direction: Direction) -> dict[str, float]:
        return {"slot": _SLOTS[direction], "amount": self.values.get("by", 0)}
