"""A link around a link: hands on what it does not change."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.links.base import Link, LinkCounters, Port, PortSpec, Receiver

__all__ = ["LinkWrapper"]


class LinkWrapper:
    """``inner``, as it is."""

    def __init__(self, inner: Link) -> None:
        self.inner = inner

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
        self.inner.send(port_index, frame)

    def set_receiver(self, receiver: Receiver) -> None:
        self.inner.set_receiver(receiver)

    async def set_carrier(self, port_index: int, up: bool) -> None:
        await self.inner.set_carrier(port_index, up)

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        await self.inner.set_mac(port_index, mac)
