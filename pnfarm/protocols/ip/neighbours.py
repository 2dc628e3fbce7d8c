"""MAC addresses of IPv4 neighbours: a bounded table with ageing entries."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ipaddress import IPv4Address

__all__ = ["CAPACITY", "LIFETIME_NS", "NeighbourTable"]

#: Default number of neighbours; the one not refreshed for the longest time is removed first.
CAPACITY = 256
#: Lifetime of an entry without a frame of the neighbour.
LIFETIME_NS = 60 * 10**9


class NeighbourTable:
    """IPv4 address to MAC address. Time is in nanoseconds and only moves forward."""

    __slots__ = ("_capacity", "_entries")

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._capacity = capacity
        self._entries: dict[IPv4Address, tuple[bytes, int]] = {}  # in the order of their last refresh

    def __len__(self) -> int:
        return len(self._entries)

    def learn(self, ip: IPv4Address, mac: bytes, now: int) -> None:
        """Add or refresh a neighbour."""
        self._entries.pop(ip, None)
        if len(self._entries) >= self._capacity:
            del self._entries[next(iter(self._entries))]
        self._entries[ip] = (mac, now)

    def refresh(self, ip: IPv4Address, mac: bytes, now: int) -> None:
        """Take over a neighbour's new MAC address if the neighbour is known (a broadcast announcement)."""
        if ip in self._entries:
            self.learn(ip, mac, now)

    def lookup(self, ip: IPv4Address, now: int) -> bytes | None:
        """The MAC address, or None when it is unknown or too old."""
        entry = self._entries.get(ip)
        if entry is None or now - entry[1] > LIFETIME_NS:
            return None
        return entry[0]

    def clear(self) -> None:
        """Forget all neighbours."""
        self._entries.clear()
