"""What a farm does as its lease comes and goes: it waits for it, is muted without it, and comes back.

Nothing here is needed for silence in time: the engine and the link look at the lease themselves, for each batch and
frame.  What follows is for the others: cables are pulled, so that switches and controllers see it, and the kernel
answers for no address any more.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.farm.events import (
    LeaseLost,
    LeaseRegained,
    LeaseTaken,
    LeaseWaiting,
    MemoryAway,
    MemoryBack,
)
from pnfarm.farm.lease import LeaseState, margin_ns
from pnfarm.faults.effects.wire import WIRE
from pnfarm.links.base import unwrap
from pnfarm.links.kernel.linux import PacketLink

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.engine.columns import Columns
    from pnfarm.farm.lease import LeaseChanged
    from pnfarm.farm.memory.postgres import PostgresState
    from pnfarm.faults.manager import InjectionManager
    from pnfarm.links.base import Link
    from pnfarm.station.event_log import EventLog
    from pnfarm.station.station import Station

__all__ = ["LeasedFarm", "Leaseholder"]

#: Between two checks of the lease, when nothing is new.
LOOK_SECONDS = 0.1


class LeasedFarm(Protocol):
    """What the keeper of a lease needs of its farm."""

    columns: Columns
    link: Link
    stations: list[Station]
    injections: InjectionManager
    #: Whether the drives may send at this moment; None: always.
    may_speak: Callable[[], bool] | None
    leaseholder: Leaseholder | None

    def settle(self, station: Station, now: int) -> None:
        """Let a changed station process the consequences."""


class Leaseholder:
    """Of one farm.  ``now`` is the farm's clock."""

    def __init__(self, state: PostgresState, log: EventLog, now: Callable[[], int]) -> None:
        self.state = state
        self._log = log
        self._now = now
        self._core: LeasedFarm | None = None
        self._poke: Callable[[], None] = lambda: None
        self._fail: Callable[[Exception], None] = lambda _: None
        self._loop = asyncio.get_running_loop()
        self._handle: asyncio.TimerHandle | None = None
        self._news = asyncio.Event()
        self._muted = False
        self._was_up = True
        #: The renewal for which the kernel has its addresses.
        self._renewed_ns: int | None = None
        state.news = self._told

    # -- before the start

    async def wait(self) -> None:
        """Until every drive's claim is held."""
        said: tuple[str, str] | None = None
        while True:
            self._news.clear()
            self.state.check()
            lease, other = self.state.lease, self.state.standing.waiting_for
            if lease is None or (lease.state is LeaseState.HELD and self.state.may_speak()):
                return
            if other is not None and said != (other.host, other.shard):
                said = (other.host, other.shard)
                self._log.record(self._now(), "", LeaseWaiting(*said, other.seconds))
            try:
                await asyncio.wait_for(self._news.wait(), LOOK_SECONDS)
            except TimeoutError:
                continue

    def _told(self) -> None:
        """In the thread of the memory."""
        try:
            self._loop.call_soon_threadsafe(self._look_now)
        except RuntimeError:
            # the loop is closed
            return

    def _look_now(self) -> None:
        self._news.set()
        if self._core is not None:
            self._look()

    # -- while it runs

    def start(self, core: LeasedFarm, poke: Callable[[], None], fail: Callable[[Exception], None]) -> None:
        """The drives are about to speak.

        ``poke`` lets the runtime process what was changed, ``fail`` ends the farm with what a check raised.
        """
        self._core, self._poke, self._fail = core, poke, fail
        engine = core.columns.engine[0]
        if self.state.lease is not None:

            def until(until_ns: int) -> None:
                engine.lease_until_ns = until_ns

            # at once as it is, and from now on by the thread
            with self.state.changed:
                self.state.until = until
                until(self.state.lease.until_ns or 1)
            core.may_speak = self.state.may_speak
            self._renew_addresses()
        core.leaseholder = self
        self._tick()

    def stop(self) -> None:
        """Look no more."""
        self._core = None
        self.state.attended(watched=False)
        if self._handle is not None:
            self._handle.cancel()

    def _tick(self) -> None:
        self.state.attended()
        # first: the lease is attended as long as this process runs, whatever a check finds
        self._handle = self._loop.call_later(LOOK_SECONDS, self._tick)
        self._look()

    def _look(self) -> None:
        now = self._now()
        try:
            for change in self.state.check():
                self._follow(change, now)
        except Exception as exc:  # noqa: BLE001 - as of a memory that others damaged: half of the drives would stay mute
            self._fail(exc)
        if self.state.ready is not self._was_up:
            self._was_up = self.state.ready
            event = MemoryBack() if self._was_up else MemoryAway(self.state.standing.reason)
            self._log.record(now, "", event)
        if not self._muted:
            self._renew_addresses()

    def _follow(self, change: LeaseChanged, now: int) -> None:
        match change.state:
            case LeaseState.HELD:
                self._speak(now, anew=change.anew)
            case LeaseState.LOST:
                self._log.record(now, "", LeaseLost(self.state.standing.reason))
                self._mute()
            case LeaseState.WAITING:
                other = self.state.standing.waiting_for
                host, shard = ("", "") if other is None else (other.host, other.shard)
                self._log.record(now, "", LeaseTaken(host, shard))
                self._mute()

    def _mute(self) -> None:
        if self._muted or self._core is None:
            return
        self._muted = True
        for station in self._core.stations:
            wire = self._core.injections.drive(station.configured_name).find(WIRE)
            if wire is not None:
                wire.pull_cable()

    def _speak(self, now: int, *, anew: bool) -> None:
        core = self._core
        if core is None or not self._muted:
            return
        self._muted = False
        self._log.record(now, "", LeaseRegained(anew))
        self._renew_addresses()
        for station in core.stations:
            if anew and station.powered:
                # others ran it meanwhile: it goes on with what they left in its memory
                station.power_cycle(now)
            wire = core.injections.drive(station.configured_name).find(WIRE)
            if wire is not None:
                wire.plug_cable()
            core.settle(station, now)
        self._poke()

    def _renew_addresses(self) -> None:
        """Give the kernel its addresses for as long as the lease lasts, once for each renewal.

        The kernel counts whole seconds, and takes an address away up to a second late: by then no other process has it.
        """
        lease, link = self.state.lease, None if self._core is None else unwrap(self._core.link)
        if lease is None or lease.renewed_ns == self._renewed_ns or not isinstance(link, PacketLink):
            return
        seconds = int(self.state.speaking_seconds() + margin_ns(lease.ttl_ns) / 1e9 - 1)
        if seconds > 0:
            self._renewed_ns = lease.renewed_ns
            link.sockets.set_lifetime(seconds)

    # -- to be shown

    @property
    def is_ready(self) -> bool:
        """Whether the drives may speak."""
        return self.state.may_speak()

    def as_dict(self) -> dict[str, Any]:
        """For the API."""
        state, lease = self.state, self.state.lease
        other = state.standing.waiting_for
        return {
            "memory": state.where,
            "memory_up": state.ready,
            "memory_reason": "" if state.ready else state.standing.reason,
            "lease": state.lease_state,
            "renewed_seconds_ago": state.renewed_seconds_ago(),
            "ttl_seconds": None if lease is None else lease.ttl_ns / 1e9,
            "mute_after_seconds": None if lease is None else (lease.ttl_ns - margin_ns(lease.ttl_ns)) / 1e9,
            "held_by": None if other is None else {"host": other.host, "shard": other.shard},
        }
