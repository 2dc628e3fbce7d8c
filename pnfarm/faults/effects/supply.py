"""A station's control supply, as injections see it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.parts import DrivePart, Part

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.station.station import Station

__all__ = ["SUPPLY", "Supply"]


class Supply(DrivePart):
    """Calls are counted, so that several injections may request the same.

    ``settle(now)`` lets the station finish what a change began; ``goes_off()`` is called before the supply goes, and
    each of :attr:`returned` with the time when it has returned, before the station is settled.
    """

    def __init__(self, station: Station, *, settle: Callable[[int], None], goes_off: Callable[[], None]) -> None:
        self._station = station
        self._settle = settle
        self._goes_off = goes_off
        self.returned: list[Callable[[int], None]] = []
        self._off = 0

    def in_force(self) -> list[Any]:
        return ["power off"] * self._off

    @property
    def powered(self) -> bool:
        return self._station.powered

    @property
    def held_off(self) -> bool:
        """Whether an injection holds it off."""
        return self._off > 0

    def power_off(self, now: int) -> None:
        """Off until every caller that switched off has switched on."""
        self._off += 1
        if self._station.powered:
            self._goes_off()
            self._station.power_off(now)
            self._settle(now)

    def power_on(self, now: int) -> None:
        """Undo one :meth:`power_off`."""
        self._off -= 1
        # one that a user has switched off stays so, before or meanwhile
        if self._off == 0 and not self._station.powered and not self._station.switched_off:
            self._station.power_on(now)
            for back in self.returned:
                back(now)
            self._settle(now)


SUPPLY: Part[Supply] = Part("control supply")
