"""A link that is silent while its farm has no right to speak: whatever the event loop sends passes here."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.links.base import Link, LinkCounters, Port, PortSpec, Receiver

__all__ = ["MutedLink"]


class MutedLink:
    """``inner``, as long as ``may_speak()`` says so at the moment of each frame; others are counted as dropped."""

    def __init__(self, inner: Link, may_speak: Callable[[], bool]) -> None:
        self.inner = inner
        self._may_speak = may_speak

    @property
    def kind(self) -> str:
        return self.inner.kind

    @property
    def counters(self) -> LinkCounters:
        return self.inner.counters

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        return await self.inner.open(wanted)

    async def close(self) -> None:
        await self.inner.close()

    def send(self, port_index: int, frame: bytes) -> None:
        if self._may_speak():
            self.inner.send(port_index, frame)
        else:
            self.inner.counters.dropped["no-lease"] += 1

    def set_receiver(self, receiver: Receiver) -> None:
        self.inner.set_receiver(receiver)

    async def set_carrier(self, port_index: int, up: bool) -> None:
        await self.inner.set_carrier(port_index, up)

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        await self.inner.set_mac(port_index, mac)
