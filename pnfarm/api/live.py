"""``GET live``: what the farm's page shows, in one stream of server-sent events for each page.

====================  =============================================================================================
event                 data
====================  =============================================================================================
``farm``              once: name, link, interface, lines, count of drives, faults by model, what this client may do
``overview``          ten times a second, what changed since the message before (:mod:`pnfarm.farm.views.overview`)
``log``               new entries of the event log; ``lost``, if the client was too slow for some
``drive``             of the chosen drive: its whole state, four times a second
``signals``           of the chosen drive: samples of its signals since the message before (:mod:`pnfarm.trace.live`)
====================  =============================================================================================

A message is made when the client has taken the one before, and holds what changed since: a slow client gets fewer and
larger ones, and costs no more memory than its connection.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import anyio

from pnfarm.api.access.guard import WHO
from pnfarm.farm.views.overview import Overview
from pnfarm.links.base import interface_below
from pnfarm.trace.live import LiveSignals, LiveViewer

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator, Mapping

    from pnfarm.api.context import ApiContext
    from pnfarm.station.axis import Axis

__all__ = ["LiveViews"]

INTERVAL_SECONDS = 0.1
#: The chosen drive's whole state is sent with each so many messages.
DRIVE_EVERY = 3
#: Entries of the log in one message, and those that a client may be behind.
MOST_ENTRIES = 64
MOST_BEHIND = 512
#: Most octets that are handed to a connection at once.
PIECE = 65_536
#: Time until a browser reconnects.
RETRY_MILLISECONDS = 1000


def _message(event: str, data: bytes) -> bytes:
    return b"event: %b\ndata: %b\n\n" % (event.encode(), data)


def _json(data: object) -> bytes:
    return json.dumps(data, separators=(",", ":"), default=str).encode()


def _parts(message: bytes) -> Iterator[bytes]:
    """A message as pieces of a bounded size: of a long one, a client that does not read holds two at most."""
    for begin in range(0, len(message), PIECE):
        yield message[begin : begin + PIECE]


class LiveViews:
    """The streams of one farm's pages."""

    def __init__(self, context: ApiContext) -> None:
        self._context = context
        self._signals = LiveSignals(context.core.traces)
        #: Made with the first page: a farm that nobody looks at has no cost.
        self._overview: Overview | None = None
        context.on_close.append(self._close)

    def _close(self) -> None:
        if self._overview is not None:
            self._overview.close()
            self._overview = None

    async def stream(
        self, scope: Mapping[str, Any], station: Axis | None, *, follow: bool = True
    ) -> AsyncIterator[bytes]:
        """Messages until the client goes or the API stops; ``station`` is the chosen drive.

        Without ``follow`` it ends after the first message of each event.
        """
        context = self._context
        if self._overview is None:
            self._overview = Overview(context.core, context.now)
        overview = self._overview
        viewer = None if station is None else LiveViewer(self._signals, station)
        wake = anyio.Event()

        def stop() -> None:
            wake.set()

        context.streams.add(stop)
        try:
            hello = b"retry: %d\n%b" % (RETRY_MILLISECONDS, _message("farm", _json(self._farm(scope))))
            for part in _parts(hello):
                yield part
            version, after, number = 0, context.core.log.newest, 0
            while not context.closing:
                text = overview.since(version)
                version = overview.version
                pieces = [_message("overview", text)]
                entries, after = self._entries(after)
                if entries is not None:
                    pieces.append(_message("log", _json(entries)))
                if station is not None and viewer is not None:
                    if number % DRIVE_EVERY == 0:
                        pieces.append(_message("drive", _json(context.view(station))))
                    pieces.append(_message("signals", _json(viewer.fresh(context.now()))))
                number += 1
                for part in _parts(b"".join(pieces)):
                    yield part
                if not follow:
                    return
                with anyio.move_on_after(INTERVAL_SECONDS):
                    await wake.wait()
        finally:
            context.streams.discard(stop)

    def _entries(self, after: int) -> tuple[dict[str, Any] | None, int]:
        """The next entries of the log after this one, and the last one's number."""
        log = self._context.core.log
        lost = max(0, log.newest - after - MOST_BEHIND)
        entries = log.entries(after=after + lost, most=MOST_ENTRIES)
        if not entries:
            return None, after
        lost = entries[0].sequence - after - 1
        found: dict[str, Any] = {"entries": [entry.as_dict() for entry in entries]}
        if lost:
            found["lost"] = lost
        return found, entries[-1].sequence

    def _farm(self, scope: Mapping[str, Any]) -> dict[str, Any]:
        core = self._context.core
        models = {station.model.name: station.model for station in core.axes}
        return {
            "farm": core.name,
            "link": core.link.kind,
            "parent": interface_below(core.link),
            "drives": len(core.axes),
            "writes": scope.get(WHO) != "read_token",
            "lines": {name: {"way": line.way, "where": line.where} for name, line in core.lines.items()},
            "faults": {
                name: {number: [fault.label, fault.name] for number, fault in model.faults.items()}
                for name, model in models.items()
            },
        }
