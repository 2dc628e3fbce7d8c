"""Captured frames, changed as another place or another network would have them, and written as a capture."""

from __future__ import annotations

from dataclasses import replace

from pnfarm.captures.reading import CapturedFrame
from pnfarm.wire.ethernet import ETHERTYPE_IPV4, ETHERTYPE_SERVICE_VLAN, ETHERTYPE_VLAN, parse_ethernet
from pnfarm.wire.ipv4 import PROTOCOL_UDP, emit_ipv4, parse_ipv4


def tagged(frame: CapturedFrame, *vids: int) -> CapturedFrame:
    """On a VLAN, or within another one's tag: the outer one first."""
    tags = b"".join(
        (ETHERTYPE_VLAN if last else ETHERTYPE_SERVICE_VLAN).to_bytes(2, "big") + (6 << 13 | vid).to_bytes(2, "big")
        for last, vid in ((number == len(vids) - 1, vid) for number, vid in enumerate(vids))
    )
    ether = parse_ethernet(frame.data)
    return replace(frame, data=frame.data[:12] + tags + ether.ethertype.to_bytes(2, "big") + ether.payload)


def in_fragments(frame: CapturedFrame, octets: int) -> list[CapturedFrame]:
    """A frame's datagram in IP fragments of so many octets, a multiple of 8; another frame as it is."""
    ether = parse_ethernet(frame.data)
    if ether.ethertype != ETHERTYPE_IPV4:
        return [frame]
    packet = parse_ipv4(ether.payload)
    if packet.protocol != PROTOCOL_UDP or len(packet.payload) <= octets:
        return [frame]
    # each packet has a number of its own
    number = frame.number & 0xFFFF
    parts = [
        replace(packet, identification=number, dont_fragment=False, fragment_offset=at,
                payload=packet.payload[at : at + octets], more_fragments=at + octets < len(packet.payload))
        for at in range(0, len(packet.payload), octets)
    ]  # fmt: skip
    head = frame.data[:12] + ETHERTYPE_IPV4.to_bytes(2, "big")
    return [replace(frame, data=head + emit_ipv4(part)) for part in parts]
