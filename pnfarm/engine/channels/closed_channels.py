"""Counters of a station's closed channels.

A row of the channel tables starts at zero each time it is opened; a drive's counters must not, however often its
controller reconnects.  So a station adds a row's counters here when it closes the row.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.table.channel import DISCARDS, INTERVAL_BUCKETS, JITTER_BUCKETS

if TYPE_CHECKING:
    from pnfarm.engine.channels.schedule import ChannelTable

__all__ = ["ClosedChannels"]

#: Of stations that closed no channel, which are most.
_NO_DISCARDS = np.zeros(len(DISCARDS), np.int64)
_NO_INTERVALS = np.zeros(INTERVAL_BUCKETS, np.int64)
_NO_JITTERS = np.zeros(JITTER_BUCKETS, np.int64)
for _shared in (_NO_DISCARDS, _NO_INTERVALS, _NO_JITTERS):
    _shared.flags.writeable = False


class ClosedChannels:
    """Sums over all channels of one station that were closed; fields as in the channel tables."""

    __slots__ = (
        "discarded",
        "interval_sum_ns",
        "intervals",
        "jitter_sum_ns",
        "jitters",
        "late",
        "late_own",
        "missed",
        "received",
        "sent",
        "suppressed",
    )

    def __init__(self) -> None:
        self.sent = 0
        self.suppressed = 0
        self.received = 0
        self.discarded: Any = _NO_DISCARDS
        self.intervals: Any = _NO_INTERVALS
        self.interval_sum_ns = 0
        self.jitters: Any = _NO_JITTERS
        self.jitter_sum_ns = 0
        self.missed = 0
        self.late = 0
        self.late_own = 0

    def add_provider(self, channels: ChannelTable, row: int) -> None:
        """Add the counters of a provider that is closed already."""
        provider = channels.columns.ppm[row]
        self.sent += int(provider.sent)
        self.suppressed += int(provider.suppressed)

    def add_consumer(self, channels: ChannelTable, row: int) -> None:
        """Add the counters of a consumer that is closed already."""
        consumer = channels.columns.cpm[row]
        self.received += int(consumer.received)
        self.discarded = self.discarded + consumer.discarded
        self.intervals = self.intervals + consumer.intervals
        self.interval_sum_ns += int(consumer.interval_sum_ns)
        self.jitters = self.jitters + consumer.jitters
        self.jitter_sum_ns += int(consumer.jitter_sum_ns)
        self.missed += int(consumer.missed)
        self.late += int(consumer.late)
        self.late_own += int(consumer.late_own)
