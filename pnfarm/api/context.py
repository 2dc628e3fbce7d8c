"""What the handlers share: the farm's objects, its clock, and the streams that are open."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import anyio

from pnfarm.api.messages import Messages
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.web.errors import named_by_path

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.farm.core import FarmCore
    from pnfarm.metrics import FarmCollector
    from pnfarm.station.axis import Axis
    from pnfarm.station.event import Event
    from pnfarm.station.node import StationNode
    from pnfarm.station.station import Station

__all__ = ["ApiContext", "Context"]


@dataclass(slots=True, kw_only=True, eq=False)
class Context:
    """Of a farm's API, or of a hub."""

    #: ``farm`` or ``hub``.
    kind: str = "farm"
    #: Another one in each run.
    instance: str = field(default_factory=lambda: secrets.token_hex(4))
    closing: bool = False
    streams: set[Callable[[], None]] = field(default_factory=set)
    #: Called when the API stops.
    on_close: list[Callable[[], None]] = field(default_factory=list)

    def close(self) -> None:
        """End every open stream, and what else runs for clients."""
        self.closing = True
        for end in self.on_close:
            end()
        for wake in list(self.streams):
            wake()


@dataclass(slots=True, kw_only=True, eq=False)
class ApiContext(Context):
    """``now`` reads the farm's clock; ``poke`` makes the runtime handle a handler's change at once."""

    core: FarmCore
    collector: FarmCollector
    now: Callable[[], int]
    poke: Callable[[], None]
    messages: Messages = field(init=False)
    rendering: anyio.Lock = field(default_factory=anyio.Lock)

    def __post_init__(self) -> None:
        self.messages = Messages(self.instance)

    def axis(self, name: str) -> Axis:
        """Raises :class:`NotFoundError`."""
        with named_by_path():
            return self.core.axis(name)

    def station(self, name: str) -> Station:
        """By its own name or by an axis's; raises :class:`NotFoundError`."""
        with named_by_path():
            return self.core.station(name)

    def device(self, name: str) -> Station:
        """A station without axes; raises :class:`NotFoundError`."""
        with named_by_path():
            return self.core.device(name)

    def tag(self, revision: int) -> str:
        """The ETag of a device's signals at this revision."""
        return f'"{self.instance}-{revision}"'

    def view(self, axis: Axis) -> dict[str, Any]:
        return drive_snapshot(self.core, axis, self.now())

    def record(self, event: Event, drive: str = "") -> None:
        """An entry of the farm's log."""
        self.core.log.record(self.now(), drive, event)

    def note(self, *events: Event) -> None:
        """A client changed something: log these, then make the runtime handle it."""
        for event in events:
            self.record(event)
        self.poke()

    def changed(self, station: StationNode) -> None:
        """Call after a change to this station: handles its events and sends its frames."""
        self.core.settle(station, self.now())
        self.poke()
