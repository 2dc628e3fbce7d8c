"""Lines: one stream of octets that every station on it shares, as RS-485 is.

A line knows no telegram: it carries octets between the medium and its one user, the farm's end of it
(:mod:`pnfarm.links.serial.link`).  Stations on it have no hardware address and no interface of their own.  The ways to
one are in :mod:`pnfarm.links.serial.descriptor` (a pty, a port) and beside it (TCP, a port behind TCP).
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias

__all__ = [
    "REPLY_EDGES_NS", "AtOnce", "Line", "LineCounters", "LineNews", "LineReceiver", "LineTally", "ReplyTimes",
]  # fmt: skip

#: ``receiver(octets, now_ns)``: what came since the last call; its end was on the line at ``now_ns`` at the latest.
LineReceiver: TypeAlias = Callable[[bytes, int], None]
#: ``at_once(octets, length, now_ns)``: whether all is done that the first octets of this array ask for; if not, nothing
#: is.
AtOnce: TypeAlias = Callable[[Any, int, int], bool]
#: ``news(up, text)``: whether the line carries octets from now on, and where or why.
LineNews: TypeAlias = Callable[[bool, str], None]


@dataclass(slots=True)
class LineCounters:
    """Octets of one line since it was made; read, never reset.

    Reasons in ``lost``, in octets: ``queue-full`` (the far end does not read), ``not-open`` (it is not connected),
    ``cut-off`` (under way when the way broke).  ``interruptions`` counts how often the way broke or could not be
    opened.
    """

    received: int = 0
    sent: int = 0
    opened: int = 0
    lost: Counter[str] = field(default_factory=Counter)
    interruptions: Counter[str] = field(default_factory=Counter)

    def as_dict(self) -> dict[str, int]:
        """Flat copy: ``received``, ``sent``, ``opened``, ``lost_<reason>``, ``interruptions_<reason>``."""
        return {
            "received": self.received,
            "sent": self.sent,
            "opened": self.opened,
            **{f"lost_{reason}": count for reason, count in sorted(self.lost.items())},
            **{f"interruptions_{reason}": count for reason, count in sorted(self.interruptions.items())},
        }


#: Upper bounds of the histogram of reply times; max T_SDR is 0.067 ms at 12 Mbit/s, and 6.25 ms at 9.6 kbit/s.
REPLY_EDGES_NS = (
    50_000, 75_000, 100_000, 150_000, 200_000, 300_000, 500_000, 750_000, 1_000_000, 2_000_000, 5_000_000, 10_000_000,
    20_000_000, 50_000_000,
)  # fmt: skip


@dataclass(slots=True)
class ReplyTimes:
    """From the last octet of a request to its answer: ``buckets`` by :data:`REPLY_EDGES_NS`, and one for the rest."""

    buckets: list[int] = field(default_factory=lambda: [0] * (len(REPLY_EDGES_NS) + 1))
    sum_ns: int = 0

    def add(self, took_ns: int) -> None:
        self.sum_ns += took_ns
        self.buckets[bisect_left(REPLY_EDGES_NS, took_ns)] += 1

    @property
    def count(self) -> int:
        return sum(self.buckets)


class LineTally(Protocol):
    """What is to be known of one line of a farm; read, never written."""

    @property
    def way(self) -> str:
        """As :attr:`Line.kind`, or ``memory``."""

    @property
    def where(self) -> str: ...
    @property
    def is_up(self) -> bool: ...
    @property
    def baud(self) -> int: ...
    @property
    def octets(self) -> LineCounters: ...
    @property
    def telegrams(self) -> tuple[int, int]:
        """Received and sent by the farm."""

    @property
    def dropped(self) -> Mapping[str, int]:
        """What came and was no telegram, by reason."""

    @property
    def replies(self) -> ReplyTimes: ...
    @property
    def withheld(self) -> int:
        """Answers that would have begun too late, and were not given."""


class Line(Protocol):
    """The interface of every line."""

    @property
    def kind(self) -> str:
        """The way: ``pty``, ``port``, ``connect``, ``listen``, ``rfc2217``."""

    @property
    def where(self) -> str:
        """What a user connects to, in words: the path of a pty, HOST:PORT.  Complete once the line is open."""

    @property
    def baud(self) -> int | None:
        """Bits per second; None where the medium has no rate of its own that this end knows."""

    @property
    def has_rate(self) -> bool:
        """Whether octets leave at the rate as soon as they are sent: times of the standard count from here."""

    @property
    def counters(self) -> LineCounters:
        """What went over it."""

    @property
    def is_up(self) -> bool:
        """Whether the far end is connected, as far as this kind of line shows it."""

    async def open(self) -> None:
        """Take the way; raises :class:`~pnfarm.errors.EnvironmentError_` for one that cannot be.

        A far end that is only absent is no error: the line tries again.
        """

    async def close(self) -> None:
        """Give the way back.  Closing twice, or a line that was never opened, does nothing."""

    def send(self, octets: bytes | memoryview) -> None:
        """Put octets on the line now; never blocks, never raises: what cannot go is counted."""

    def set_receiver(self, receiver: LineReceiver) -> None:
        """Set who hears the line; it is called in the event loop."""

    def set_at_once(self, at_once: AtOnce) -> None:
        """Set who is asked before the receiver, where the event loop has a way to do so before its next turn."""

    def set_news(self, news: LineNews) -> None:
        """Set what is called when the far end came or went."""

    def set_baud(self, baud: int) -> None:
        """Change the rate, where the way has one; others ignore it."""
