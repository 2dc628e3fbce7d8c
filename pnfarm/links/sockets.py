"""What carries the streams and datagrams of stations with addresses of their own (:mod:`pnfarm.wire.endpoint`).

A link that can has one as ``sockets``: the kernel's (:mod:`pnfarm.links.kernel.sockets`), or that of the switch in
memory (:mod:`pnfarm.links.memory_sockets`).  Everything is bounded; what exceeds a bound is closed and counted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeAlias

from pnfarm.links.base import unwrap

if TYPE_CHECKING:
    from collections.abc import Callable
    from ipaddress import IPv4Address

    from pnfarm.links.base import Link
    from pnfarm.wire.endpoint import Peer, Services, SocketAction, SocketEvent

__all__ = ["MOST_OCTETS", "MOST_STREAMS", "SocketCarrier", "SocketUser", "sockets_of"]

#: Streams of all stations of a link.
MOST_STREAMS = 4096
#: Octets that wait for one peer; a slower reader loses its stream.
MOST_OCTETS = 256 * 1024

#: ``user(event, now)``: called in the event loop.
SocketUser: TypeAlias = "Callable[[SocketEvent, int], None]"


class SocketCarrier(Protocol):
    """Carries streams and datagrams for the ports of one link."""

    @property
    def answers_arp(self) -> bool:
        """Whether ARP requests for the addresses are answered here."""

    def set_user(self, user: SocketUser) -> None:
        """Set the receiver of what arrives."""

    def serve(self, port: int, services: Services) -> None:
        """Give the port its address and open what it listens to; what it had before is withdrawn.

        Raises :class:`~pnfarm.errors.EnvironmentError_` where the machine cannot.
        """

    def withdraw(self, port: int) -> None:
        """Take address and sockets away at once and in silence, as if the supply were gone: the peers get no notice."""

    def connect(self, port: int, peer: Peer) -> int:
        """Begin to open a stream from the port's address; it is reported as opened, as closed, or never answered."""

    def refuse(self, port: int, *, refused: bool) -> None:
        """Refuse every further stream of a port that serves, or take them again; those that are open stay.

        Raises :class:`~pnfarm.errors.EnvironmentError_` where the machine cannot listen again.
        """

    def serves(self, port: int) -> bool:
        """Whether the port has its address."""

    def act(self, port: int, action: SocketAction) -> None:
        """Send or close; never blocks, never raises: what cannot be sent is counted."""

    def join(self, port: int, group: IPv4Address) -> None:
        """Let frames to a multicast group pass to the port, until :meth:`leave` or the port is withdrawn.

        Never raises: what the machine refuses is counted.
        """

    def leave(self, port: int, group: IPv4Address) -> None:
        """Undo :meth:`join`; does nothing where the port has not joined."""

    def next_hop(self, port: int, address: IPv4Address) -> bytes | None:
        """The MAC address to which frames for ``address`` go: the station's or a router's; None: not known yet."""


def sockets_of(link: Link) -> SocketCarrier | None:
    """The carrier of a link; None for a kind of link that has none."""
    carrier: SocketCarrier | None = getattr(unwrap(link), "sockets", None)
    return carrier
