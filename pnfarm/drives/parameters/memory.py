"""A drive's non-volatile memory: what survives a power cycle.

The farm keeps it in SQLite or PostgreSQL; tests and farms in memory use :class:`VolatileMemory`.
"""

from __future__ import annotations

import copy
from typing import Any, Protocol

from pnfarm.errors import EnvironmentError_

__all__ = ["NonVolatile", "VolatileMemory"]


class NonVolatile(Protocol):
    """Keeps one dict of plain JSON values for each station."""

    def load(self, station: str) -> dict[str, Any] | None:
        """The values saved last for this station name, None if there are none."""

    def save(self, station: str, values: dict[str, Any]) -> None:
        """Replace what is kept for this station.

        Raises :class:`EnvironmentError_` where that is not known to have happened; :meth:`hold` follows then.
        """

    def hold(self, station: str, values: dict[str, Any]) -> None:
        """A save failed, and these are the values now: what a drive reads, and what is written when it can be."""

    @property
    def ready(self) -> bool:
        """Whether a save can succeed now, as far as is known."""

    def damaged(self, detail: str) -> EnvironmentError_:
        """The error to raise for values that no drive wrote; names their place of storage."""


class VolatileMemory:
    """A :class:`NonVolatile` that lives as long as the process."""

    def __init__(self) -> None:
        self._kept: dict[str, dict[str, Any]] = {}

    def load(self, station: str) -> dict[str, Any] | None:
        return copy.deepcopy(self._kept.get(station))

    def save(self, station: str, values: dict[str, Any]) -> None:
        self._kept[station] = copy.deepcopy(values)

    def hold(self, station: str, values: dict[str, Any]) -> None:
        self.save(station, values)

    @property
    def ready(self) -> bool:
        return True

    def damaged(self, detail: str) -> EnvironmentError_:
        return EnvironmentError_(f"the drives' memory is damaged: {detail}")
