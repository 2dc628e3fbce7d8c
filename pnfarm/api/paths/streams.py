"""Paths that stay open: the event log and the page's view, as server-sent events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Protocol

from fastapi import Header, Query, Request
from starlette.responses import Response, StreamingResponse

from pnfarm.web.paths import text

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Mapping

    from pnfarm.web.paths import Paths

__all__ = ["ALL", "LIVE_STREAM", "Chosen", "StreamsHost", "add_streams"]

#: Devices that one client may name, and the word for all of them.
MOST_DEVICES = 1000
ALL = "all"

#: OpenAPI has no words for the parts of a stream.
EVENT_STREAM = {
    "type": "string",
    "description": "Each message: `data` is a LogEntry of the components as JSON, `id` its position, to be sent as "
    "Last-Event-ID. A message of type `gap` has in `data` how many entries were `lost`.",
}
LIVE_STREAM = {
    "type": "string",
    "description": "Messages of types farm, overview, log, drive, signals and values, each with one JSON object; see "
    "the documentation of the web page. `data` of `values` is a ChangedSignals of the components.",
}


@dataclass(frozen=True, slots=True)
class Chosen:
    """What a client of ``live`` wants: a drive in detail, signals of devices, all drives at a glance and the log.

    ``begin``: the id of the last message of an earlier stream, None: the log from now on.
    """

    drive: str | None
    devices: tuple[str, ...]
    overview: bool
    follow: bool
    begin: str | None = None


class StreamsHost(Protocol):
    """Who has the streams.  Raises :class:`~pnfarm.web.errors.NotFoundError` for an unknown drive or device."""

    def events(self, begin: str | None, drive: str | None, *, follow: bool) -> AsyncIterator[str]:
        """Entries after the one with the id ``begin``; None: from now on."""

    async def live(self, scope: Mapping[str, Any], chosen: Chosen) -> AsyncIterator[bytes]:
        """The page's messages; ``scope`` is the request's."""


def add_streams(path: Paths, streams: StreamsHost) -> None:
    """Declare them."""

    def opened(stream: AsyncIterator[str] | AsyncIterator[bytes]) -> Response:
        return StreamingResponse(stream, media_type="text/event-stream", headers={"Cache-Control": "no-store"})

    @path("GET events", text("text/event-stream", EVENT_STREAM), response_class=StreamingResponse)
    async def events(
        last_event_id: Annotated[str | None, Header(description="`id` of the last message received.")] = None,
        drive: Annotated[str | None, Query(description="Only entries of this drive.")] = None,
        after: Annotated[
            int | None, Query(ge=0, description="Begin after this sequence number; 0: with the oldest entry kept.")
        ] = None,
        follow: Annotated[bool, Query(description="Keep sending new entries; false: end after the newest.")] = True,
    ) -> Response:
        """The event log as server-sent events; Last-Event-ID resumes a stream."""
        begin = last_event_id if last_event_id is not None or after is None else str(after)
        return opened(streams.events(begin, drive, follow=follow))

    @path("GET live", text("text/event-stream", LIVE_STREAM), response_class=StreamingResponse)
    async def live(
        request: Request,
        last_event_id: Annotated[str | None, Header(description="`id` of the last message received.")] = None,
        drive: Annotated[str | None, Query(description="The drive in detail.")] = None,
        device: Annotated[
            list[str] | None,
            Query(
                max_length=MOST_DEVICES,
                description=f"A device or model of the plant to follow the signals of; {ALL}: each.",
            ),
        ] = None,
        overview: Annotated[bool, Query(description="Also all drives at a glance, and the event log.")] = True,
        after: Annotated[str | None, Query(description="As Last-Event-ID, which wins, of an earlier stream.")] = None,
        follow: Annotated[bool, Query(description="Keep sending; false: end after the first of each.")] = True,
    ) -> Response:
        """What the farm's page shows, as server-sent events: all drives, one in detail, signals of devices."""
        begin = last_event_id if last_event_id is not None else after
        chosen = Chosen(drive, tuple(dict.fromkeys(device or ())), overview, follow, begin)
        return opened(await streams.live(request.scope, chosen))
