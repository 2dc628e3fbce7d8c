"""One end of the wire, a farm or a controller, as a runtime drives it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    from pnfarm.engine.columns import Columns
    from pnfarm.links.base import Link
    from pnfarm.wire.endpoint import SocketEvent

__all__ = ["LineNode", "Node", "SocketNode"]


class Node(Protocol):
    """One end of the wire, as a runtime drives it."""

    columns: Columns
    link: Link

    def receive(self, port: int, frame: bytes, now: int) -> None:
        """One acyclic frame."""

    def service(self, now: int) -> None:
        """Handle the engine's events and the timers that are due."""

    def next_deadline(self) -> int | None:
        """When :meth:`service` is due at the latest."""


@runtime_checkable
class LineNode(Protocol):
    """A node with stations on serial lines."""

    def poll(self, octets: bytes, now: int) -> tuple[int, bytes] | None:
        """Port and answer of the one that these octets poll, None where more is to be done: nothing was done then."""

    def answer(self, octets: Any, length: int, now: int) -> tuple[int, memoryview] | None:
        """The same for a poll like the one before it, of which so many octets of an array count."""


@runtime_checkable
class SocketNode(Protocol):
    """A node that has streams and datagrams, too."""

    def socket_event(self, event: SocketEvent, now: int) -> None:
        """Something of a stream, or a datagram."""
