"""duplicate-ip: a second station has the drive's IP address."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.second_station import MAC, SecondHost
from pnfarm.faults.kind import InjectionKind, ParamSpec

__all__ = ["KIND"]

#: Shortest time between two announcements, ns.
_SHORTEST_NS = 10_000_000


KIND = InjectionKind(
    "duplicate-ip",
    "link",
    "A second station at the drive's port has the drive's IP address: it announces it by ARP, answers ARP and "
    "ping, and defends it as RFC 5227 says.  RPC to its MAC address is not answered; an existing connection "
    "continues, because cyclic frames need no IP address.",
    "a frame of the second station",
    SecondHost,
    {"mac": MAC, "every": ParamSpec("duration", "From one announcement to the next.", default="10s", low=_SHORTEST_NS)},
    takes=frozenset({"for"}),
    place=60,
    wire="ARP from two MAC addresses for one IP address: announcements of the second station, two answers to each "
    "request, and the drive's own announcement in defence.",
    reports="An existing connection continues. Whoever learns the second MAC address by ARP reaches no drive: records "
    "and new connections time out as long as it is in the ARP table (assumed). The drive's answer to DCP Get says that "
    "its address is in conflict.",
)
