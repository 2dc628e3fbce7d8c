"""The merged log as server-sent events: the farm's stream, with a position as id (:mod:`pnfarm.hub.log`)."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import anyio
import anyio.lowlevel

from pnfarm.api.events import ALIVE_SECONDS, PIECE, RETRY_MILLISECONDS
from pnfarm.hub.log import format_position, parse_position

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from pnfarm.hub.hub import Hub

__all__ = ["event_stream"]


def _gap(lost: int) -> str:
    return f"event: gap\ndata: {json.dumps({'lost': lost})}\n\n"


async def event_stream(hub: Hub, begin: str | None, drive: str | None, *, follow: bool = True) -> AsyncIterator[str]:
    """Messages for every entry behind ``begin``: a position, a sequence number of this hub, or None: from now on."""
    log = hub.log
    wake = anyio.Event()

    def wake_up() -> None:
        wake.set()

    known = parse_position(begin) if begin is not None else None
    after = log.newest
    if known is not None:
        after = 0
    elif begin is not None and begin.isascii() and begin.isdigit():
        # a number beyond the end is of an earlier run of the hub
        after = int(begin[:20]) if int(begin[:20]) <= log.newest else 0
    position = log.position(after)
    newest = log.newest
    unsubscribe = log.subscribe(lambda _: wake_up())
    hub.streams.add(wake_up)
    try:
        yield f"retry: {RETRY_MILLISECONDS}\n\n"
        if known is not None and (lost := log.lost(known)):
            yield _gap(lost)
        while not hub.closing:
            wake = anyio.Event()
            entries = log.entries(after=after, most=PIECE)
            if not follow and (not entries or after >= newest):
                return
            if not entries:
                with anyio.move_on_after(ALIVE_SECONDS) as waiting:
                    await wake.wait()
                if waiting.cancelled_caught:
                    yield ": alive\n\n"
                continue
            text = ""
            lost = entries[0].sequence - after - 1
            if lost > 0 and known is None:
                text += _gap(lost)
            for entry in entries:
                if entry.lost and known is None:
                    text += _gap(entry.lost)
                position[entry.origin] = entry.number
                if known is not None and entry.number <= known.get(entry.origin, 0):
                    continue
                if drive is None or entry.drive == drive:
                    data = json.dumps(entry.as_dict(), default=str)
                    text += f"id: {format_position(position)}\ndata: {data}\n\n"
            after = entries[-1].sequence
            if after >= newest:
                # from here on everything is new to this client
                known = None
            if text:
                yield text
            else:
                await anyio.lowlevel.checkpoint()
    finally:
        unsubscribe()
        hub.streams.discard(wake_up)
