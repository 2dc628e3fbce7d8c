"""The framing of CIP's implicit messages, transport class 1, over UDP (CIP vol. 2, chapter 3; vol. 1, chapter 3).

==================  ====================================================================================
Ethernet header     14 octets, 18 with a VLAN tag
IPv4 header         20 octets, more with options
UDP header          8 octets, destination port 2222
item count          2 octets: 2, more if items follow that nobody reads here
address item        type 0x8002, length 8, connection id 4 octets, sequence number 4 octets: one more each packet
data item           type 0x00B1, length
sequence count      2 octets: one more with new data
run/idle header     4 octets, only if the connection has one (from the originator): bit 0 is set in RUN
data
==================  ====================================================================================

The numbers of the encapsulation and the data are little-endian.  *Place* is the offset of the connection id, *data*
that of the first octet after the headers.

A packet whose sequence number is not ahead of the last one's is old or a duplicate, and dropped.  One that repeats the
sequence *count* keeps the connection alive, and its data are not taken (vol. 1, 3-4.3: the same count is a duplicate).
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.signed import signed
from pnfarm.table.channel import DISCARD_CHECKSUM, DISCARD_COUNTER, RUN, STATUS_RUN, W_START
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.impairment import SEQUENCE_COUNT, SEQUENCE_NUMBER
from pnfarm.wire.ethernet import ETHERTYPE_IPV4, ETHERTYPE_VLAN

__all__ = [
    "CLASS1_PORT", "COUNT", "DATA_ITEM", "LEAST_PLACE", "RUN_IDLE", "change_count", "change_id", "change_status",
    "comes_from", "count_of", "elapsed", "fits", "identity", "locate", "mend", "provider_ran", "provider_runs",
    "refused", "repeats", "resize", "seal", "start", "take",
]  # fmt: skip

#: UDP port of implicit messages (0x08AE), registered with IANA.
CLASS1_PORT = 2222
#: Types and lengths of the items (CIP vol. 2, 2-6).
ADDRESS_ITEM = 0x8002
ADDRESS_LENGTH = 8
DATA_ITEM = 0x00B1
#: Octets of Ethernet header, VLAN tag, shortest IPv4 header, UDP header, item count, type and length of an item.
HEADER = 14
TAG = 4
IPV4 = 20
UDP = 8
ITEM_COUNT = 2
ITEM = 4
#: Octets of the sequence count, and of the run/idle header.
COUNT = 2
RUN_IDLE = 4
#: From the UDP header to the connection id.
TO_PLACE = UDP + ITEM_COUNT + ITEM
#: No connection id is further ahead in a frame; every frame id of a real-time frame is.
LEAST_PLACE = HEADER + IPV4 + TO_PLACE
PROTOCOL_UDP = 17


@inlined
def _big(frame: Any, place: int) -> int:
    return int((signed(frame[place]) << 8) | signed(frame[place + 1]))


@inlined
def _little(frame: Any, place: int) -> int:
    return int(signed(frame[place]) | (signed(frame[place + 1]) << 8))


@inlined
def _little32(frame: Any, place: int) -> int:
    return int(_little(frame, place) | (_little(frame, place + 2) << 16))


@inlined
def _put_big(frame: Any, place: int, value: int) -> None:
    frame[place] = (value >> 8) & 0xFF
    frame[place + 1] = value & 0xFF


@inlined
def _put_little(frame: Any, place: int, value: int) -> None:
    frame[place] = value & 0xFF
    frame[place + 1] = (value >> 8) & 0xFF


@inlined
def _put_little32(frame: Any, place: int, value: int) -> None:
    _put_little(frame, place, value & 0xFFFF)
    _put_little(frame, place + 2, (value >> 16) & 0xFFFF)


@inlined
def _network(frame: Any) -> int:
    """Offset of the IPv4 header; a frame shorter than that has none."""
    return HEADER + TAG if _big(frame, 12) == ETHERTYPE_VLAN else HEADER


# a received frame


@compiled
def locate(frame: Any, length: int) -> int:
    """Offset of the connection id in a received frame; 0 for a frame of another kind, or one cut short."""
    if length < LEAST_PLACE + ADDRESS_LENGTH + ITEM or length > frame.shape[0]:
        return 0
    start = _network(frame)
    if _big(frame, start - 2) != ETHERTYPE_IPV4:
        return 0
    first = signed(frame[start])
    header = (first & 0x0F) * 4
    udp = start + header
    place = udp + TO_PLACE
    if first >> 4 != 4 or header < IPV4 or length < place + ADDRESS_LENGTH + ITEM:
        return 0
    whole = _big(frame, start + 2)
    datagram = _big(frame, udp + 4)
    # a part of a datagram has an offset or more after it
    if frame[start + 9] != PROTOCOL_UDP or (_big(frame, start + 6) & 0x3FFF) != 0 or start + whole > length:
        return 0
    if _big(frame, udp + 2) != CLASS1_PORT or datagram != whole - header:
        return 0
    if udp + datagram < place + ADDRESS_LENGTH + ITEM or _little(frame, udp + UDP) < 2:
        return 0
    known = _little(frame, place - 4) == ADDRESS_ITEM and _little(frame, place - 2) == ADDRESS_LENGTH
    return int(place) if known else 0


@inlined
def identity(frame: Any, place: int) -> int:
    """The connection id."""
    return _little32(frame, place)


@compiled
def fits(consumer: Any, frame: Any, length: int, place: int) -> int:
    """Offset of the data; 0 for a packet without a data item of the agreed length."""
    item = place + ADDRESS_LENGTH
    if item + ITEM > length:
        return 0
    end = place - TO_PLACE + _big(frame, place - TO_PLACE + 4)
    headers = COUNT + RUN_IDLE * signed(consumer.run_idle)
    size = _little(frame, item + 2)
    if _little(frame, item) != DATA_ITEM or size != headers + signed(consumer.data_length):
        return 0
    data = item + ITEM + headers
    return int(data) if item + ITEM + size <= end <= length else 0


@compiled
def comes_from(consumer: Any, frame: Any) -> bool:
    """Whether a packet has the addresses of the connection; the sender's MAC address may be a router's."""
    start = _network(frame)
    source = (_big(frame, start + 12) << 16) | _big(frame, start + 14)
    address = (_big(frame, start + 16) << 16) | _big(frame, start + 18)
    return bool(source == consumer.source and address == consumer.address)


@inlined
def _item(channel: Any, data: int) -> int:
    """Offset of the sequence count in front of the data."""
    return int(data - COUNT - RUN_IDLE * signed(channel.run_idle))


@inlined
def _sequence(channel: Any, frame: Any, data: int) -> int:
    return _little32(frame, _item(channel, data) - ITEM - 4)


@inlined
def _sum(frame: Any, first: int, last: int) -> int:
    """Sum of the big-endian words from ``first`` up to ``last``; a single octet at the end counts as one with zero."""
    total = 0
    for place in range(first, last - 1, 2):
        total += _big(frame, place)
    if (last - first) & 1:
        total += int(signed(frame[last - 1]) << 8)
    return total


@inlined
def _folded(total: int) -> int:
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return total


@inlined
def _intact(frame: Any, udp: int) -> bool:
    """Whether the checksums of both headers hold.

    A datagram may have none, or one that only covers the pseudo header: the rest was left to a network card that the
    datagram never passed (veth).
    """
    start = _network(frame)
    if _folded(_sum(frame, start, udp)) != 0xFFFF:
        return False
    field = _big(frame, udp + 6)
    if field == 0:
        return True
    size = _big(frame, udp + 4)
    pseudo = _sum(frame, start + 12, start + 20) + PROTOCOL_UDP + size
    return bool(field == _folded(pseudo) or _folded(pseudo + _sum(frame, udp, udp + size)) == 0xFFFF)


@compiled
def refused(consumer: Any, frame: Any, length: int, data: int) -> int:  # noqa: ARG001 - as in every framing
    """Why a packet is not taken: an index of ``CPM.discarded``, -1 if it is."""
    if not _intact(frame, _item(consumer, data) - ITEM - ADDRESS_LENGTH - TO_PLACE):
        return DISCARD_CHECKSUM
    if consumer.state == W_START:
        # it has timed out: nothing brings it back, the station closes it
        return DISCARD_COUNTER
    if consumer.state == RUN:
        ahead = (_sequence(consumer, frame, data) - signed(consumer.sequence)) & 0xFFFFFFFF
        if ahead == 0 or ahead > 0x7FFFFFFF:
            return DISCARD_COUNTER
    return -1


@inlined
def repeats(consumer: Any, frame: Any, data: int) -> bool:
    """Whether a packet brings the data of the one before once more."""
    return bool(consumer.state == RUN and _little(frame, _item(consumer, data)) == consumer.counter)


@inlined
def provider_runs(consumer: Any, frame: Any, length: int, data: int) -> int:  # noqa: ARG001 - as in every framing
    """Whether the sender is in RUN; one without a header always is."""
    return int(signed(frame[data - RUN_IDLE]) & 1) if consumer.run_idle else 1


@inlined
def provider_ran(consumer: Any) -> int:
    """The same for the packet that was taken last."""
    return int(consumer.data_status)


@inlined
def elapsed(consumer: Any, frame: Any, length: int, data: int) -> int:  # noqa: ARG001 - as in every framing
    """Time by the sender's sequence count since the packet that was taken last, ns."""
    ahead = (_little(frame, _item(consumer, data)) - signed(consumer.counter)) & 0xFFFF
    return int(ahead * consumer.cycle_ns)


