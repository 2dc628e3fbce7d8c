"""A farm on a memory link in real time: a virtual world whose clock follows the machine's.

Drives and controller share the world's clock.  When the machine stalls, time stops for both, and up to
:data:`MOST_BEHIND_NS` is made up for afterwards; what is beyond that is left out of the farm's time.  So a busy machine
makes no watchdog expire, but the farm's time may run slower than the wall's.
"""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING

from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pnfarm.engine.realtime import RealTimeEngine
    from pnfarm.farm.virtual import VirtualWorld

__all__ = ["MemoryDriver"]

#: Between two steps of the world: what a client changes is in the next telegram after at most this.
PACE_SECONDS = 0.002
#: Time that is made up for after a stall.
MOST_BEHIND_NS = 50_000_000


class MemoryDriver:
    """Runs a world until :meth:`close`, as :class:`~pnfarm.farm.realtime.RealTimeDriver` runs a node."""

    #: A memory link has no engine of its own: the world ticks in the event loop.
    engine: RealTimeEngine | None = None

    def __init__(self, world: VirtualWorld) -> None:
        self._world = world
        self._handle: asyncio.TimerHandle | None = None
        self._failed: asyncio.Future[None] | None = None
        #: The world's time less the machine's.
        self._offset_ns = 0
        self._busy = False

    async def start(self) -> None:
        """Let the world run from now on."""
        self._failed = asyncio.get_running_loop().create_future()
        self._offset_ns = self._world.now - time.monotonic_ns()
        self._step()

    async def wait(self) -> None:
        if self._failed is None:
            raise InternalError("the driver was not started")
        await asyncio.shield(self._failed)

    async def close(self) -> None:
        """Stop the time; closing twice does nothing."""
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None
        if self._failed is not None and not self._failed.done():
            self._failed.cancel()

    def now(self) -> int:
        """The farm's time, ns, with the world run up to it."""
        self._catch_up()
        return self._world.now

    def poke(self) -> None:
        """The farm was changed from outside: process the consequences now."""
        self._run(0)

    def fail(self, exc: Exception) -> None:
        """Something beside the farm failed: :meth:`wait` raises it."""
        if self._failed is not None and not self._failed.done():
            self._failed.set_exception(exc)

    def _step(self) -> None:
        self._catch_up()
        self._handle = asyncio.get_running_loop().call_later(PACE_SECONDS, self._step)

    def _catch_up(self) -> None:
        behind = time.monotonic_ns() + self._offset_ns - self._world.now
        if behind > MOST_BEHIND_NS:
            self._offset_ns -= behind - MOST_BEHIND_NS
            behind = MOST_BEHIND_NS
        if behind > 0:
            self._run(behind)

    def _run(self, duration_ns: int) -> None:
        if self._busy or self._failed is None or self._failed.done():
            # called by what the world itself does, or by someone who has not noticed that it failed
            return
        self._busy = True
        try:
            self._world.run(duration_ns / 1e9)
        except Exception as exc:  # noqa: BLE001 - carried to wait(), which ends the farm with it
            self.fail(exc)
        finally:
            self._busy = False
