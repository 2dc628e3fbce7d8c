"""Counters of the drive's interface (Ethernet Link object, attribute 4), from its power-on.

Explicit messages count as the octets of their streams and datagrams; the frames of TCP itself are the kernel's and are
not in it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.buses.ethernetip.device.channels import StationChannels

__all__ = ["Traffic"]


class Traffic:
    """``channels`` knows the cyclic packets, all of unicast or multicast."""

    def __init__(self, channels: StationChannels) -> None:
        self._channels = channels
        self._before = channels.packets()
        self.octets_in = self.octets_out = 0
        self.messages_in = self.messages_out = 0
        self.broadcasts_in = 0

    def received(self, octets: int, *, broadcast: bool = False) -> None:
        self.octets_in += octets
        if broadcast:
            self.broadcasts_in += 1
        else:
            self.messages_in += 1

    def sent(self, octets: int) -> None:
        self.octets_out += octets
        self.messages_out += 1

    def counters(self) -> list[int]:
        """Octets, unicast and other packets, discards, errors and unknown protocols received; the same sent."""
        now = self._channels.packets()
        octets_in, taken, octets_out, sent, multicast = (new - old for new, old in zip(now, self._before, strict=True))
        return [
            self.octets_in + octets_in, self.messages_in + taken, self.broadcasts_in, 0, 0, 0,
            self.octets_out + octets_out, self.messages_out + sent, multicast, 0, 0,
        ]  # fmt: skip
