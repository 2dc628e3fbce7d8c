"""A shard's clock as the hub sees it, by round trips as NTP takes them (RFC 5905, 8).

A shard's answer was made between question and answer, so its clock minus the middle of the two is the offset, and half
of the round trip bounds the error.  The best of the last round trips counts; an old one is worth less, because two
quartz clocks part from each other.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

__all__ = ["ClockOffset"]

#: Round trips that are kept: one a second, so that a quiet moment of the last half minute is among them.
KEPT = 32
#: How fast two machines' clocks may part from each other, ppm: twice the 50 ppm of a plain quartz.
DRIFT_PPM = 100


@dataclass(frozen=True, slots=True)
class _RoundTrip:
    offset_ns: int
    half_ns: int
    taken_ns: int

    def uncertainty_ns(self, now: int) -> int:
        return self.half_ns + max(0, now - self.taken_ns) * DRIFT_PPM // 1_000_000


class ClockOffset:
    """Of one run of one shard; all times are ns, ``now`` is the hub's clock."""

    def __init__(self) -> None:
        self._trips: deque[_RoundTrip] = deque(maxlen=KEPT)
        self._best: _RoundTrip | None = None

    def note(self, asked_ns: int, shard_ns: int, answered_ns: int) -> None:
        """A round trip: when it was asked and answered by the hub's clock, and the shard's clock in the answer."""
        half = max(0, answered_ns - asked_ns) // 2
        trip = _RoundTrip(shard_ns - (asked_ns + half), half, answered_ns)
        best = self._best
        if best is not None and abs(trip.offset_ns - best.offset_ns) > half + best.uncertainty_ns(answered_ns):
            # both cannot be true: the shard's clock stopped, as that of a farm in memory on a machine that stalls
            self._trips.clear()
        self._trips.append(trip)
        self._best = min(self._trips, key=lambda trip: trip.uncertainty_ns(answered_ns))

    def forget(self) -> None:
        """The shard's clock starts again."""
        self._trips.clear()
        self._best = None

    @property
    def known(self) -> bool:
        return self._best is not None

    @property
    def offset_ns(self) -> int:
        """The shard's clock minus the hub's; 0 while nothing is known."""
        return 0 if self._best is None else self._best.offset_ns

    def uncertainty_ns(self, now: int) -> int:
        """Bound of the offset's error."""
        return 0 if self._best is None else self._best.uncertainty_ns(now)

    @property
    def round_trip_ns(self) -> int:
        """The longest of the last round trips: what a request may well take."""
        return max((2 * trip.half_ns for trip in list(self._trips)[-8:]), default=0)

    def to_hub(self, seconds: float) -> float:
        """A moment of the shard's clock by the hub's, s."""
        return seconds - self.offset_ns / 1e9

    def to_shard(self, now: int) -> float:
        """A moment of the hub's clock by the shard's, s."""
        return (now + self.offset_ns) / 1e9
