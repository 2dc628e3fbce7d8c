"""How often one station may ask a drive for a connection before the drive stops listening to it for a while.

A Connect is the dearest thing that a stranger can ask of a drive.  No controller needs one many times a second; who
sends more is a flood, and its further datagrams cost next to nothing: they are not even parsed.  Each station has a
budget of its own, so that the controller gets in at once however loud another one is.
"""

from __future__ import annotations

from pnfarm.protocols.profinet.wire.rpc import RPC_PORT
from pnfarm.wire.ethernet import ETHERTYPE_IPV4

__all__ = ["CONNECTS", "SOURCES", "WINDOW_NS", "ConnectBudget"]

#: Connects of one station in one window, which are served.
CONNECTS = 20
WINDOW_NS = 1_000_000_000
#: Stations that are counted in one window; further ones are served.
SOURCES = 64

_IPV4 = ETHERTYPE_IPV4.to_bytes(2, "big")
_UDP = 17
_PORT = RPC_PORT.to_bytes(2, "big")
#: An untagged frame with an IPv4 header without options: its version and length, its protocol, UDP's destination port.
_HEAD, _PROTOCOL, _DESTINATION = 14, 23, slice(36, 38)
_PLAIN_HEAD = 0x45


class ConnectBudget:
    """Of one drive."""

    def __init__(self) -> None:
        self._began_ns = 0
        self._counts: dict[bytes, int] = {}

    def note(self, mac: bytes, now: int) -> None:
        """A Connect came from this station."""
        self._turn(now)
        if mac in self._counts or len(self._counts) < SOURCES:
            self._counts[mac] = self._counts.get(mac, 0) + 1

    def passes(self, frame: bytes, now: int) -> bool:
        """Whether the frame is to be looked at: false for a call of a station that asked too often."""
        if self._counts.get(frame[6:12], 0) <= CONNECTS:
            return True
        self._turn(now)
        return not self._counts or not _is_call(frame)

    def _turn(self, now: int) -> None:
        if now - self._began_ns >= WINDOW_NS:
            self._began_ns = now
            self._counts.clear()


def _is_call(frame: bytes) -> bool:
    """Whether the frame is a datagram for the port of calls."""
    return (
        len(frame) >= _DESTINATION.stop
        and frame[12:14] == _IPV4
        and frame[_HEAD] == _PLAIN_HEAD
        and frame[_PROTOCOL] == _UDP
        and frame[_DESTINATION] == _PORT
    )
