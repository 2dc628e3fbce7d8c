"""From the kernel's ring of captured frames to blocks of a pcapng file, in compiled code.

Only captures call this, never the tick.  Offsets are those of ``struct tpacket3_hdr`` and of the
``sockaddr_ll`` after it (linux/if_packet.h); the output is pcapng's enhanced packet blocks with flags.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import compiled

__all__ = ["ROOM_FACTOR", "pack_block"]

#: Octets of output per octet of a block, at most: 52 are added to a frame, where the ring has at least 82.
ROOM_FACTOR = 2

# In 32-bit words of a block's header.
_PACKETS, _FIRST = 3, 4
# In 32-bit words of a frame's header.
_NEXT, _SECONDS, _NANOSECONDS, _CAPTURED, _LENGTH, _STATUS = 0, 1, 2, 3, 4, 5
#: The lower half is the offset of the frame's first octet; then come tag control and, in the lower half, its protocol.
_MAC, _TAG, _TAG_PROTOCOL, _INDEX = 6, 8, 9, 13
# In octets of a frame's header.
_PACKET_TYPE, _HEADER = 58, 68
_VLAN_VALID, _TPID_VALID = 0x10, 0x40
_OUTGOING = 4
_ENHANCED_PACKET = 6
#: Block type, length, interface, stamp, lengths; flags option, end of options, length.
_BEFORE, _AFTER = 28, 16


@compiled
def pack_block(
    ring: Any,
    words: Any,
    start: int,
    numbers: Any,
    lowest: int,
    far_end: bool,
    out: Any,
    out_words: Any,
    counts: Any,
) -> int:
    """Write the frames of the block at ``start`` as packet blocks into ``out``; returns the number of octets.

    ``ring`` uint8[n] and ``words`` int32[n / 4] are the same memory, ``out`` uint8 and ``out_words`` uint32 too.
    ``numbers`` int32: pcapng interface of kernel interface ``lowest + i``, -1 for none.  ``counts`` int64 grows by
    the frames of each pcapng interface; its last element counts frames at impossible offsets.  ``far_end``: the
    interfaces are the other ends of the drives' cables, so that directions are reversed.
    """
    base = start // 4
    place = start + int(words[base + _FIRST])
    position = 0
    for _ in range(words[base + _PACKETS]):
        if place < start or place + _HEADER > ring.shape[0]:
            counts[counts.shape[0] - 1] += 1
            break
        head = place // 4
        captured = int(words[head + _CAPTURED])
        source = place + (int(words[head + _MAC]) & 0xFFFF)
        tagged = int(words[head + _STATUS]) & _VLAN_VALID != 0 and captured >= 12
        size = captured + (4 if tagged else 0)
        padded = (size + 3) // 4 * 4
        index = int(words[head + _INDEX]) - lowest
        if source + captured > ring.shape[0] or position + _BEFORE + padded + _AFTER > out.shape[0]:
            counts[counts.shape[0] - 1] += 1
        elif 0 <= index < numbers.shape[0] and numbers[index] >= 0:
            number = int(numbers[index])
            stamp = int(words[head + _SECONDS]) * 1_000_000_000 + int(words[head + _NANOSECONDS])
            to = position // 4
            total = _BEFORE + padded + _AFTER
            out_words[to] = _ENHANCED_PACKET
            out_words[to + 1] = total
            out_words[to + 2] = number
            out_words[to + 3] = stamp >> 32
            out_words[to + 4] = stamp & 0xFFFFFFFF
            out_words[to + 5] = size
            out_words[to + 6] = int(words[head + _LENGTH]) + (4 if tagged else 0)
            data = position + _BEFORE
            if tagged:
                for i in range(12):
                    out[data + i] = ring[source + i]
                protocol = 0x8100
                if int(words[head + _STATUS]) & _TPID_VALID:
                    protocol = int(words[head + _TAG_PROTOCOL]) & 0xFFFF
                tag = int(words[head + _TAG])
                out[data + 12] = protocol >> 8
                out[data + 13] = protocol & 0xFF
                out[data + 14] = (tag >> 8) & 0xFF
                out[data + 15] = tag & 0xFF
                for i in range(12, captured):
                    out[data + 4 + i] = ring[source + i]
            else:
                for i in range(captured):
                    out[data + i] = ring[source + i]
            for i in range(size, padded):
                out[data + i] = 0
            outgoing = (ring[place + _PACKET_TYPE] == _OUTGOING) != far_end
            end = (data + padded) // 4
            # option 2 (flags), four octets: 1 inbound, 2 outbound; then the end of the options
            out_words[end] = 0x00040002
            out_words[end + 1] = 2 if outgoing else 1
            out_words[end + 2] = 0
            out_words[end + 3] = total
            position += total
            counts[number] += 1
        step = int(words[head + _NEXT])
        if step <= 0:
            break
        place += step
    return position
