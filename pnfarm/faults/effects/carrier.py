"""Cables, pulled and plugged."""

from __future__ import annotations

import asyncio
from collections import Counter
from typing import TYPE_CHECKING

from pnfarm.errors import InternalError, PnfarmError
from pnfarm.links.base import unwrap
from pnfarm.links.memory import MemoryLink, at_once

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.links.base import Link

__all__ = ["Carriers"]


#: Pause before a change that the link refused is tried again.
AGAIN_SECONDS = 0.5


class Carriers:
    """Pulls and plugs cables; several injections may hold one cable out.

    In memory this takes effect at once. Elsewhere a task of the running event loop does it, one per port at a
    time; :meth:`is_off` is the confirmed state.  ``failed(drive, reason)`` is called
    when the link refuses a change.
    """

    def __init__(self, link: Link, failed: Callable[[str, str], None]) -> None:
        self._link = link
        self._failed = failed
        self._pulled: Counter[int] = Counter()
        self._off: dict[int, bool] = {}
        self._tasks: dict[int, asyncio.Task[None]] = {}

    def pull(self, port: int, drive: str) -> None:
        self._pulled[port] += 1
        self._follow(port, drive)

    def plug(self, port: int, drive: str) -> None:
        self._pulled[port] -= 1
        self._follow(port, drive)

    def is_pulled(self, port: int) -> bool:
        """The requested state."""
        return self._pulled[port] > 0

    def is_off(self, port: int) -> bool:
        """The state that the link has confirmed."""
        return self._off.get(port, False)

    def _follow(self, port: int, drive: str) -> None:
        if isinstance(unwrap(self._link), MemoryLink):
            self._run_now(port)
        elif port not in self._tasks:
            self._tasks[port] = asyncio.get_running_loop().create_task(self._run(port, drive))

    def _run_now(self, port: int) -> None:
        wanted = self._pulled[port] > 0
        blocked = InternalError("a memory link blocked when its carrier changed")
        at_once(self._link.set_carrier(port, not wanted), blocked)
        self._off[port] = wanted

    async def _run(self, port: int, drive: str) -> None:
        told = False
        try:
            while (wanted := self._pulled[port] > 0) != self.is_off(port):
                try:
                    await self._link.set_carrier(port, not wanted)
                except (PnfarmError, OSError) as exc:
                    # tried again: a temporary shortage must not keep a drive off the wire for ever
                    if not told:
                        self._failed(drive, str(exc))
                        told = True
                    await asyncio.sleep(AGAIN_SECONDS)
                else:
                    self._off[port] = wanted
        finally:
            del self._tasks[port]
