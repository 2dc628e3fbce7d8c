"""An entry of a farm's event log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["FarmEvent"]

_OWN = frozenset({"sequence", "time", "farm_seconds", "drive", "event"})


@dataclass(frozen=True, slots=True)
class FarmEvent:
    """``time``: seconds since the epoch; ``farm_seconds``: the farm's clock; ``drive``: "" for the farm itself.

    ``event`` says what happened in a few lower-case words (``fault``, ``state changed``), ``data`` are its values.
    """

    sequence: int
    time: float
    farm_seconds: float
    drive: str
    event: str
    data: Mapping[str, Any]

    @classmethod
    def of(cls, entry: Mapping[str, Any]) -> Self:
        """From an entry as the API gives it."""
        data = {key: value for key, value in entry.items() if key not in _OWN}
        return cls(
            int(entry["sequence"]),
            float(entry["time"]),
            float(entry["farm_seconds"]),
            str(entry["drive"]),
            str(entry["event"]),
            data,
        )

    def __str__(self) -> str:
        values = ", ".join(f"{key} {value}" for key, value in self.data.items())
        who = f"{self.drive}: " if self.drive else ""
        return f"{self.farm_seconds:.3f} s {who}{self.event}" + (f" ({values})" if values else "")
