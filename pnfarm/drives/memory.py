"""A drive's non-volatile memory: what survives a power cycle.

The farm keeps it in SQLite; tests and farms in memory use :class:`VolatileMemory`.
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
        ...

    def save(self, station: str, values: dict[str, Any]) -> None:
        """Replace what is kept for this station."""
        ...

    def damaged(self, detail: str) -> EnvironmentError_:
        """The error to raise for values that no drive wrote; names their place of storage."""
        ...


class VolatileMemory:
    """A :class:`NonVolatile` that lives as long as the process."""

    def __init__(self) -> None:
        self._kept: dict[str, dict[str, Any]] = {}

    def load(self, station: str) -> dict[str, Any] | None:
        return copy.deepcopy(self._kept.get(station))

    def save(self, station: str, values: dict[str, Any]) -> None:
        self._kept[station] = copy.deepcopy(values)

    def damaged(self, detail: str) -> EnvironmentError_:
        return EnvironmentError_(f"the drives' memory is damaged: {detail}")
