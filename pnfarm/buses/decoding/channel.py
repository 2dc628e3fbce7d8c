"""One direction of cyclic data in a capture: its sums for the summary, and lines that are not written without end."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pnfarm.captures.conversations import CyclicChannel
from pnfarm.captures.packet import Description

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["SummedChannel", "limited"]

#: Lines of one kind about one channel or station; further ones are only counted.
MOST_LINES = 50
_SUMS = (
    "source", "destination", "frames", "interval_count", "total_ns", "shortest_ns", "longest_ns", "gaps", "gap_ns",
    "missing", "jumps", "watchdogs",
)  # fmt: skip


def limited(
    told: dict[str, int],
    what: str,
    text: str,
    details: Mapping[str, Any] = MappingProxyType({}),
    *,
    counts: Mapping[str, str] = MappingProxyType({}),
    place: str = "",
    family: str = "",
) -> Iterator[Description]:
    """A line, unless there were many of its kind; ``told`` counts them, ``place`` says where, for the last one."""
    number = told[what] = told.get(what, 0) + 1
    if number == MOST_LINES:
        text += f"; further ones{place} are not shown"
    if number <= MOST_LINES:
        yield Description(what, text, details, counts, family)
    elif counts:
        yield Description("", counts=counts)


@dataclass(slots=True, eq=False, kw_only=True)
class SummedChannel:
    """Times in nanoseconds.  ``data`` and ``last_ns`` are those of the last frame, once ``begun``."""

    source: bytes = b""
    destination: bytes = b""
    begun: bool = False
    last_ns: int = 0
    data: bytes = b""
    frames: int = 0
    interval_count: int = 0
    total_ns: int = 0
    shortest_ns: int = 0
    longest_ns: int = 0
    gaps: int = 0
    gap_ns: int = 0
    missing: int = 0
    jumps: int = 0
    watchdogs: int = 0
    #: Lines that were written, by kind.
    told: dict[str, int] = field(default_factory=dict)

    def inherit(self, before: SummedChannel) -> None:
        """Continue the sums of an earlier connection's channel with the same addresses and number."""
        for name in _SUMS:
            setattr(self, name, getattr(before, name))

    def limited(self, what: str, text: str, **details: object) -> Iterator[Description]:
        """See :func:`limited`."""
        return limited(self.told, what, text, details, place=" on this channel")

    def passed(self, now: int) -> int:
        """The time since the last frame; it counts, unless the capture goes back in time."""
        interval = now - self.last_ns
        if interval >= 0:
            self.shortest_ns = min(self.shortest_ns, interval) if self.interval_count else interval
            self.longest_ns = max(self.longest_ns, interval)
            self.total_ns += interval
            self.interval_count += 1
        return interval

    def gap(self, passed: int, text: str, hold_ns: int, timer: str = "watchdog") -> str:
        """Count a silence; in words, with the ``timer`` that it is longer than, if it is."""
        self.gaps += 1
        self.gap_ns = max(self.gap_ns, passed)
        text = f"{passed / 1e6:.3f} ms without {text}"
        if hold_ns and passed > hold_ns:
            self.watchdogs += 1
            text += f"; longer than the {timer} of {hold_ns / 1e6:g} ms"
        return text

    def figures(self, number: str, telegram: int | None, cycle_ns: int) -> CyclicChannel:
        """For the summary; ``number`` names the channel in its frames."""
        count = self.interval_count
        return CyclicChannel(
            self.source,
            self.destination,
            {
                "frame_id": number,
                "telegram": telegram,
                "frames": self.frames,
                "cycle_seconds": cycle_ns / 1e9 if cycle_ns else None,
                "interval_min_seconds": self.shortest_ns / 1e9 if count else None,
                "interval_mean_seconds": self.total_ns / count / 1e9 if count else None,
                "interval_max_seconds": self.longest_ns / 1e9 if count else None,
                "gaps": self.gaps,
                "longest_gap_seconds": self.gap_ns / 1e9 if self.gaps else None,
                "frames_missing": self.missing,
                "counter_jumps": self.jumps,
                "watchdog_gaps": self.watchdogs,
            },
        )
