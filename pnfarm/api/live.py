"""``GET live``: what the farm's page shows, in one stream of server-sent events for each page.

====================  =============================================================================================
event                 data
====================  =============================================================================================
``farm``              once: name, link, interface, lines, count of drives, faults by model, what this client may do
``overview``          ten times a second, what changed since the message before (:mod:`pnfarm.farm.views.overview`)
``log``               new entries of the event log; ``lost``, if the client was too slow for some, or away for too long
``drive``             of the chosen drive: its whole state, about three times a second
``signals``           of the chosen drive: samples of its signals since the message before (:mod:`pnfarm.trace.live`)
``values``            of the chosen devices and models of the plant: signals that changed since the message before
                      (:mod:`pnfarm.api.followed`)
====================  =============================================================================================

A message is made when the client has taken the one before, and holds what changed since: a slow client gets fewer and
larger ones, and costs no more memory than its connection.  A client may do without the first three.  With an id of this
stream (:mod:`pnfarm.api.events`) one that comes back gets the entries of the log that came meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol
from weakref import WeakValueDictionary

import anyio

from pnfarm.api.access.guard import ROLE
from pnfarm.api.events import ALIVE_SECONDS, format_position, start_of
from pnfarm.api.followed import Followed
from pnfarm.api.messages import message
from pnfarm.farm.views.overview import Overview
from pnfarm.farm.views.signal_changes import SignalChanges
from pnfarm.links.base import interface_below
from pnfarm.trace.live import LiveSignals, LiveViewer
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, AsyncIterator, Iterable, Iterator, Mapping

    from pnfarm.api.context import ApiContext, Context
    from pnfarm.api.events import Log
    from pnfarm.station.axis import Axis
    from pnfarm.station.plain_signals import NamedSignals

__all__ = ["LiveViews", "Page", "page_stream"]

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
#: Rounds without a message after which a comment keeps the stream open.
ALIVE_ROUNDS = round(ALIVE_SECONDS / INTERVAL_SECONDS)


class Page(Protocol):
    """What one page is shown, as messages."""

    def overview(self) -> Iterable[bytes]:
        """The farm, if it is another one than before, and what changed."""

    def chosen(self, *, whole: bool) -> Iterable[bytes]:
        """The chosen drive and devices; with ``whole`` of all devices at once."""


async def page_stream(
    context: Context, log: Log | None, page: Page, *, begin: str | None = None, follow: bool = True
) -> AsyncGenerator[bytes]:
    """Messages until the client goes or the API stops; without ``follow`` one of each event.

    Without a ``log`` the client gets what it chose, and no overview; its entries are those after ``begin``, an id of
    an earlier stream, or those from now on.
    """
    wake = anyio.Event()

    def stop() -> None:
        wake.set()

    def position(number: int) -> bytes:
        return format_position({context.instance: number}).encode()

    context.streams.add(stop)
    try:
        after = 0 if log is None else start_of(log, context.instance, begin)
        # the id is of the message that follows
        yield b"retry: %d\n" % RETRY_MILLISECONDS + (b"" if log is None else b"id: %b\n" % position(after))
        silent = 0
        while not context.closing:
            pieces = [] if log is None else [*page.overview()]
            lost = 0 if log is None else max(0, log.newest - after - MOST_BEHIND)
            if log is not None and (entries := log.entries(after=after + lost, most=MOST_ENTRIES)):
                found: dict[str, Any] = {"entries": [entry.as_dict() for entry in entries]}
                if lost := entries[0].sequence - after - 1:
                    found["lost"] = lost
                after = entries[-1].sequence
                pieces.append(b"id: %b\n%b" % (position(after), message("log", found)))
            whole = b"".join([*pieces, *page.chosen(whole=not follow)])
            silent = 0 if whole else silent + 1
            if silent == ALIVE_ROUNDS:
                whole, silent = b": alive\n\n", 0
            # of a long message, a client that does not read holds two pieces at most
            for start in range(0, len(whole), PIECE):
                yield whole[start : start + PIECE]
            if not follow:
                return
            with anyio.move_on_after(INTERVAL_SECONDS):
                await wake.wait()
    finally:
        context.streams.discard(stop)


class LiveViews:
    """The streams of one farm's pages."""

    def __init__(self, context: ApiContext) -> None:
        self._context = context
        self._signals = LiveSignals(context.core.traces)
        #: Made with the first page: a farm without viewers has no cost.
        self._overview: Overview | None = None
        #: By device, while a client follows it.
        self._changes: WeakValueDictionary[str, SignalChanges] = WeakValueDictionary()
        context.on_close.append(self._close)

    def _close(self) -> None:
        if self._overview is not None:
            self._overview.close()
            self._overview = None

    def stream(
        self,
        scope: Mapping[str, Any],
        station: Axis | None,
        devices: Mapping[str, NamedSignals] | None = None,
        *,
        overview: bool = True,
        begin: str | None = None,
        follow: bool = True,
    ) -> AsyncIterator[bytes]:
        """See :func:`page_stream`; ``station`` is the chosen drive, ``devices`` are the chosen ones by name."""
        context = self._context
        if overview and self._overview is None:
            self._overview = Overview(context.core, context.now)
        viewer = None if station is None else LiveViewer(self._signals, station)
        followed = Followed([(name, self._changes_of(name, one)) for name, one in (devices or {}).items()], context.tag)
        page = _FarmPage(
            context, self._overview, scope.get(ROLE, Role.READ).covers(Role.INJECT), station, viewer, followed
        )
        return page_stream(context, context.core.log if overview else None, page, begin=begin, follow=follow)

    def _changes_of(self, name: str, signals: NamedSignals) -> SignalChanges:
        found = self._changes.get(name)
        if found is None:
            found = self._changes[name] = SignalChanges(signals, self._context.now)
        return found


@dataclass(slots=True)
class _FarmPage:
    context: ApiContext
    seen: Overview | None
    #: Whether this client may change something.
    writes: bool
    station: Axis | None
    viewer: LiveViewer | None
    followed: Followed
    version: int = 0
    number: int = 0

    def overview(self) -> Iterator[bytes]:
        assert self.seen is not None
        if not self.number:
            yield message("farm", self._farm())
        text = self.seen.since(self.version)
        self.version = self.seen.version
        yield message("overview", text)

    def chosen(self, *, whole: bool) -> Iterator[bytes]:
        if self.station is not None and self.viewer is not None:
            if self.number % DRIVE_EVERY == 0:
                yield message("drive", self.context.view(self.station))
            yield message("signals", self.viewer.fresh(self.context.now()))
        yield from self.followed.messages(whole=whole)
        self.number += 1

    def _farm(self) -> dict[str, Any]:
        core = self.context.core
        models = {station.model.name: station.model for station in core.axes}
        return {
            "farm": core.name,
            "link": core.link.kind,
            "parent": interface_below(core.link),
            "drives": len(core.axes),
            "writes": self.writes,
            "lines": {name: {"way": line.way, "where": line.where} for name, line in core.lines.items()},
            "faults": {
                name: {number: [fault.label, fault.name] for number, fault in model.faults.items()}
                for name, model in models.items()
            },
        }
