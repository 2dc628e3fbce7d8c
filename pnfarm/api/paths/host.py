"""What the paths of every subject use of a farm's API, or of a hub."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.station.event import Event

__all__ = ["Host"]


class Host(Protocol):
    """A farm, or a hub, which answers for several: ``kind`` is ``farm`` or ``hub``.

    ``instance`` is another one in each run; ``on_close`` is called when the API stops.
    """

    kind: str
    instance: str
    on_close: list[Callable[[], None]]

    def now(self) -> int:
        """Its clock, ns."""

    def record(self, event: Event) -> None:
        """An entry of the log."""

    def note(self, *events: Event) -> None:
        """A client changed something: log these, then see to the consequences at once."""
