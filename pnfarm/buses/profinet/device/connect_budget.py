"""Limits how often one station may send Connect to a drive before the drive ignores it for a while.

Connect is the most expensive request that any station can send.  No controller needs many of them a second; beyond
the limit, a station's datagrams are dropped before they are parsed.  Each station has its own budget, so that a flood
from one does not delay the Connect of another.
"""

from __future__ import annotations

from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT
from pnfarm.wire.ethernet import ETHERTYPE_IPV4

__all__ = ["CONNECTS", "SOURCES", "WINDOW_NS", "ConnectBudget"]

#: Connects of one station that are served in one window.
CONNECTS = 20
WINDOW_NS = 1_000_000_000
#: Stations that are counted in one window; further ones are always served.
SOURCES = 64

_IPV4 = ETHERTYPE_IPV4.to_bytes(2, "big")
_UDP = 17
_PORT = RPC_PORT.to_bytes(2, "big")
#: An untagged frame with an IPv4 header without options: its version and length, its protocol, UDP's destination port.
_HEAD, _PROTOCOL, _DESTINATION = 14, 23, slice(36, 38)
_PLAIN_HEAD = 0x45


class ConnectBudget:
    """The budget of one drive."""

    def __init__(self) -> None:
        self._began_ns = 0
        self._counts: dict[bytes, int] = {}

    def note(self, mac: bytes, now: int) -> None:
        """Count a Connect of this station."""
        self._turn(now)
        if mac in self._counts or len(self._counts) < SOURCES:
            self._counts[mac] = self._counts.get(mac, 0) + 1

    def passes(self, frame: bytes, now: int) -> bool:
        """Whether to process the frame: false for a call of a station that used up its budget."""
        if self._counts.get(frame[6:12], 0) <= CONNECTS:
            return True
        self._turn(now)
        return not self._counts or not _is_call(frame)

    def _turn(self, now: int) -> None:
        if now - self._began_ns >= WINDOW_NS:
            self._began_ns = now
            self._counts.clear()


def _is_call(frame: bytes) -> bool:
    """Whether the frame is a datagram for the RPC port."""
    return (
        len(frame) >= _DESTINATION.stop
        and frame[12:14] == _IPV4
        and frame[_HEAD] == _PLAIN_HEAD
        and frame[_PROTOCOL] == _UDP
        and frame[_DESTINATION] == _PORT
    )
