"""MAC addresses: six octets in memory, ``02:00:00:00:00:01`` for people (IEEE 802-2014, clause 8)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ipaddress import IPv4Address

__all__ = [
    "BROADCAST",
    "NIL",
    "format_mac",
    "is_group",
    "mac_from_int",
    "mac_to_int",
    "multicast_mac",
    "parse_mac",
]

#: Every station.
BROADCAST = b"\xff" * 6
#: No address: in ARP, "not known yet".
NIL = bytes(6)

_GROUP_BIT = 0x01
_TEXT = re.compile(r"[0-9A-Fa-f]{2}(?:(:[0-9A-Fa-f]{2}){5}|(-[0-9A-Fa-f]{2}){5})")


def parse_mac(text: str) -> bytes:
    """Six octets from six pairs of hexadecimal digits, separated by ``:`` or by ``-``.

    Raises :class:`ValueError` with a message for the user.
    """
    if not _TEXT.fullmatch(text):
        raise ValueError(f"{text!r} is not a MAC address: six pairs of hexadecimal digits like 02:00:00:00:00:01")
    return bytes.fromhex(text.replace(":", "").replace("-", ""))


def format_mac(mac: bytes) -> str:
    """``02:00:00:00:00:01``, lower case."""
    return mac.hex(":")


def mac_to_int(mac: bytes) -> int:
    """The address as a number, first octet highest, so that neighbours count up."""
    return int.from_bytes(mac, "big")


def mac_from_int(value: int) -> bytes:
    """Six octets from a number; :class:`ValueError` outside of 48 bits."""
    if not 0 <= value < 1 << 48:
        raise ValueError(f"{value:#x} does not fit in 48 bits")
    return value.to_bytes(6, "big")


def is_group(mac: bytes) -> bool:
    """Multicast or broadcast."""
    return bool(mac[0] & _GROUP_BIT)


def multicast_mac(group: IPv4Address) -> bytes:
    """The address of an IPv4 multicast group (RFC 1112, 6.4): its lower 23 bits after 01:00:5E."""
    return bytes.fromhex("01005e") + (int(group) & 0x7FFFFF).to_bytes(3, "big")
