"""Ethernet II frames with at most one 802.1Q tag (IEEE 802.3-2018 clause 3, IEEE 802.1Q-2018 clause 9).

A frame here begins with the destination address and ends before the frame check sequence.
"""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.wire.octets import Reader, Writer
from pnfarm.wire.value import value_class

__all__ = [
    "ETHERTYPE_ARP",
    "ETHERTYPE_IPV4",
    "ETHERTYPE_LLDP",
    "ETHERTYPE_PROFINET",
    "ETHERTYPE_SERVICE_VLAN",
    "ETHERTYPE_VLAN",
    "HEADER_LENGTH",
    "EthernetFrame",
    "VlanTag",
    "emit_ethernet",
    "parse_ethernet",
]

ETHERTYPE_IPV4 = 0x0800
ETHERTYPE_ARP = 0x0806
ETHERTYPE_VLAN = 0x8100
#: The outer tag of two (IEEE 802.1Q-2018, 9.5).
ETHERTYPE_SERVICE_VLAN = 0x88A8
ETHERTYPE_PROFINET = 0x8892
ETHERTYPE_LLDP = 0x88CC

HEADER_LENGTH = 14
#: Minimum frame length in octets, without the check sequence (64 with it).
MINIMUM_LENGTH = 60


@dataclass(frozen=True, slots=True)
class VlanTag:
    """Tag control information: priority 0..7, drop eligible, VLAN identifier 0..4095 (0: priority only)."""

    priority: int = 0
    dei: bool = False
    vid: int = 0


@value_class
class EthernetFrame:
    """One frame.

    ``ethertype`` below 0x0600 is the length field of an IEEE 802.3 frame and stays a plain number here.
    ``payload`` of a received frame may end with padding: the protocol above knows its own length.
    """

    destination: bytes
    source: bytes
    ethertype: int
    payload: bytes
    vlan: VlanTag | None = None


def parse_ethernet(data: bytes | bytearray | memoryview) -> EthernetFrame:
    """Frame from octets; :class:`~pnfarm.errors.DecodeError` (``short``) when a header is cut off."""
    reader = Reader(data)
    destination = reader.bytes(6)
    source = reader.bytes(6)
    ethertype = reader.u16()
    vlan = None
    if ethertype == ETHERTYPE_VLAN:
        control = reader.u16()
        vlan = VlanTag(priority=control >> 13, dei=bool(control & 0x1000), vid=control & 0x0FFF)
        ethertype = reader.u16()
    return EthernetFrame(destination, source, ethertype, reader.rest(), vlan)


def emit_ethernet(frame: EthernetFrame) -> bytes:
    """Octets of a frame, padded with zeros to 60; :class:`ValueError` when a field does not fit."""
    if len(frame.destination) != 6 or len(frame.source) != 6:
        raise ValueError("a MAC address has six octets")
    writer = Writer().bytes(frame.destination).bytes(frame.source)
    if frame.vlan is not None:
        tag = frame.vlan
        if not (0 <= tag.priority <= 7 and 0 <= tag.vid <= 0x0FFF):
            raise ValueError(f"{tag} does not fit: priority 0 to 7, VLAN identifier 0 to 4095")
        writer.u16(ETHERTYPE_VLAN).u16(tag.priority << 13 | tag.dei << 12 | tag.vid)
    writer.u16(frame.ethertype).bytes(frame.payload)
    return writer.zeros(max(0, MINIMUM_LENGTH - len(writer))).getvalue()
