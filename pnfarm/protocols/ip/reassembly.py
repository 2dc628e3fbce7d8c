"""Reassembly of IPv4 fragments (RFC 791, 3.2; overlaps are refused as RFC 5722 requires for IPv6)."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from pnfarm.wire.ipv4 import HEADER_LENGTH, MAXIMUM_LENGTH, Ipv4Packet

if TYPE_CHECKING:
    from collections import Counter
    from ipaddress import IPv4Address

__all__ = ["MAXIMUM_FRAGMENTS", "MAXIMUM_PACKETS", "TIMEOUT_NS", "Reassembler"]

#: Packets in progress at a time at one station; a further one displaces the oldest of its own sender, or else of all.
MAXIMUM_PACKETS = 4
#: Fragments of one packet: 64 KiB in fragments of the smallest path MTU in use (576), with a margin.
MAXIMUM_FRAGMENTS = 128
#: Time limit from the arrival of the first fragment.
TIMEOUT_NS = 30 * 10**9

_Key = tuple["IPv4Address", "IPv4Address", int, int]


@dataclass(slots=True)
class _Partial:
    deadline: int
    total: int | None = None  # octets, known once the last fragment came
    pieces: list[tuple[int, bytes]] = field(default_factory=list)  # sorted by offset, never overlapping

    def accept(self, offset: int, data: bytes, *, last: bool) -> bool:
        """Add a fragment; False when it contradicts the others."""
        end = offset + len(data)
        if (offset, data) in self.pieces:
            return True  # a repetition
        if last:
            if self.total is not None or (self.pieces and _end(self.pieces[-1]) > end):
                return False
            self.total = end
        if self.total is not None and end > self.total:
            return False
        index = bisect_left(self.pieces, offset, key=lambda piece: piece[0])
        if index and _end(self.pieces[index - 1]) > offset:
            return False
        if index < len(self.pieces) and self.pieces[index][0] < end:
            return False
        self.pieces.insert(index, (offset, data))
        return len(self.pieces) <= MAXIMUM_FRAGMENTS

    def joined(self) -> bytes | None:
        """The whole payload once no gap is left, else None."""
        if self.total is None or sum(len(data) for _, data in self.pieces) != self.total:
            return None
        return b"".join(data for _, data in self.pieces)


def _end(piece: tuple[int, bytes]) -> int:
    return piece[0] + len(piece[1])


class Reassembler:
    """Collects fragments; discarded packets are counted in ``dropped`` by reason.

    ``packets`` are in progress at a time.
    """

    __slots__ = ("_dropped", "_packets", "_partials")

    def __init__(self, dropped: Counter[str], packets: int = MAXIMUM_PACKETS) -> None:
        self._dropped = dropped
        self._packets = packets
        self._partials: dict[_Key, _Partial] = {}  # oldest first

    @property
    def pending(self) -> int:
        """Packets in progress."""
        return len(self._partials)

    def receive(self, packet: Ipv4Packet, now: int) -> Ipv4Packet | None:
        """A whole packet (at once if it is not fragmented), or None while fragments are missing."""
        if not packet.more_fragments and not packet.fragment_offset:
            return packet
        self.handle_timeout(now)
        key = (packet.source, packet.destination, packet.protocol, packet.identification)
        too_long = packet.fragment_offset + len(packet.payload) > MAXIMUM_LENGTH - HEADER_LENGTH
        if too_long or not packet.payload or (packet.more_fragments and len(packet.payload) % 8):
            self._partials.pop(key, None)
            self._dropped["fragment-bad-length"] += 1
            return None
        partial = self._partials.get(key)
        if partial is None:
            if len(self._partials) >= self._packets:
                oldest = next(iter(self._partials))
                del self._partials[next((known for known in self._partials if known[0] == packet.source), oldest)]
                self._dropped["fragment-displaced"] += 1
            partial = self._partials[key] = _Partial(deadline=now + TIMEOUT_NS)
        if not partial.accept(packet.fragment_offset, packet.payload, last=not packet.more_fragments):
            del self._partials[key]
            self._dropped["fragment-overlap"] += 1
            return None
        payload = partial.joined()
        if payload is None:
            return None
        del self._partials[key]
        return replace(packet, payload=payload, fragment_offset=0, more_fragments=False)

    def next_deadline(self) -> int | None:
        """When the oldest packet in progress is given up."""
        return min(partial.deadline for partial in self._partials.values()) if self._partials else None

    def handle_timeout(self, now: int) -> None:
        """Give up packets that are incomplete for too long."""
        if not self._partials:
            return
        for key in [key for key, partial in self._partials.items() if partial.deadline <= now]:
            del self._partials[key]
            self._dropped["fragment-timeout"] += 1

    def clear(self) -> None:
        """Forget everything in progress."""
        self._partials.clear()
