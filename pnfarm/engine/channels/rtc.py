"""The framing of real-time class frames (IEC 61158-6-10, RTC-PDU): what comes before the IO data and after it.

====================  ==================================================
Ethernet header       14 octets, 18 with a VLAN tag
frame id              2 octets
IO data
cycle counter         2 octets, counts 31.25 us
data status           1 octet
transfer status       1 octet, 0
====================  ==================================================
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.mac import mac_at
from pnfarm.engine.signed import signed
from pnfarm.table.channel import (
    DISCARD_COUNTER,
    DISCARD_INVALID,
    DISCARD_TRANSFER,
    RUN,
    STATUS_RUN,
    STATUS_VALID,
)
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, ETHERTYPE_VLAN
from pnfarm.wire.rtc import SEND_CLOCK_NS

__all__ = [
    "TRAILER", "advance", "change_count", "change_id", "change_status", "comes_from", "count_of", "elapsed", "fits",
    "locate", "provider_ran", "provider_runs", "refused", "repeats", "resize", "seal", "start", "take",
]  # fmt: skip

#: Octets before the frame id of an untagged frame, and of a VLAN tag.
HEADER = 14
TAG = 4
#: Octets of the frame id.
FRAME_ID = 2
#: Cycle counter, data status, transfer status.
TRAILER = 4
#: A cycle counter that is this far behind the last one belongs to an old frame (IEC 61158-6-10, CPM).
COUNTER_WINDOW = 61440


@compiled
def locate(frame: Any, length: int) -> int:
    """Offset of the frame id in a received frame; 0 for a frame of another kind."""
    if length < HEADER + FRAME_ID + TRAILER or length > frame.shape[0]:
        return 0
    place = HEADER
    kind = (int(frame[12]) << 8) | int(frame[13])
    if kind == ETHERTYPE_VLAN and length >= HEADER + TAG + FRAME_ID + TRAILER:
        place += TAG
        kind = (int(frame[16]) << 8) | int(frame[17])
    return place if kind == ETHERTYPE_PROFINET else 0


@inlined
def fits(consumer: Any, frame: Any, length: int, place: int) -> int:  # noqa: ARG001 - as in every framing
    """Offset of the data after the frame id at ``place``; 0 for a frame of another length than agreed."""
    data = place + FRAME_ID
    return data if length == data + consumer.data_length + TRAILER else 0


@inlined
def comes_from(consumer: Any, frame: Any) -> bool:
    """Whether the frame has the MAC address of the peer."""
    return bool(mac_at(frame, 6) == consumer.source)


@compiled
def refused(consumer: Any, frame: Any, length: int, data: int) -> int:  # noqa: ARG001 - as in every framing
    """Why the CPM does not take this frame: an index of ``CPM.discarded``, -1 if it does."""
    trailer = length - TRAILER
    if consumer.state == RUN:
        ahead = (_counter(frame, trailer) - int(consumer.counter)) & 0xFFFF
        if ahead == 0 or ahead > COUNTER_WINDOW:
            return DISCARD_COUNTER
    if not int(frame[trailer + 2]) & STATUS_VALID:
        return DISCARD_INVALID
    return DISCARD_TRANSFER if frame[trailer + 3] != 0 else -1


@inlined
def repeats(consumer: Any, frame: Any, data: int) -> bool:  # noqa: ARG001 - as in every framing
    """A frame that repeats the one before is refused by its counter."""
    return False


@inlined
def provider_runs(consumer: Any, frame: Any, length: int, data: int) -> int:  # noqa: ARG001 - as in every framing
    """Whether the sender is in RUN, by the bit of the data status."""
    return int(frame[length - TRAILER + 2]) & STATUS_RUN


@inlined
def provider_ran(consumer: Any) -> int:
    """The same for the frame that was taken last."""
    return int(consumer.data_status) & STATUS_RUN


@inlined
def elapsed(consumer: Any, frame: Any, length: int, data: int) -> int:  # noqa: ARG001 - as in every framing
    """Time by the sender's cycle counter since the frame that was taken last, ns; it wraps after 2.048 s."""
    return ((_counter(frame, length - TRAILER) - int(consumer.counter)) & 0xFFFF) * SEND_CLOCK_NS


@inlined
def take(consumer: Any, frame: Any, length: int, data: int) -> None:  # noqa: ARG001 - as in every framing
    """Store what the next frame is compared with."""
    trailer = length - TRAILER
    consumer.counter = _counter(frame, trailer)
    consumer.data_status = frame[trailer + 2]


@inlined
def _counter(frame: Any, trailer: int) -> int:
    return (int(frame[trailer]) << 8) | int(frame[trailer + 1])


@compiled
def start(provider: Any) -> None:
    """Set the counter of a provider whose first frame is due at ``next_ns``."""
    provider.counter = (provider.next_ns // SEND_CLOCK_NS) & 0xFFFF


@inlined
def advance(provider: Any, cycles: int) -> None:
    """This many cycles have passed."""
    provider.counter = (int(provider.counter) + cycles * int(provider.counter_step)) & 0xFFFF


@inlined
def seal(provider: Any, frame: Any) -> None:
    """Write the trailer of a frame before it is sent."""
    trailer = provider.length - TRAILER
    frame[trailer] = provider.counter >> 8
    frame[trailer + 1] = provider.counter & 0xFF
    frame[trailer + 2] = provider.data_status
    frame[trailer + 3] = 0


# changes of a complete frame


@inlined
def count_of(frame: Any, length: int) -> int:
    """The cycle counter."""
    return signed(_counter(frame, length - TRAILER))


@inlined
def change_count(frame: Any, length: int, count: int) -> None:
    """Write the cycle counter."""
    frame[length - TRAILER] = (count >> 8) & 0xFF
    frame[length - TRAILER + 1] = count & 0xFF


@inlined
def change_status(frame: Any, length: int, bit: int) -> None:
    """Clear a bit of the data status."""
    frame[length - TRAILER + 2] &= 0xFF ^ bit


@inlined
def change_id(frame: Any, data: int, amount: int, absolute: bool) -> None:
    """Add to the frame id in front of the data, or write it."""
    place = data - FRAME_ID
    before = signed((int(frame[place]) << 8) | int(frame[place + 1]))
    frame_id = amount if absolute else before + amount
    frame[place] = (frame_id >> 8) & 0xFF
    frame[place + 1] = frame_id & 0xFF


@inlined
def resize(frame: Any, data: int, length: int, amount: int) -> int:
    """Lengthen the IO data by octets of zero, or cut them; the frame's new length."""
    end = max(data, min(length - TRAILER + amount, frame.shape[0] - TRAILER))
    trailer = length - TRAILER
    t0, t1, t2, t3 = frame[trailer], frame[trailer + 1], frame[trailer + 2], frame[trailer + 3]
    for i in range(trailer, end):
        frame[i] = 0
    frame[end] = t0
    frame[end + 1] = t1
    frame[end + 2] = t2
    frame[end + 3] = t3
    return end + TRAILER
