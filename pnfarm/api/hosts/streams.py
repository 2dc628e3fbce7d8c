"""The event log of one farm, and its page's view."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.api.events import event_stream, start_of
from pnfarm.api.paths.streams import ALL
from pnfarm.web.errors import named_by_path

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Mapping

    from pnfarm.api.context import ApiContext
    from pnfarm.api.live import LiveViews
    from pnfarm.api.paths.streams import Chosen
    from pnfarm.station.plain_signals import NamedSignals

__all__ = ["FarmStreams"]


class FarmStreams:
    """As :class:`~pnfarm.api.paths.streams.StreamsHost`."""

    def __init__(self, context: ApiContext, views: LiveViews) -> None:
        self._context = context
        self._views = views

    def events(self, begin: str | None, drive: str | None, *, follow: bool) -> AsyncIterator[str]:
        context = self._context
        if drive is not None:
            drive = context.axis(drive).configured_name
        return event_stream(context, start_of(context.core.log, context.instance, begin), drive, follow=follow)

    async def live(self, scope: Mapping[str, Any], chosen: Chosen) -> AsyncIterator[bytes]:
        station = None if chosen.drive is None else self._context.axis(chosen.drive)
        devices = self._devices(chosen.devices)
        return self._views.stream(
            scope, station, devices, overview=chosen.overview, begin=chosen.begin, follow=chosen.follow
        )

    def _devices(self, names: tuple[str, ...]) -> dict[str, NamedSignals]:
        core, owners = self._context.core, self._context.core.signal_owners
        with named_by_path():
            found = owners.values() if ALL in names else [owners.get(name) or core.device(name) for name in names]
            return {one.configured_name: one.signals for one in found if one.signals is not None}