@inlined
def take(consumer: Any, frame: Any, length: int, data: int) -> None:
    """Store what the next packet is compared with."""
    if repeats(consumer, frame, data):
        consumer.repeated += 1
    else:
        consumer.data_status = provider_runs(consumer, frame, length, data)
    consumer.sequence = _sequence(consumer, frame, data)
    consumer.counter = _little(frame, _item(consumer, data))


# a frame to send


@compiled
def _finish(frame: Any, start: int, udp: int, length: int) -> None:
    """Both checksums.  A datagram whose length a fault has changed ends with the frame at the latest."""
    _put_big(frame, start + 10, 0)
    _put_big(frame, start + 10, 0xFFFF ^ _folded(_sum(frame, start, udp)))
    size = _big(frame, udp + 4)
    _put_big(frame, udp + 6, 0)
    end = min(udp + size, length)
    total = _sum(frame, start + 12, start + 20) + PROTOCOL_UDP + size + _sum(frame, udp, end)
    checksum = 0xFFFF ^ _folded(total)
    # zero on the wire means: no checksum
    _put_big(frame, udp + 6, checksum or 0xFFFF)


@inlined
def _datagram(provider: Any) -> int:
    """Offset of the UDP header."""
    return _item(provider, signed(provider.data_offset)) - ITEM - ADDRESS_LENGTH - TO_PLACE


