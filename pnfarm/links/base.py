"""Links: the ports of a farm on one medium, and the frames that pass them.

A link carries the *acyclic* frames (DCP, ARP, IPv4, alarms, LLDP) between the protocol machines and
the wire.  Cyclic frames do not pass here: on Linux interfaces the compiled engine reads and writes its
own packet socket (:meth:`EngineLink.engine_socket`), in memory it copies them itself.  The one
exception is a TAP, see :mod:`pnfarm.links.tap`.

Wrappers (:mod:`pnfarm.links.capture.pcap`, :mod:`pnfarm.faults.gate.gate`) are links around a link; :func:`unwrap`
finds the innermost.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, TypeAlias, runtime_checkable

if TYPE_CHECKING:
    import socket

__all__ = [
    "ETHERNET",
    "MULTICAST_DCP_IDENTIFY",
    "MULTICAST_LLDP",
    "Audience",
    "Clock",
    "EngineLink",
    "Link",
    "LinkCounters",
    "Port",
    "PortSpec",
    "Receiver",
    "interface_below",
    "unwrap",
]


#: IEC 61158-6-10: destination of DCP Identify requests.
MULTICAST_DCP_IDENTIFY = bytes.fromhex("010ecf000000")
#: IEEE 802.1AB: nearest bridge.
MULTICAST_LLDP = bytes.fromhex("0180c200000e")

#: ``receiver(port_index, frame, now_ns)``: one whole Ethernet frame without FCS.
Receiver: TypeAlias = Callable[[int, bytes, int], None]
#: Ports that a group-addressed frame can concern, None for any.
Audience: TypeAlias = "Callable[[bytes], Collection[int] | None]"
#: LINKTYPE_ETHERNET of tcpdump.org: frames of a network, in a capture.
ETHERNET = 1
#: Nanoseconds of the farm's clock.
Clock: TypeAlias = Callable[[], int]


@dataclass(frozen=True, slots=True)
class PortSpec:
    """A requested port.  ``mac`` has 6 octets; an :class:`~pnfarm.links.interface.InterfaceLink` ignores it.

    ``kernel``: the station has sockets of the kernel's, which answers for its address; else it is kept silent there.
    ``line``: the serial line that it shares with all stations of that name, where its bus is one; it then has no
    address.  ``link_type``: that of its frames in a capture.
    """

    station: str
    mac: bytes
    kernel: bool = False
    line: str = ""
    link_type: int = ETHERNET


@dataclass(frozen=True, slots=True)
class Port:
    """One attachment of a station.  ``index`` is the kernel's interface index, or the port number in memory.

    ``baud``: the rate of its serial line, 0 for a network.  ``rate``: the present one, where it may change.
    ``link_type``: as in its specification.
    """

    name: str
    index: int
    mac: bytes
    baud: int = 0
    link_type: int = ETHERNET
    rate: Callable[[], int] | None = None


@dataclass(slots=True)
class LinkCounters:
    """Acyclic frames of one link since it was made; read, never reset.

    Reasons in ``dropped``: ``interface-down``, ``queue-full``, ``too-long``, ``unknown-port``,
    ``cable-pulled``, ``other-vlan``, ``other-address``, ``own-lldp`` (of a drive of the same link),
    ``receive-overflow``, ``refused`` (any other error of the kernel's).
    """

    received: int = 0
    sent: int = 0
    dropped: Counter[str] = field(default_factory=Counter)

    def as_dict(self) -> dict[str, int]:
        """Flat copy for the API and the metrics: ``received``, ``sent``, ``dropped_<reason>``."""
        return {
            "received": self.received,
            "sent": self.sent,
            **{f"dropped_{reason}": count for reason, count in sorted(self.dropped.items())},
        }


@runtime_checkable
class Link(Protocol):
    """The interface of every link and every wrapper."""

    @property
    def kind(self) -> str:
        """Keyword of the farm file: ``macvlan``, ``veth``, ``tap``, ``memory``, ``interface``."""

    @property
    def counters(self) -> LinkCounters:
        """Snapshot of the counters."""

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        """Make one port for each spec, in their order; on any failure nothing is left behind.

        Raises :class:`~pnfarm.errors.EnvironmentError_` where the machine cannot.
        """

    async def close(self) -> None:
        """Remove what :meth:`open` made.  Closing twice, or closing a link that was never opened, does nothing."""

    def send(self, port_index: int, frame: bytes) -> None:
        """Hand one whole frame to the port; never blocks, never raises: frames that cannot be sent are counted."""

    def set_receiver(self, receiver: Receiver) -> None:
        """Set the receiver of all frames; it is called in the event loop."""

    async def set_carrier(self, port_index: int, up: bool) -> None:
        """Pull (False) or plug (True) the port's cable.  Address and multicast memberships stay."""

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        """Give the port another address; frames to the old one no longer arrive."""


@runtime_checkable
class EngineLink(Link, Protocol):
    """A link whose cyclic frames the engine exchanges through its own packet socket."""

    def engine_socket(self) -> socket.socket:
        """A non-blocking AF_PACKET socket of all ports: it receives cyclic frames (0x8892, frame id < 0xFC00) only.

        Not bound to an interface: the index travels in each message's ``sockaddr_ll``.  The caller owns and closes it.
        """


def unwrap(link: Link) -> Link:
    """The innermost link below all wrappers."""
    inner = getattr(link, "inner", None)
    while inner is not None:
        link = inner
        inner = getattr(link, "inner", None)
    return link


def interface_below(link: Link) -> str | None:
    """The interface of this machine that a link's drives are attached to: a macvlan's parent, or a bridge."""
    inner = unwrap(link)
    found = getattr(inner, "parent", None) or getattr(inner, "bridge", None)
    return None if found is None else str(found)
