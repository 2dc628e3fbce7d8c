"""The event logs of all shards as one, and the page's view of all drives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.api.paths.streams import ALL
from pnfarm.hub.events import event_stream

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Mapping

    from pnfarm.api.paths.streams import Chosen
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.live import HubLive

__all__ = ["HubStreams"]


class HubStreams:
    """As :class:`~pnfarm.api.paths.streams.StreamsHost`."""

    def __init__(self, hub: Hub, views: HubLive) -> None:
        self._hub = hub
        self._views = views

    def events(self, begin: str | None, drive: str | None, *, follow: bool) -> AsyncIterator[str]:
        own = None if drive is None else self._hub.shards.own_name(drive)
        return event_stream(self._hub, begin, own, follow=follow)

    async def live(self, scope: Mapping[str, Any], chosen: Chosen) -> AsyncIterator[bytes]:
        if chosen.drive is not None:
            self._hub.shards.known(chosen.drive)
        if chosen.devices and ALL not in chosen.devices:
            for name in chosen.devices:
                self._hub.shards.device_owner(name)
        return self._views.stream(scope, chosen)
