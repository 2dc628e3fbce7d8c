"""A small seeded generator, so that the same seed gives the same run."""

from __future__ import annotations

__all__ = ["SplitMix64"]

_MASK = 0xFFFF_FFFF_FFFF_FFFF


class SplitMix64:
    """A small seeded generator (Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators, 2014).

    One per impairment: the same seed loses the same frames of a sequence, whatever else happens in the process.
    """

    __slots__ = ("_state",)

    def __init__(self, seed: int) -> None:
        self._state = seed & _MASK

    def next_u64(self) -> int:
        self._state = (self._state + 0x9E3779B97F4A7C15) & _MASK
        z = self._state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
        return z ^ (z >> 31)

    def uniform(self) -> float:
        """In [0, 1)."""
        return (self.next_u64() >> 11) / (1 << 53)