@compiled
def start(provider: Any) -> None:
    """A new connection counts from 1."""
    provider.sequence = 0
    provider.counter = 0


@inlined
def seal(provider: Any, frame: Any) -> None:
    """Both sequences, the run/idle header, identification and checksums of a packet before it is sent."""
    data = signed(provider.data_offset)
    item = _item(provider, data)
    provider.sequence = (signed(provider.sequence) + 1) & 0xFFFFFFFF
    provider.counter = (signed(provider.counter) + 1) & 0xFFFF
    _put_little32(frame, item - ITEM - 4, signed(provider.sequence))
    _put_little(frame, item, signed(provider.counter))
    if provider.run_idle:
        frame[data - RUN_IDLE] = 1 if int(provider.data_status) & STATUS_RUN else 0
    _put_big(frame, HEADER + 4, (_big(frame, HEADER + 4) + 1) & 0xFFFF)
    _finish(frame, HEADER, _datagram(provider), signed(provider.length))


# changes of a complete frame


@inlined
def count_of(provider: Any, frame: Any, which: int) -> int:
    """The sequence number, or the sequence count."""
    data = signed(provider.data_offset)
    if which == SEQUENCE_COUNT:
        return _little(frame, _item(provider, data))
    return _sequence(provider, frame, data)


@inlined
def change_count(provider: Any, frame: Any, length: int, count: int, which: int) -> None:
    """Write the sequence number or the sequence count; for both, the number, and move the count by as much."""
    item = _item(provider, signed(provider.data_offset))
    if which == SEQUENCE_COUNT:
        _put_little(frame, item, count & 0xFFFF)
    else:
        moved = count - _little32(frame, item - ITEM - 4)
        _put_little32(frame, item - ITEM - 4, count & 0xFFFFFFFF)
        if which != SEQUENCE_NUMBER:
            _put_little(frame, item, (_little(frame, item) + moved) & 0xFFFF)
    _finish(frame, HEADER, _datagram(provider), length)


@inlined
def change_status(provider: Any, frame: Any, length: int, bit: int) -> None:
    """Clear the bit of RUN in the run/idle header, if there is one; there is no other."""
    if provider.run_idle and bit == STATUS_RUN:
        frame[signed(provider.data_offset) - RUN_IDLE] &= 0xFE
        _finish(frame, HEADER, _datagram(provider), length)


@inlined
def change_id(provider: Any, frame: Any, length: int, amount: int, absolute: bool) -> None:
    """Add to the connection id, or write it."""
    place = _item(provider, signed(provider.data_offset)) - ITEM - ADDRESS_LENGTH
    wanted = amount if absolute else _little32(frame, place) + amount
    _put_little32(frame, place, wanted & 0xFFFFFFFF)
    _finish(frame, HEADER, _datagram(provider), length)


@inlined
def resize(provider: Any, frame: Any, length: int, amount: int) -> int:
    """Lengthen the data by octets of zero, or cut them; the frame's new length."""
    data = signed(provider.data_offset)
    end = max(data, min(length + amount, frame.shape[0]))
    for place in range(length, end):
        frame[place] = 0
    item, udp = _item(provider, data), _datagram(provider)
    _put_little(frame, item - 2, end - item)
    _put_big(frame, udp + 4, end - udp)
    _put_big(frame, HEADER + 2, end - HEADER)
    _finish(frame, HEADER, udp, end)
    return int(end)


@inlined
def mend(frame: Any, length: int) -> None:
    """Both checksums of an IPv4 frame with UDP as its present octets want them; a checksum of 0 stays none."""
    start = _network(frame)
    udp = start + (signed(frame[start]) & 0x0F) * 4
    if _big(frame, start - 2) != ETHERTYPE_IPV4 or udp < start + IPV4 or udp + UDP > length:
        return
    size = _big(frame, udp + 4)
    if frame[start + 9] == PROTOCOL_UDP and _big(frame, udp + 6) != 0 and size >= UDP and udp + size <= length:
        _finish(frame, start, udp, length)
        return
    _put_big(frame, start + 10, 0)
    _put_big(frame, start + 10, 0xFFFF ^ _folded(_sum(frame, start, udp)))
