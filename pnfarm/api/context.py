"""What the handlers share: the farm's objects, its clock, and the streams that are open."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import anyio

from pnfarm.api.messages import Messages
from pnfarm.errors import ConfigError
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.web.errors import NotFoundError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.farm.core import FarmCore
    from pnfarm.metrics import FarmCollector
    from pnfarm.station.axis import Axis
    from pnfarm.station.station import Station

__all__ = ["ApiContext"]


@dataclass(slots=True)
class ApiContext:
    """``now`` reads the farm's clock; ``poke`` makes the runtime handle a handler's change at once."""

    core: FarmCore
    collector: FarmCollector
    now: Callable[[], int]
    poke: Callable[[], None]
    #: Another one in each run of the farm.
    instance: str = field(default_factory=lambda: secrets.token_hex(4))
    closing: bool = False
    streams: set[Callable[[], None]] = field(default_factory=set)
    #: Called when the API stops.
    on_close: list[Callable[[], None]] = field(default_factory=list)
    rendering: anyio.Lock = field(default_factory=anyio.Lock)
    messages: Messages = field(default_factory=Messages)

    def axis(self, name: str) -> Axis:
        """Raises :class:`NotFoundError`."""
        try:
            return self.core.axis(name)
        except ConfigError as exc:
            raise NotFoundError(str(exc)) from exc

    def station(self, name: str) -> Station:
        """The station of an axis, or by its own name; raises :class:`NotFoundError`."""
        try:
            return self.core.station(name)
        except ConfigError as exc:
            raise NotFoundError(str(exc)) from exc

    def view(self, station: Axis) -> dict[str, Any]:
        """One drive as it is now."""
        return drive_snapshot(self.core, station, self.now())

    def changed(self, station: Station) -> None:
        """Call after a change to this station: handles its events and sends its frames."""
        self.core.settle(station, self.now())
        self.poke()

    def close(self) -> None:
        """End every open stream, and what else runs for clients."""
        self.closing = True
        for end in self.on_close:
            end()
        for wake in list(self.streams):
            wake()
