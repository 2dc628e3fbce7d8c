"""Lines: one stream of octets that every station on it shares, as RS-485 is.

A line knows no telegram: it carries octets between the medium and its one user, the farm's end of it
(:mod:`pnfarm.links.serial_link`).  Stations on it have no hardware address and no interface of their own.  The ways to
one are in :mod:`pnfarm.links.serial`: a pty, a port, TCP, a port behind TCP.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol, TypeAlias

__all__ = ["Line", "LineCounters", "LineFormat", "LineNews", "LineReceiver", "Parity"]

Parity: TypeAlias = Literal["none", "even", "odd"]
#: ``receiver(octets, now_ns)``: what came since the last call; its end was on the line at ``now_ns`` at the latest.
LineReceiver: TypeAlias = Callable[[bytes, int], None]
#: ``news(up, text)``: whether the line carries octets from now on, and where or why.
LineNews: TypeAlias = Callable[[bool, str], None]


@dataclass(frozen=True, slots=True)
class LineFormat:
    """How octets go over a line.  ``bauds`` are the rates that the bus has, the likeliest first."""

    bauds: Sequence[int]
    parity: Parity = "none"
    stop_bits: Literal[1, 2] = 1

    @property
    def octet_bits(self) -> int:
        """Bit times of one octet: start bit, eight data bits, parity bit, stop bits."""
        return 9 + (self.parity != "none") + self.stop_bits


@dataclass(slots=True)
class LineCounters:
    """Octets of one line since it was made; read, never reset.

    Reasons in ``lost``, in octets: ``queue-full`` (the far end does not read), ``not-open`` (nobody is there),
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


class Line(Protocol):
    """The interface of every line."""

    @property
    def kind(self) -> str:
        """The way: ``pty``, ``port``, ``connect``, ``listen``, ``rfc2217``."""
        ...

    @property
    def where(self) -> str:
        """What a user connects to, in words: the path of a pty, HOST:PORT.  Complete once the line is open."""
        ...

    @property
    def baud(self) -> int | None:
        """Bits per second; None where the medium has no rate of its own that this end knows."""
        ...

    @property
    def counters(self) -> LineCounters:
        """What went over it."""
        ...

    @property
    def is_up(self) -> bool:
        """Whether somebody is at the far end, as far as the way can tell."""
        ...

    async def open(self) -> None:
        """Take the way; raises :class:`~pnfarm.errors.EnvironmentError_` for one that cannot be.

        A far end that is only absent is no error: the line tries again.
        """
        ...

    async def close(self) -> None:
        """Give the way back.  Closing twice, or a line that was never opened, does nothing."""
        ...

    def send(self, octets: bytes) -> None:
        """Put octets on the line now; never blocks, never raises: what cannot go is counted."""
        ...

    def set_receiver(self, receiver: LineReceiver) -> None:
        """Set who hears the line; it is called in the event loop."""
        ...

    def set_news(self, news: LineNews) -> None:
        """Set who is told that the far end came or went."""
        ...

    def set_baud(self, baud: int) -> None:
        """Change the rate, where the way has one; others ignore it."""
        ...
