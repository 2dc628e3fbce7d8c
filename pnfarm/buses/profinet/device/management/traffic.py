"""Frames and octets of a station's port, as ifTable counts them.

Counters start at power-on and count what reached the station: frames that the farm dropped for all drives at once,
such as an Identify for another station, are not included.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.snmp.view import InterfaceCounters
from pnfarm.table.channel import DISCARD_IMPAIRED, DISCARDS
from pnfarm.wire.mac import BROADCAST, is_group

if TYPE_CHECKING:
    from pnfarm.buses.profinet.device.ar_channels import ArChannels
    from pnfarm.buses.profinet.device.channels import StationChannels
    from pnfarm.engine.channels.schedule import ChannelTable

__all__ = ["PortTraffic"]

#: Octets of the shortest frame, and of the frame check sequence, which the farm never sees.
_SHORTEST, _FCS = 60, 4
#: Octets of a cyclic frame around its IO data: addresses and EtherType, frame id, APDU status.
_CYCLIC_ENVELOPE = 14 + 2 + 4

# The device's drop reasons by counter of ifTable; a reason in none of these counts as ifInDiscards.
#: For another station: a network controller would not have passed it on.
_NOT_OURS = frozenset(
    {"other-destination", "other-address", "arp-for-another", "identify-for-another", "filter", "hello", "no-address"}
)
_UNKNOWN_PROTOCOL = frozenset({"other-protocol", "ipv4-protocol"})
_NOT_SENT = frozenset({"no-route", "unresolved", "queue-full", "address-changed"})
#: Suffixes of the reasons of malformed frames.
_ERRORS = ("short", "-length", "-checksum", "trailing")


class PortTraffic:
    """Frames and octets of one station's port since power-on; see the module's docstring."""

    def __init__(self, table: ChannelTable, channels: StationChannels, discards: dict[str, int]) -> None:
        self._columns = table.columns
        self._channels = channels
        self._before = self._with_cyclic(discards)
        self.received = [0, 0, 0]  # unicast, multicast, broadcast
        self.sent = [0, 0, 0]
        self.received_octets = 0
        self.sent_octets = 0

    def frame_received(self, frame: bytes) -> None:
        self.received[_kind(frame)] += 1
        self.received_octets += max(len(frame), _SHORTEST) + _FCS

    def frame_sent(self, frame: bytes) -> None:
        self.sent[_kind(frame)] += 1
        self.sent_octets += max(len(frame), _SHORTEST) + _FCS

    def channels_closed(self, ar: ArChannels) -> None:
        """Add the counters of an AR's rows before the rows are reused."""
        received, received_octets, sent, sent_octets = self._cyclic(ar)
        self.received[0] += received
        self.received_octets += received_octets
        self.sent[0] += sent
        self.sent_octets += sent_octets

    def counters(self, discards: dict[str, int]) -> InterfaceCounters:
        """All counters; ``discards`` are the station's, those of cyclic frames are read here."""
        received, received_octets = self.received[0], self.received_octets
        sent, sent_octets = self.sent[0], self.sent_octets
        for ar in self._channels.ars.values():
            more = self._cyclic(ar)
            received, received_octets = received + more[0], received_octets + more[1]
            sent, sent_octets = sent + more[2], sent_octets + more[3]
        discarded, errors, unknown, not_sent = self._discards(self._with_cyclic(discards))
        return InterfaceCounters(
            in_octets=received_octets,
            in_unicast=received,
            in_multicast=self.received[1],
            in_broadcast=self.received[2],
            in_discards=discarded,
            in_errors=errors,
            in_unknown_protocols=unknown,
            out_octets=sent_octets,
            out_unicast=sent,
            out_multicast=self.sent[1],
            out_broadcast=self.sent[2],
            out_discards=not_sent,
        )

    def _cyclic(self, ar: ArChannels) -> tuple[int, int, int, int]:
        """Frames and octets received, frames and octets sent."""
        received = received_octets = sent = sent_octets = 0
        for row, _ in ar.consumers:
            consumer = self._columns.cpm[row]
            frames = int(consumer.received)
            received += frames
            received_octets += frames * (max(_CYCLIC_ENVELOPE + int(consumer.data_length), _SHORTEST) + _FCS)
        for row, _ in ar.providers:
            provider = self._columns.ppm[row]
            frames = int(provider.sent)
            sent += frames
            sent_octets += frames * (int(provider.length) + _FCS)
        return received, received_octets, sent, sent_octets

    def _with_cyclic(self, discards: dict[str, int]) -> dict[str, int]:
        """The discards with those of cyclic frames; what an injection dropped on the line never reached the port."""
        total = discards.copy()
        cyclic = self._channels.closed.discarded.copy()
        for ar in self._channels.ars.values():
            for row, _ in ar.consumers:
                cyclic += self._columns.cpm[row].discarded
        cyclic[DISCARD_IMPAIRED] = 0
        for reason, count in zip(DISCARDS, cyclic.tolist(), strict=True):
            total[reason] = total.get(reason, 0) + count
        return total

    def _discards(self, discards: dict[str, int]) -> tuple[int, int, int, int]:
        discarded = errors = unknown = not_sent = 0
        for reason, total in discards.items():
            count = total - self._before.get(reason, 0)
            if reason in _NOT_OURS:
                continue
            if reason in _UNKNOWN_PROTOCOL:
                unknown += count
            elif reason in _NOT_SENT:
                not_sent += count
            elif reason.endswith(_ERRORS):
                errors += count
            else:
                discarded += count
        return discarded, errors, unknown, not_sent


def _kind(frame: bytes) -> int:
    """0 for unicast, 1 for multicast, 2 for broadcast."""
    if frame[:6] == BROADCAST:
        return 2
    return 1 if frame and is_group(frame) else 0
