"""Hardware addresses of drives, changed and restored while the farm runs.

A drive with another address is another network adapter: it goes off, its port gets the address, it boots.  In memory
the port changes at once.  Elsewhere a task of the running event loop asks the link, which takes milliseconds, and the
farm's runtime calls :meth:`Addresses.handle_timeout` until it is done, also when the injection has ended meanwhile.
The interfaces of a farm that is killed are made again, with the addresses of the farm file, by the next start.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.errors import InternalError, PnfarmError
from pnfarm.faults.effects.carrier import AGAIN_SECONDS
from pnfarm.links.base import unwrap
from pnfarm.links.memory import MemoryLink, at_once

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.links.base import Link

__all__ = ["Addresses"]

#: How often a change that the link has not finished is checked.
_LOOK_NS = 2_000_000


@dataclass(slots=True, eq=False)
class _Address:
    """One port's: ``own`` is the drive's, ``wanted`` those of injections, the latest one counts."""

    drive: str
    own: bytes
    off: Callable[[int], None]
    on: Callable[[bytes, int], None]
    linked: bytes
    applied: bytes
    wanted: list[bytes] = field(default_factory=list)
    due: int = 0
    failure: str = ""
    told: bool = False
    task: asyncio.Task[None] | None = None

    @property
    def target(self) -> bytes:
        return self.wanted[-1] if self.wanted else self.own


class Addresses:
    """The addresses of a farm's ports.  ``failed(drive, reason)`` is called when an address cannot be restored."""

    def __init__(self, link: Link, failed: Callable[[str, str], None]) -> None:
        self._link = link
        self._failed = failed
        self._ports: dict[int, _Address] = {}
        #: Ports whose change is under way: asked for at each frame of the farm.
        self._under_way: set[int] = set()

    def add(
        self, port: int, drive: str, mac: bytes, off: Callable[[int], None], on: Callable[[bytes, int], None]
    ) -> None:
        """A drive's port.  ``off(now)`` takes its supply away; ``on(mac, now)`` boots it with an address."""
        self._ports[port] = _Address(drive, mac, off, on, mac, mac)

    def refusal(self, port: int) -> str:
        """Why this port keeps its address; empty when it can have another one."""
        if unwrap(self._link).kind == "interface":
            return f"the interface of {self._ports[port].drive} is not the farm's, so its MAC address stays as it is"
        return ""

    def user_of(self, mac: bytes) -> str:
        """The drive that has this address, or is to have it; empty for none."""
        for known in self._ports.values():
            if mac in {known.own, known.linked, known.applied, *known.wanted}:
                return known.drive
        return ""

    def of(self, port: int) -> bytes:
        """The address that the drive has now."""
        return self._ports[port].applied

    def failure(self, port: int) -> str:
        """Why the link refused the latest address, empty unless it did."""
        return self._ports[port].failure

    def in_force(self, port: int) -> list[object]:
        """Addresses of injections, and a change that is not finished."""
        known = self._ports[port]
        return [*known.wanted, *(["under way"] if port in self._under_way else [])]

    def change(self, port: int, mac: bytes, now: int) -> None:
        """Let the drive have another address, until :meth:`restore` with the same one."""
        self._ports[port].wanted.append(mac)
        self._follow(port, now)

    def restore(self, port: int, mac: bytes, now: int) -> None:
        """Undo one :meth:`change`."""
        self._ports[port].wanted.remove(mac)
        self._follow(port, now)

    def _follow(self, port: int, now: int) -> None:
        known = self._ports[port]
        known.failure = ""
        if port not in self._under_way:
            if known.target == known.applied:
                return
            self._under_way.add(port)
            known.off(now)
        known.due = now + _LOOK_NS
        if isinstance(unwrap(self._link), MemoryLink):
            self._change_now(port, known)
            self._look(port, now)
        elif known.task is None and known.linked != known.target:
            known.task = asyncio.get_running_loop().create_task(self._change(port, known))

    def _change_now(self, port: int, known: _Address) -> None:
        blocked = InternalError("a memory link blocked when an address changed")
        at_once(self._link.set_mac(port, known.target), blocked)
        known.linked = known.target

    async def _change(self, port: int, known: _Address) -> None:
        try:
            while (wanted := known.target) != known.linked:
                try:
                    await self._link.set_mac(port, wanted)
                except (PnfarmError, OSError) as exc:
                    # tried again: the drive must get its own address back
                    if known.wanted:
                        known.failure = str(exc)
                    elif not known.told:
                        known.told = True
                        self._failed(known.drive, str(exc))
                    await asyncio.sleep(AGAIN_SECONDS)
                else:
                    known.linked = wanted
                    known.failure, known.told = "", False
        finally:
            known.task = None

    # called by the farm's runtime

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""
        return min((self._ports[port].due for port in self._under_way), default=None)

    def handle_timeout(self, now: int) -> None:
        """Boot the drives whose change is finished."""
        for port in sorted(self._under_way):
            if self._ports[port].due <= now:
                self._look(port, now)

    def _look(self, port: int, now: int) -> None:
        known = self._ports[port]
        if known.linked == known.target:
            self._under_way.discard(port)
            known.applied = known.linked
            known.on(known.applied, now)
        else:
            known.due = now + _LOOK_NS
