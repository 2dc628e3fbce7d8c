"""An event of a test's own, of any words and values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pnfarm.station.event import Event


@dataclass(frozen=True)
class Something(Event):
    """What a test wants to find in the log again."""

    words: str
    values: dict[str, Any] = field(default_factory=dict)

    @property
    def text(self) -> str:
        return self.words

    def details(self) -> dict[str, Any]:
        return self.values
