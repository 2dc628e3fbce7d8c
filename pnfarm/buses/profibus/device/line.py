"""What the octets of a serial line are to slaves and masters: telegrams."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.protocols.profibus.splitter import Splitter
from pnfarm.protocols.profibus.wire.timing import bits_ns, line_ns

if TYPE_CHECKING:
    from collections import Counter

__all__ = ["TelegramSplitter"]

#: A driver hands over what it has: pieces of one telegram are apart by no more than this, whatever the rate.
LEAST_PAUSE_NS: Final = 5_000_000


class TelegramSplitter:
    """See :class:`pnfarm.links.serial.link.Splitter`."""

    def __init__(self, baud: int) -> None:
        self._splitter = Splitter(max(LEAST_PAUSE_NS, line_ns(2, baud) + bits_ns(33, baud)))

    @property
    def dropped(self) -> Counter[str]:
        return self._splitter.dropped

    @property
    def is_whole(self) -> bool:
        return self._splitter.is_whole

    def split(self, octets: bytes, now: int) -> list[bytes]:
        if self._splitter.takes_whole(octets, now):
            return [octets]
        return [whole for _, whole in self._splitter.feed(octets, now)]

    def next_deadline(self) -> int | None:
        return self._splitter.next_deadline()

    def handle_timeout(self, now: int) -> list[bytes]:
        return [whole for _, whole in self._splitter.handle_timeout(now)]
