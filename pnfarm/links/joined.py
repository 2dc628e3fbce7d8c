"""A network and serial lines as one link: stations of buses with a line beside those with interfaces."""

from __future__ import annotations

from contextlib import AsyncExitStack
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.links.serial.link import SerialLink
from pnfarm.links.wrapper import LinkWrapper

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from pnfarm.links.base import Link, Port, PortSpec, Receiver

__all__ = ["JoinedLink", "lines_of"]


class JoinedLink(LinkWrapper):
    """``inner`` for stations with interfaces; ``lines`` by the name of the line that a port is asked for."""

    def __init__(self, inner: Link, lines: Mapping[str, SerialLink]) -> None:
        super().__init__(inner)
        self.lines = dict(lines)
        self._on_line: dict[int, SerialLink] = {}

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        missing = sorted({spec.line for spec in wanted} - self.lines.keys() - {""})
        if missing:
            raise ConfigError(
                f"drives on {missing[0]} have a serial line, and the file names none: "
                f"`link: {{kind: {self.kind}, ..., lines: {{{missing[0]}: {{pty: auto}}}}}}`"
            )
        try:
            plain = await self.inner.open([spec for spec in wanted if not spec.line])
            found = {"": iter(plain)}
            for name, link in self.lines.items():
                ports = await link.open([spec for spec in wanted if spec.line == name])
                self._on_line |= {port.index: link for port in ports}
                found[name] = iter(ports)
        except BaseException:
            await self.close()
            raise
        return [next(found[spec.line]) for spec in wanted]

    async def close(self) -> None:
        # each is closed, whatever the others raise
        async with AsyncExitStack() as stack:
            stack.push_async_callback(self.inner.close)
            for link in self.lines.values():
                stack.push_async_callback(link.close)

    def send(self, port_index: int, frame: bytes) -> None:
        self._on_line.get(port_index, self.inner).send(port_index, frame)

    def set_receiver(self, receiver: Receiver) -> None:
        self.inner.set_receiver(receiver)
        for link in self.lines.values():
            link.set_receiver(receiver)

    def set_line_audience(self, audience: Callable[[bytes], Collection[int] | None]) -> None:
        """See :meth:`SerialLink.set_line_audience`; there is one bus with a line."""
        for link in self.lines.values():
            link.set_line_audience(audience)

    async def set_carrier(self, port_index: int, up: bool) -> None:
        await self._on_line.get(port_index, self.inner).set_carrier(port_index, up)

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        await self._on_line.get(port_index, self.inner).set_mac(port_index, mac)


def lines_of(link: Link) -> dict[str, SerialLink]:
    """The serial lines of a link, by name, below all wrappers."""
    found: object = link
    while found is not None:
        if isinstance(found, JoinedLink):
            return found.lines
        if isinstance(found, SerialLink):
            return {"": found}
        found = getattr(found, "inner", None)
    return {}
