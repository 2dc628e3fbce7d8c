"""The event log of one farm, and its page's view."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.api.events import event_stream, start_of

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Mapping

    from pnfarm.api.context import ApiContext
    from pnfarm.api.live import LiveViews

__all__ = ["FarmStreams"]


class FarmStreams:
    """As :class:`~pnfarm.api.paths.streams.StreamsHost`."""

    def __init__(self, context: ApiContext, views: LiveViews) -> None:
        self._context = context
        self._views = views

    def events(self, begin: str | None, drive: str | None, *, follow: bool) -> AsyncIterator[str]:
        if drive is not None:
            drive = self._context.axis(drive).configured_name
        return event_stream(self._context, start_of(self._context.core.log, begin), drive, follow=follow)

    def live(self, scope: Mapping[str, Any], drive: str | None, *, follow: bool) -> AsyncIterator[bytes]:
        station = None if drive is None else self._context.axis(drive)
        return self._views.stream(scope, station, follow=follow)
