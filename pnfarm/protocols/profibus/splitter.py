"""From the octets of a line, as they come, to telegrams: whatever is none is counted."""

from __future__ import annotations

import re
from collections import Counter
from typing import Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.wire.telegram import SC, SD1, SD2, SD3, SD4, parse_telegram, telegram_length
from pnfarm.protocols.profibus.wire.timing import SYN_BITS, bits_ns, line_ns

__all__ = ["Splitter"]

#: What a telegram that is incomplete at the end of a pause counts as.
CUT_OFF: Final = "cut-off"
#: Octets that begin no telegram.
GARBAGE: Final = "garbage"

_BEGINS: Final = re.compile(b"[" + re.escape(bytes((SD1, SD2, SD3, SD4, SC))) + b"]")

#: A driver hands over what it has: pieces of one telegram are apart by no more than this, whatever the rate.
LEAST_PAUSE_NS: Final = 5_000_000


def _is_whole(octets: bytes) -> bool:
    """Whether these octets are one telegram, no more and no less: most pieces are."""
    try:
        parse_telegram(octets)
    except DecodeError:
        return False
    return True


class Splitter:
    """Octets in any pieces in, whole telegrams out; for :class:`pnfarm.links.serial.link.SerialLink`.

    Octets of one telegram follow each other without a gap (4.7.3): after ``pause_ns`` a new one begins.
    """

    def __init__(self, baud: int) -> None:
        self.pause_ns = max(LEAST_PAUSE_NS, line_ns(2, baud) + bits_ns(SYN_BITS, baud))
        #: What was wrong, by reason; ``garbage`` counts octets.
        self.dropped: Counter[str] = Counter()
        self._waiting = bytearray()
        self._last_ns = 0

    def split(self, octets: bytes, now: int) -> list[bytes]:
        """The telegrams that are whole now, in order."""
        found = self.handle_timeout(now)
        self._last_ns = now
        if not self._waiting and _is_whole(octets):
            return [*found, octets]
        self._waiting += octets
        return found + self._split()

    def _split(self) -> list[bytes]:
        waiting = bytes(self._waiting)
        found: list[bytes] = []
        place, end = 0, len(waiting)
        while place < end:
            begins = _BEGINS.search(waiting, place)
            start = end if begins is None else begins.start()
            if start > place:
                self.dropped[GARBAGE] += start - place
                place = start
                continue
            try:
                length = telegram_length(waiting[place : place + 4])
                if length is None or place + length > end:
                    break
                whole = waiting[place : place + length]
                parse_telegram(whole)
                found.append(whole)
                place += length
            except DecodeError as exc:
                # the next octet may begin one: what seemed a telegram may have been data of a broken one
                self.dropped[exc.reason] += 1
                place += 1
        self._waiting = bytearray(waiting[place:])
        return found

    def next_deadline(self) -> int | None:
        """When an incomplete telegram is given up."""
        return self._last_ns + self.pause_ns if self._waiting else None

    def handle_timeout(self, now: int) -> list[bytes]:
        """Give up what is incomplete; telegrams that it hid are found."""
        found: list[bytes] = []
        while self._waiting and now - self._last_ns >= self.pause_ns:
            # what seemed the start of a telegram is none; the rest may hold one
            self.dropped[CUT_OFF] += 1
            del self._waiting[0]
            found += self._split()
        return found

    @property
    def is_whole(self) -> bool:
        """Whether no telegram is incomplete."""
        return not self._waiting
