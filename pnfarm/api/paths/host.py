"""What the paths of every subject use of a farm's API, or of a hub."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from pnfarm.station.event import Event

__all__ = ["Host"]


class Host(Protocol):
    """A farm, or a hub, which answers for several.  ``instance`` is another one in each run."""

    instance: str

    @property
    def kind(self) -> str:
        """``farm`` or ``hub``."""

    def now(self) -> int:
        """Its clock, ns."""

    def note(self, *events: Event) -> None:
        """A client changed something: log these, then see to the consequences at once."""
