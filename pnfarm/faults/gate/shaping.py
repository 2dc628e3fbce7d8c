"""What becomes of an acyclic frame that is hit but not lost; the engine does the same to cyclic ones."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

from pnfarm.station.splitmix import SplitMix64
from pnfarm.wire.ethernet import ETHERTYPE_VLAN

if TYPE_CHECKING:
    from pnfarm.wire.direction import Direction

__all__ = ["LINE_OCTETS", "Shape", "corrupted"]

#: Octets that a frame takes on the line beside its own: preamble, FCS, gap.
LINE_OCTETS = 24


@dataclass(eq=False)
class Shape:
    """``copies`` more of a frame; ``bits`` inverted in it (``whole``: also in the addresses); later by ``delay_ns``

    and up to ``jitter_ns`` more, in order unless one ``overtakes``.  Each direction has its own random sequence.
    """

    seed: int
    _: KW_ONLY
    copies: int = 0
    bits: int = 0
    whole: bool = False
    delay_ns: int = 0
    jitter_ns: int = 0
    overtakes: bool = False

    def __post_init__(self) -> None:
        self._random: dict[Direction, SplitMix64] = {"out": SplitMix64(self.seed), "in": SplitMix64(self.seed + 1)}
        self._free_ns: dict[Direction, int] = {"out": 0, "in": 0}

    def hit(self, direction: Direction, frame: bytes, due: int, *, bare: bool = False) -> list[tuple[int, bytes]]:
        """(time, octets) of what goes on instead of a frame, or of octets without headers, that would at ``due``."""
        random = self._random[direction]
        if self.bits:
            frame = corrupted(frame, self.bits, random, whole=self.whole or bare)
        due += self.delay_ns + int(random.uniform() * self.jitter_ns)
        if self.delay_ns or self.jitter_ns:
            if not self.overtakes:
                due = max(due, self._free_ns[direction])
            self._free_ns[direction] = due
        return [(due, frame)] * (1 + self.copies)

    def passes(self, direction: Direction, due: int) -> int:
        """When a frame that is not hit goes on: it waits behind those that are delayed, unless it may overtake."""
        return due if self.overtakes else max(due, self._free_ns[direction])


def corrupted(frame: bytes, bits: int, random: SplitMix64, *, whole: bool) -> bytes:
    """With so many different bits inverted, one in each of as many equal parts of the frame."""
    first = 0
    if not whole:
        first = 18 if int.from_bytes(frame[12:14], "big") == ETHERTYPE_VLAN else 14
    part = (len(frame) - first) * 8 // bits
    if part <= 0:
        return frame
    octets = bytearray(frame)
    for i in range(bits):
        bit = i * part + random.next_u64() % part
        octets[first + (bit >> 3)] ^= 0x80 >> (bit & 7)
    return bytes(octets)
