"""From the octets of a line, as they come, to telegrams: whatever is none is counted."""

from __future__ import annotations

import re
from collections import Counter
from typing import Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.wire.telegram import SC, SD1, SD2, SD3, SD4, Line, parse_telegram, telegram_length

__all__ = ["Split", "Splitter"]

#: What a telegram that is incomplete at the end of a pause counts as.
CUT_OFF: Final = "cut-off"
#: Octets that begin no telegram.
GARBAGE: Final = "garbage"

_BEGINS: Final = re.compile(b"[" + re.escape(bytes((SD1, SD2, SD3, SD4, SC))) + b"]")

#: A telegram, and its octets.
Split = tuple[Line, bytes]


def _whole(octets: bytes) -> Line | None:
    """The telegram that these octets are, no more and no less: most pieces are one."""
    try:
        return parse_telegram(octets)
    except DecodeError:
        return None


class Splitter:
    """Octets in any pieces in, whole telegrams out.

    ``pause_ns``: octets of one telegram follow each other without a gap (4.7.3); after a pause that long a new one
    begins; 0: never.  Pieces that a driver delivers may be apart by more than the line's own times, so it is the
    line's user who says how long.
    """

    def __init__(self, pause_ns: int = 0) -> None:
        self.pause_ns = pause_ns
        #: What was wrong, by reason; ``garbage`` counts octets.
        self.dropped: Counter[str] = Counter()
        self._waiting = bytearray()
        self._last_ns = 0

    def takes_whole(self, octets: bytes, now: int) -> bool:
        """Whether nothing waits and these octets are one telegram, which is taken then.  Else they are to be fed."""
        if self._waiting or _whole(octets) is None:
            return False
        self._last_ns = now
        return True

    def feed(self, octets: bytes, now: int) -> list[Split]:
        """The telegrams that are whole now, in order."""
        if not self._waiting and (whole := _whole(octets)) is not None:
            self._last_ns = now
            return [(whole, octets)]
        found: list[Split] = []
        if self._waiting and self.pause_ns and now - self._last_ns >= self.pause_ns:
            found = self._cut()
        self._last_ns = now
        self._waiting += octets
        return found + self._split()

    def _split(self) -> list[Split]:
        waiting = bytes(self._waiting)
        found: list[Split] = []
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
                found.append((parse_telegram(whole), whole))
                place += length
            except DecodeError as exc:
                # the next octet may begin one: what seemed a telegram may have been data of a broken one
                self.dropped[exc.reason] += 1
                place += 1
        self._waiting = bytearray(waiting[place:])
        return found

    def next_deadline(self) -> int | None:
        """When an incomplete telegram is given up."""
        return self._last_ns + self.pause_ns if self._waiting and self.pause_ns else None

    def handle_timeout(self, now: int) -> list[Split]:
        """Give up what is incomplete; telegrams that it hid are found."""
        if not self._waiting or not self.pause_ns or now - self._last_ns < self.pause_ns:
            return []
        return self._cut()

    @property
    def is_whole(self) -> bool:
        """Whether no telegram is incomplete."""
        return not self._waiting

    def _cut(self) -> list[Split]:
        found: list[Split] = []
        while self._waiting:
            # what seemed the start of a telegram is none; the rest may hold one
            self.dropped[CUT_OFF] += 1
            del self._waiting[0]
            found += self._split()
        return found
