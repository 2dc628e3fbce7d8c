"""Streams and datagrams of a station with an IPv4 address of its own: what it offers, what arrives, what it sends.

Neutral between what carries them (sockets of the kernel, a switch in memory) and what speaks over them.  A *port* is
the link's number of a station's attachment, a *service* the number of a TCP or UDP port, a *stream* a number that the
carrier gives each connection and never uses again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from ipaddress import IPv4Address, IPv4Interface

__all__ = [
    "Datagram", "DatagramReceived", "Peer", "Services", "SocketAction", "SocketEvent", "StreamClosed", "StreamData",
    "StreamEnd", "StreamOpened", "StreamReceived",
]  # fmt: skip

#: IPv4 address and port of the other side.
Peer: TypeAlias = "tuple[IPv4Address, int]"


@dataclass(frozen=True, slots=True)
class Services:
    """A station's address and what it listens to.

    ``streams`` and ``datagrams``: TCP and UDP ports; ``silent``: UDP ports whose datagrams something else receives
    (the engine), so that the kernel does not call them unreachable.  ``sessions``: streams open at once; one more is
    closed at once.
    """

    address: IPv4Interface
    gateway: IPv4Address | None = None
    streams: tuple[int, ...] = ()
    datagrams: tuple[int, ...] = ()
    silent: tuple[int, ...] = ()
    sessions: int = 64


@dataclass(frozen=True, slots=True)
class StreamOpened:
    """A peer opened a stream to ``service``, or one that the station asked for is open (``service`` is 0)."""

    port: int
    stream: int
    service: int
    peer: Peer


@dataclass(frozen=True, slots=True)
class StreamReceived:
    """Octets of a stream, in order."""

    port: int
    stream: int
    data: bytes


@dataclass(frozen=True, slots=True)
class StreamClosed:
    """The peer closed a stream, refused it, or it broke; the number means nothing any more."""

    port: int
    stream: int


@dataclass(frozen=True, slots=True)
class DatagramReceived:
    """One datagram to ``service``; ``broadcast`` if it was not for this station alone."""

    port: int
    service: int
    peer: Peer
    data: bytes
    broadcast: bool = False


@dataclass(frozen=True, slots=True)
class StreamData:
    """Send octets on a stream; nothing happens where it is closed."""

    stream: int
    data: bytes


@dataclass(frozen=True, slots=True)
class StreamEnd:
    """Close a stream after the octets given so far."""

    stream: int


@dataclass(frozen=True, slots=True)
class Datagram:
    """Send a datagram from ``service``; the peer's address may be a broadcast address."""

    service: int
    peer: Peer
    data: bytes


SocketEvent: TypeAlias = "StreamOpened | StreamReceived | StreamClosed | DatagramReceived"
SocketAction: TypeAlias = "StreamData | StreamEnd | Datagram"
