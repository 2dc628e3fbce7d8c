"""An event log as server-sent events (WHATWG HTML, 9.2): one message for each entry, its position as id.

A stream reads the log by number, so a client that is slow, or that returns with ``Last-Event-ID``, gets what the log
still holds; a message of type ``gap`` gives the number of entries lost.

A *position* has the last number of each run that a client has seen, ``1f3c9a02-17.77d0a1b4-203``: a farm's has one run,
a hub's those of its shards.  Numbers start again with each run, so that a number alone says nothing after a restart.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any, Protocol

import anyio
import anyio.lowlevel

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence

    from pnfarm.api.context import ApiContext, Context
    from pnfarm.station.event_log import LogEntry

__all__ = ["Log", "Reader", "event_stream", "format_position", "gap", "log_stream", "parse_position", "start_of"]

#: Interval of the comments that keep an idle stream open through proxies.
ALIVE_SECONDS = 15.0
#: Entries sent in one piece.
PIECE = 64
#: Time until a browser reconnects.
RETRY_MILLISECONDS = 2000
#: Characters of a position: 300 runs.
MOST_POSITION = 8_192
_PART = r"[0-9a-f]{8}-[0-9]{1,15}"
_POSITION = re.compile(rf"{_PART}(?:\.{_PART})*")


class Log(Protocol):
    """A farm's log, or a hub's."""

    @property
    def newest(self) -> int: ...

    def entries(self, *, after: int = 0, most: int | None = None) -> Sequence[Any]: ...

    def follow(self, follower: Callable[[], None], /) -> Callable[[], None]: ...


class Reader(Protocol):
    """What one client gets: it has seen the log up to the sequence number ``after``."""

    after: int

    def first(self) -> str:
        """What comes before all entries."""

    def text(self, entries: Sequence[Any], lost: int) -> str:
        """The messages of these entries, before which so many are lost."""


def gap(lost: int) -> str:
    return f"event: gap\ndata: {json.dumps({'lost': lost})}\n\n"


def format_position(position: Mapping[str, int]) -> str:
    return ".".join(f"{run}-{number}" for run, number in sorted(position.items()))


def parse_position(text: str) -> dict[str, int] | None:
    """None for a text that is no position."""
    if len(text) > MOST_POSITION or not _POSITION.fullmatch(text):
        return None
    return {part[:8]: int(part[9:]) for part in text.split(".")}


def start_of(log: Log, run: str, last_event_id: str | None) -> int:
    """The sequence number after which a stream of this ``run`` begins: the client's, or now.

    A position of an earlier run, and a number beyond the end of the log: then all entries are sent.
    """
    newest = log.newest
    if last_event_id is None:
        return newest
    if (position := parse_position(last_event_id)) is not None:
        wanted = position.get(run, 0)
    elif last_event_id.isascii() and last_event_id.isdigit():
        wanted = int(last_event_id[:20])
    else:
        return newest
    return wanted if wanted <= newest else 0


async def log_stream(context: Context, log: Log, reader: Reader, *, follow: bool = True) -> AsyncIterator[str]:
    """Messages for every entry above ``reader.after`` until the stream is closed.

    Without ``follow`` the stream ends with the newest entry.
    """
    wake = anyio.Event()
    newest = log.newest

    def wake_up() -> None:
        wake.set()

    unfollow = log.follow(wake_up)
    context.streams.add(wake_up)
    try:
        yield f"retry: {RETRY_MILLISECONDS}\n\n"
        if first := reader.first():
            yield first
        while not context.closing:
            wake = anyio.Event()
            # the log may grow while the client reads a piece; entries it is too slow for become a gap
            entries = log.entries(after=reader.after, most=PIECE)
            if not follow and (not entries or reader.after >= newest):
                return
            if not entries:
                with anyio.move_on_after(ALIVE_SECONDS) as waiting:
                    await wake.wait()
                if waiting.cancelled_caught:
                    yield ": alive\n\n"
                continue
            text = reader.text(entries, entries[0].sequence - reader.after - 1)
            reader.after = entries[-1].sequence
            if text:
                yield text
            else:
                # nothing for this client in this piece: let other tasks run
                await anyio.lowlevel.checkpoint()
    finally:
        unfollow()
        context.streams.discard(wake_up)


class _FarmReader:
    """Of a farm's log: entries of one drive or of all."""

    def __init__(self, context: ApiContext, after: int, drive: str | None) -> None:
        self.after = after
        self._context = context
        self._drive = drive

    def first(self) -> str:
        if self._drive is None:
            return ""
        # a drive's own ring still has entries that the farm's ring has overwritten
        log = self._context.core.log
        oldest = next((entry.sequence for entry in log.entries(after=self.after, most=1)), 0)
        return self._messages(entry for entry in log.entries(self._drive, after=self.after) if entry.sequence < oldest)

    def text(self, entries: Sequence[LogEntry], lost: int) -> str:
        shown = (entry for entry in entries if self._drive is None or entry.drive == self._drive)
        return (gap(lost) if lost > 0 else "") + self._messages(shown)

    def _messages(self, entries: Iterable[LogEntry]) -> str:
        return "".join(self._context.messages.of(entry) for entry in entries)


def event_stream(context: ApiContext, after: int, drive: str | None, *, follow: bool = True) -> AsyncIterator[str]:
    """A farm's log above ``after``, of one drive or of all."""
    return log_stream(context, context.core.log, _FarmReader(context, after, drive), follow=follow)
