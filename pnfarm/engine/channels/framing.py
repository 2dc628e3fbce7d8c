"""Header and trailer of a cyclic frame's data, by the ``framing`` of its channel's row.

Everything else in a tick is the same for all: rows, impairments, data hold timers, telegram words, the process image.
There are real-time class frames (:mod:`pnfarm.engine.channels.rtc`) and CIP's class 1
(:mod:`pnfarm.engine.channels.class1`). A further framing is a number in :mod:`pnfarm.table.channel`, a file such as
these with the same functions, a branch in each function here, and in those of :mod:`pnfarm.engine.channels.consuming`
and :mod:`pnfarm.engine.channels.providing`.  A row with an unknown number takes no frame.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.channels import class1, rtc
from pnfarm.engine.signed import signed
from pnfarm.table.channel import FRAMING_CLASS1, FRAMING_RTC
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = [
    "advance", "change_count", "change_id", "change_status", "comes_from", "count_of", "fits", "identity", "locate",
    "mend", "resize", "start",
]  # fmt: skip


@inlined
def locate(frame: Any, length: int) -> int:
    """Offset of the id of a received frame, before its row is known; 0 for a frame of another kind."""
    place = rtc.locate(frame, length)
    return place or class1.locate(frame, length)


@inlined
def identity(frame: Any, place: int) -> int:
    """The frame id or connection id at ``place``."""
    if place < class1.LEAST_PLACE:
        return int((signed(frame[place]) << 8) | signed(frame[place + 1]))
    return class1.identity(frame, place)


@inlined
def fits(consumer: Any, frame: Any, length: int, place: int) -> int:
    """Offset of the data in a frame whose id is at ``place``; 0 for a frame of another length than agreed."""
    if consumer.framing == FRAMING_RTC:
        return rtc.fits(consumer, frame, length, place) if place < class1.LEAST_PLACE else 0
    if consumer.framing == FRAMING_CLASS1 and place >= class1.LEAST_PLACE:
        return class1.fits(consumer, frame, length, place)
    return 0


@inlined
def comes_from(consumer: Any, frame: Any) -> bool:
    """Whether the peer of the channel sent this frame."""
    if consumer.framing == FRAMING_CLASS1:
        return class1.comes_from(consumer, frame)
    return bool(rtc.comes_from(consumer, frame))


@compiled
def start(provider: Any) -> None:
    """A provider's first frame is due at ``next_ns``."""
    if provider.framing == FRAMING_RTC:
        rtc.start(provider)
    elif provider.framing == FRAMING_CLASS1:
        class1.start(provider)


@inlined
def advance(provider: Any, cycles: int) -> None:
    """This many cycles of a provider have passed; CIP's sequences count what is sent."""
    if provider.framing == FRAMING_RTC:
        rtc.advance(provider, cycles)


@inlined
def count_of(provider: Any, frame: Any, length: int, which: int) -> int:
    """The cycle counter of a complete frame, or one of its sequences (:mod:`pnfarm.table.impairment`)."""
    if provider.framing == FRAMING_RTC:
        return rtc.count_of(frame, length)
    return class1.count_of(provider, frame, which) if provider.framing == FRAMING_CLASS1 else 0


@inlined
def change_count(provider: Any, frame: Any, length: int, count: int, which: int) -> None:
    """Write the cycle counter of a complete frame, or one of its sequences, or move both."""
    if provider.framing == FRAMING_RTC:
        rtc.change_count(frame, length, count)
    elif provider.framing == FRAMING_CLASS1:
        class1.change_count(provider, frame, length, count, which)


@inlined
def change_status(provider: Any, frame: Any, length: int, bit: int) -> None:
    """Clear a bit of the data status of a complete frame; of these, a run/idle header has only RUN."""
    if provider.framing == FRAMING_RTC:
        rtc.change_status(frame, length, bit)
    elif provider.framing == FRAMING_CLASS1:
        class1.change_status(provider, frame, length, bit)


@inlined
def change_id(provider: Any, frame: Any, length: int, amount: int, absolute: bool) -> None:
    """Add to the frame id or connection id of a complete frame, or write it."""
    if provider.framing == FRAMING_RTC:
        rtc.change_id(frame, signed(provider.data_offset), amount, absolute)
    elif provider.framing == FRAMING_CLASS1:
        class1.change_id(provider, frame, length, amount, absolute)


@inlined
def resize(provider: Any, frame: Any, length: int, amount: int) -> int:
    """Lengthen or cut the data of a complete frame; its new length."""
    if provider.framing == FRAMING_RTC:
        return rtc.resize(frame, signed(provider.data_offset), length, amount)
    return class1.resize(provider, frame, length, amount) if provider.framing == FRAMING_CLASS1 else length


@inlined
def mend(frame: Any, length: int) -> None:
    """Make the checksums of a frame that has some right again; a real-time frame has none."""
    class1.mend(frame, length)
