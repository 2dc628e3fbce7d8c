"""The farm's event log as server-sent events (WHATWG HTML, 9.2): one message for each entry, its sequence number as id.

A stream reads the log by number, so a client that is slow, or that returns with ``Last-Event-ID``, gets what the log
still holds; a message of type ``gap`` gives the number of entries lost.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import anyio
import anyio.lowlevel

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from pnfarm.api.context import ApiContext

__all__ = ["event_stream", "start_of"]

#: Interval of the comments that keep an idle stream open through proxies.
ALIVE_SECONDS = 15.0
#: Entries sent in one piece.
PIECE = 64
#: Time until a browser reconnects.
RETRY_MILLISECONDS = 2000


def start_of(context: ApiContext, last_event_id: str | None) -> int:
    """The sequence number after which a stream begins: the client's, or now.

    A number beyond the end of the log is from an earlier run of the farm: then all entries are sent.
    """
    newest = context.core.log.newest
    if last_event_id is None or not (last_event_id.isascii() and last_event_id.isdigit()):
        return newest
    wanted = int(last_event_id[:20])
    return wanted if wanted <= newest else 0


async def event_stream(
    context: ApiContext, after: int, drive: str | None, *, follow: bool = True
) -> AsyncIterator[str]:
    """Messages for every entry above ``after``, of one drive or of all, until the stream is closed.

    Without ``follow`` the stream ends with the newest entry.
    """
    wake = anyio.Event()
    log = context.core.log
    newest = log.newest

    def wake_up() -> None:
        wake.set()

    unsubscribe = log.subscribe(lambda _: wake_up())
    context.streams.add(wake_up)
    try:
        yield f"retry: {RETRY_MILLISECONDS}\n\n"
        if drive is not None:
            # a drive's own ring still has entries that the farm's ring has overwritten
            oldest = next((entry.sequence for entry in log.entries(after=after, most=1)), 0)
            kept = [entry for entry in log.entries(drive, after=after) if entry.sequence < oldest]
            if kept:
                yield "".join(context.messages.of(entry) for entry in kept)
        while not context.closing:
            wake = anyio.Event()
            # the log may grow while the client reads a piece; entries it is too slow for become a gap
            entries = log.entries(after=after, most=PIECE)
            if not follow and (not entries or after >= newest):
                return
            if not entries:
                with anyio.move_on_after(ALIVE_SECONDS) as waiting:
                    await wake.wait()
                if waiting.cancelled_caught:
                    yield ": alive\n\n"
                continue
            lost = entries[0].sequence - after - 1
            if lost > 0:
                yield f"event: gap\ndata: {json.dumps({'lost': lost})}\n\n"
            after = entries[-1].sequence
            text = "".join(context.messages.of(entry) for entry in entries if drive is None or entry.drive == drive)
            if text:
                yield text
            else:
                # nothing of this drive in this piece: let other tasks run
                await anyio.lowlevel.checkpoint()
    finally:
        unsubscribe()
        context.streams.discard(wake_up)
