"""Header and trailer of a cyclic frame's data, by the ``framing`` of its channel's row.

Everything else in a tick is the same for all: rows, impairments, data hold timers, telegram words, the process image.
A further framing, such as CIP's class 1 (a sequence count and a run/idle header before the data), is a number in
:mod:`pnfarm.table.channel`, a file such as :mod:`pnfarm.engine.rtc` with the same functions, and a branch in each
function here.  A row with an unknown number takes no frame.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine import rtc
from pnfarm.engine.signed import signed
from pnfarm.table.channel import DISCARD_INVALID, FRAMING_RTC
from pnfarm.table.compiled import compiled

__all__ = [
    "advance", "change_count", "change_id", "change_status", "count_of", "elapsed", "fits", "locate", "provider_ran",
    "provider_runs", "refused", "resize", "seal", "start", "take",
]  # fmt: skip

#: How a received frame is found, before its row is known.
locate = rtc.locate


@compiled
def fits(consumer: Any, length: int, place: int) -> int:
    """Offset of the data in a frame whose id is at ``place``; 0 for a frame of another length than agreed."""
    return rtc.fits(consumer, length, place) if consumer.framing == FRAMING_RTC else 0


@compiled
def refused(consumer: Any, frame: Any, length: int) -> int:
    """Why a frame is not taken: an index of ``CPM.discarded``, -1 if it is."""
    return rtc.refused(consumer, frame, length) if consumer.framing == FRAMING_RTC else DISCARD_INVALID


@compiled
def provider_runs(consumer: Any, frame: Any, length: int) -> bool:
    """Whether the sender of a frame is in RUN."""
    return consumer.framing == FRAMING_RTC and rtc.provider_runs(frame, length) != 0


@compiled
def provider_ran(consumer: Any) -> bool:
    """Whether the sender of the frame that was taken last was in RUN."""
    return consumer.framing == FRAMING_RTC and rtc.provider_ran(consumer) != 0


@compiled
def elapsed(consumer: Any, frame: Any, length: int) -> int:
    """Time by the sender's count of cycles since the frame that was taken last, ns; 0 where it has none."""
    return rtc.elapsed(consumer, frame, length) if consumer.framing == FRAMING_RTC else 0


@compiled
def take(consumer: Any, frame: Any, length: int) -> None:
    """Store what the next frame is compared with."""
    if consumer.framing == FRAMING_RTC:
        rtc.take(consumer, frame, length)


@compiled
def start(provider: Any) -> None:
    """A provider's first frame is due at ``next_ns``."""
    if provider.framing == FRAMING_RTC:
        rtc.start(provider)


@compiled
def advance(provider: Any, cycles: int) -> None:
    """This many cycles of a provider have passed."""
    if provider.framing == FRAMING_RTC:
        rtc.advance(provider, cycles)


@compiled
def seal(provider: Any, frame: Any) -> None:
    """Complete a frame before it is sent."""
    if provider.framing == FRAMING_RTC:
        rtc.seal(provider, frame)


@compiled
def count_of(provider: Any, frame: Any, length: int) -> int:
    """The cycle counter of a complete frame."""
    return rtc.count_of(frame, length) if provider.framing == FRAMING_RTC else 0


@compiled
def change_count(provider: Any, frame: Any, length: int, count: int) -> None:
    """Write the cycle counter of a complete frame."""
    if provider.framing == FRAMING_RTC:
        rtc.change_count(frame, length, count)


@compiled
def change_status(provider: Any, frame: Any, length: int, bit: int) -> None:
    """Clear a bit of the data status of a complete frame."""
    if provider.framing == FRAMING_RTC:
        rtc.change_status(frame, length, bit)


@compiled
def change_id(provider: Any, frame: Any, amount: int, absolute: bool) -> None:
    """Add to the frame id of a complete frame, or write it."""
    if provider.framing == FRAMING_RTC:
        rtc.change_id(frame, signed(provider.data_offset), amount, absolute)


@compiled
def resize(provider: Any, frame: Any, length: int, amount: int) -> int:
    """Lengthen or cut the data of a complete frame; its new length."""
    if provider.framing != FRAMING_RTC:
        return length
    return rtc.resize(frame, signed(provider.data_offset), length, amount)
