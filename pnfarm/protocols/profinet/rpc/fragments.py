"""What both ends of connectionless RPC share: addresses, and the two halves of a fragmented transfer.

A stub that is longer than one PDU's body goes out as numbered fragments.  The sender keeps a window of them in
flight and asks for a fragment acknowledgement (*fack*) with the last one of each burst; a fack is cumulative.
The window starts at one fragment and opens only as far as the receiver's fack bodies advertise, because peers
that send empty facks keep no fragment that arrives out of order (C706 chapter 9, 10.2.7).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from pnfarm.protocols.profinet.wire.rpc.bodies import FackBody
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    ARGS_HEADER_LENGTH,
    BODY_MAX,
    FRAGMENT_NONE,
    HEADER_LENGTH,
    Flags1,
)
from pnfarm.wire.value import value_class

if TYPE_CHECKING:
    from collections.abc import Iterator
    from ipaddress import IPv4Address

__all__ = ["FRAGMENTS_MAX", "STUB_MAX", "Datagram", "FragmentSender", "Peer", "Reassembly", "fack_body", "is_newer"]

STUB_MAX: Final = 65536 + ARGS_HEADER_LENGTH
"""Octets of a whole stub: 64 KiB of blocks and the NDR header before them."""

FRAGMENTS_MAX: Final = 256
"""Fragments of one stub; with the 1,384 octets that every peer accepts, 48 carry the longest."""

WINDOW_MAX: Final = 4
_WINDOW_UNIT: Final = 1024


class Peer(NamedTuple):
    """The other end: IPv4 address and UDP port."""

    ip: IPv4Address
    port: int


@value_class
class Datagram:
    """A UDP payload to send from ``local_port`` to ``peer``."""

    local_port: int
    peer: Peer
    data: bytes


def is_newer(sequence: int, reference: int) -> bool:
    """Whether ``sequence`` lies ahead of ``reference`` in the 32-bit circle of sequence numbers."""
    return 0 < (sequence - reference) & 0xFFFFFFFF < 0x80000000


def fack_body(serial: int) -> FackBody:
    """What this implementation's receivers advertise."""
    return FackBody(
        window_size=WINDOW_MAX * BODY_MAX // _WINDOW_UNIT,
        max_tsdu=STUB_MAX,
        max_fragment_size=BODY_MAX + HEADER_LENGTH,
        serial=serial,
    )


class Fragment(NamedTuple):
    """One PDU's share of a stub; ``flags1`` holds the bits that concern fragmentation."""

    number: int
    flags1: int
    body: bytes


class FragmentSender:
    """Cuts a stub into fragments and decides which of them may be in flight.

    ``base`` is the first fragment without acknowledgement, ``next`` the first that was not sent since the last
    step back.
    """

    __slots__ = ("_sent", "_size", "_stub", "_window", "base", "count", "next")

    def __init__(self, stub: bytes, size: int) -> None:
        self._stub = stub
        self._size = size
        self._window = 1
        self.count = max(1, -(-len(stub) // size))
        self.base = 0
        self.next = 0
        self._sent = 0

    @property
    def octets(self) -> int:
        return len(self._stub)

    @property
    def fragmented(self) -> bool:
        return self.count > 1

    @property
    def all_sent(self) -> bool:
        return self.next >= self.count

    @property
    def delivered(self) -> bool:
        return self.base >= self.count

    def due(self) -> Iterator[Fragment]:
        """The fragments that the window lets out now; they count as sent."""
        end = min(self.count, self.base + self._window)
        while self.next < end:
            number, self.next = self.next, self.next + 1
            self._sent = max(self._sent, self.next)
            body = self._stub[number * self._size : (number + 1) * self._size]
            last = Flags1.LAST_FRAGMENT if number == self.count - 1 else 0
            if not self.fragmented:
                yield Fragment(0, 0, body)
            elif self.next == end:
                yield Fragment(number, Flags1.FRAGMENT | last, body)
            else:
                yield Fragment(number, Flags1.FRAGMENT | Flags1.NO_FACK | last, body)

    def acknowledge(self, number: int, body: FackBody | None) -> bool:
        """Take a fack up to ``number``; returns whether the transfer advanced.

        A fack short of what was sent shows a gap: sending goes back to it.
        """
        if number == FRAGMENT_NONE or not self.base <= number < self._sent:
            return False
        self.base = self.next = number + 1
        advertised = 1 if body is None else body.window_size * _WINDOW_UNIT // self._size
        self._window = max(1, min(WINDOW_MAX, self._window + 1, advertised))
        return True

    def rewind(self) -> None:
        """Send again from the first fragment without acknowledgement, one at a time."""
        self.next = self.base
        self._window = 1

    def restart(self, base: int = 0) -> None:
        """Send again from fragment ``base``, whatever was acknowledged."""
        self.base = min(base, self.count - 1)
        self.rewind()


class Reassembly:
    """Collects fragments in any order, bounded in octets and in number."""

    __slots__ = ("_fragments", "_last", "_limit", "_next", "octets")

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._fragments: dict[int, bytes] = {}
        self._last: int | None = None
        self._next = 0
        self.octets = 0

    @property
    def complete(self) -> bool:
        return self._last is not None and self._next > self._last

    @property
    def acknowledged(self) -> int:
        """The highest number up to which nothing is missing; :data:`FRAGMENT_NONE` before the first."""
        return (self._next - 1) & 0xFFFF

    def add(self, number: int, body: bytes, *, last: bool) -> str | None:
        """Take one fragment; returns why it was not taken, or ``None``.  A repetition changes nothing."""
        if number in self._fragments:
            return "duplicate-fragment"
        if number >= FRAGMENTS_MAX or (self._last is not None and number > self._last):
            return "fragment-number"
        if last and any(known > number for known in self._fragments):
            return "fragment-number"
        if self.octets + len(body) > self._limit:
            return "too-long"
        self._fragments[number] = body
        self.octets += len(body)
        if last:
            self._last = number
        while self._next in self._fragments:
            self._next += 1
        return None

    def stub(self) -> bytes:
        return b"".join(self._fragments[number] for number in range(self._next))
