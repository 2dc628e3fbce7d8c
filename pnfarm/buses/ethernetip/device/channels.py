"""The cyclic connections of one station as rows of the channel tables."""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.engine.channels.class1_plan import Class1ConsumerPlan, Class1ProviderPlan
from pnfarm.engine.channels.closed_channels import ClosedChannels
from pnfarm.protocols.enip.connection import ConnectionKind
from pnfarm.protocols.enip.wire.forward_open import Priority
from pnfarm.wire.mac import multicast_mac

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.buses.ethernetip.device.kind import Kind
    from pnfarm.engine.channels.impairments import ImpairmentTable
    from pnfarm.engine.channels.schedule import ChannelTable
    from pnfarm.protocols.enip.connection import Connection
    from pnfarm.station.node import StationPort

__all__ = ["IoChannels", "StationChannels", "channel_rows"]

_NS_PER_US = 1000
#: Attributes of the QoS object by the connection's priority (CIP volume 2, 5-7.4).
_DSCP = {Priority.URGENT: 4, Priority.SCHEDULED: 5, Priority.HIGH: 6, Priority.LOW: 7}
#: Octets of a class 1 packet in front of its data: Ethernet, IPv4, UDP, items, sequence count.
_HEADERS = 14 + 20 + 8 + 2 + 12 + 4 + 2
#: Drives with the same interval send in different ticks of the engine.
_SPREAD_NS = 1_000_000


def channel_rows(io_connections: int) -> int:
    """Rows that a drive owns in each channel table: one for each connection, and one for one that is closing."""
    return io_connections + 1


@dataclass(slots=True)
class IoChannels:
    """One cyclic connection: its rows, None for no row."""

    connection: Connection
    consumer: int
    connected_ns: int
    provider: int | None = None
    established: bool = False

    @property
    def cycle_ns(self) -> int:
        """The originator's packet interval."""
        return self.connection.o_to_t_api_us * _NS_PER_US

    @property
    def production_ns(self) -> int:
        """The drive's packet interval."""
        return self.connection.t_to_o_api_us * _NS_PER_US

    @property
    def feeds(self) -> bool:
        """Whether the drive's set points come from here."""
        return self.connection.kind is ConnectionKind.EXCLUSIVE_OWNER

    @property
    def awaits_mac(self) -> bool:
        """Whether it is to produce and does not yet."""
        return self.connection.produces and self.provider is None


class StationChannels:
    """Opens and closes the rows of a drive's connections, by the connection's number.

    ``index`` is its process image, ``rows`` its share of each table, ``drift`` that of the drive's clock;
    ``closed`` holds the sums of closed rows.  ``next_hop`` gives a receiver's MAC address, None while it is not known;
    ``kind`` says what of the data is where.
    """

    def __init__(
        self,
        index: int,
        port: StationPort,
        channels: ChannelTable,
        impairments: ImpairmentTable,
        rows: int,
        next_hop: Callable[[int, IPv4Address], bytes | None],
        kind: Kind,
        drift: float = 0.0,
    ) -> None:
        self.open: dict[int, IoChannels] = {}
        self.closed = ClosedChannels()
        self._closed_packets = (0, 0, 0, 0, 0)
        self.address = IPv4Address(0)
        self.dscp: Mapping[int, int] = {}
        self.ttl = 1
        self._index = index
        self._port = port
        self.table = channels
        self._impairments = impairments
        self._rows = rows
        self._next_hop = next_hop
        self._kind = kind
        self._drift = drift

    def move(self, port: StationPort) -> None:
        """The station has another MAC address; no row is open."""
        self._port = port

    def room(self) -> bool:
        """Whether there are rows for one more; those of a closed one are free again after the engine's next tick."""
        return len(self.open) + self.table.resting(self._index) < self._rows

    def of_consumer(self, row: int) -> IoChannels | None:
        """The connection whose consumer has this row."""
        return next((one for one in self.open.values() if one.consumer == row), None)

    def add(self, connection: Connection, now: int) -> IoChannels:
        """A connection was opened: it is listened to; :meth:`produce` begins to send."""
        assert connection.offer is not None
        carried = self._kind.consumed(connection)
        row = self.table.open_consumer(
            Class1ConsumerPlan(
                image=self._index,
                port=self._port.index,
                destination=self._port.mac,
                destination_address=self.address,
                source_address=connection.originator,
                connection_id=connection.o_to_t_id,
                data_length=connection.consumed_octets,
                rpi_ns=connection.o_to_t_api_us * _NS_PER_US,
                multiplier=4 << connection.timeout_multiplier,
                words=carried.words,
                pieces=carried.pieces,
                plain=self._kind.plain_row,
                run_idle=connection.offer.consumes_header,
                feeds=connection.kind is ConnectionKind.EXCLUSIVE_OWNER,
                drift=self._drift,
            )
        )
        self._impairments.channel_opened(self._index, "in", row)
        found = self.open[connection.number] = IoChannels(connection, row, now)
        self.produce(found)
        return found

    def produce(self, channels: IoChannels) -> bool:
        """Begin to send, if the connection produces; False while the receiver's MAC address is not known."""
        connection = channels.connection
        if not channels.awaits_mac:
            return True
        assert connection.offer is not None
        address, udp_port = connection.destination
        mac = multicast_mac(address) if connection.multicast else self._next_hop(self._port.index, address)
        if mac is None:
            return False
        rpi_ns = channels.production_ns
        carried = self._kind.produced(connection)
        row = self.table.open_provider(
            Class1ProviderPlan(
                image=self._index,
                port=self._port.index,
                destination=mac,
                source=self._port.mac,
                destination_address=address,
                source_address=self.address,
                connection_id=connection.t_to_o_id,
                data_length=connection.produced_octets,
                rpi_ns=rpi_ns,
                words=carried.words,
                pieces=carried.pieces,
                plain=self._kind.plain_row,
                run_idle=connection.offer.produced_header,
                phase_ns=self._index * _SPREAD_NS % rpi_ns,
                ttl=self.ttl if connection.multicast else 64,
                tos=self.dscp.get(_DSCP[Priority(connection.priority)], 0) << 2,
                destination_port=udp_port,
                drift=self._drift,
            )
        )
        channels.provider = row
        self._impairments.channel_opened(self._index, "out", row)
        return True

    def hand_over(self, source: IoChannels, heir: IoChannels) -> None:
        """A multicast production goes on for another connection, with its counts."""
        heir.provider, source.provider = source.provider, None

    def remove(self, number: int) -> IoChannels | None:
        """A connection has ended."""
        if number not in self.open:
            return None
        self._closed_packets = self._with_packets(self._closed_packets, self.open[number])
        channels = self.open.pop(number)
        if channels.provider is not None:
            self._impairments.channel_closed(self._index, "out", channels.provider)
            self.table.close_provider(channels.provider)
            self.closed.add_provider(self.table, channels.provider)
        self._impairments.channel_closed(self._index, "in", channels.consumer)
        self.table.close_consumer(channels.consumer)
        self.closed.add_consumer(self.table, channels.consumer)
        return channels

    def packets(self) -> tuple[int, int, int, int, int]:
        """Cyclic packets: octets and number received; octets, number by unicast and number by multicast sent."""
        total = self._closed_packets
        for channels in self.open.values():
            total = self._with_packets(total, channels)
        return total

    def _with_packets(
        self, total: tuple[int, int, int, int, int], channels: IoChannels
    ) -> tuple[int, int, int, int, int]:
        octets_in, taken, octets_out, unicast, multicast = total
        consumer = self.table.columns.cpm[channels.consumer]
        headers = _HEADERS + 4 * int(consumer.run_idle)
        octets_in += int(consumer.received) * (int(consumer.data_length) + headers)
        taken += int(consumer.received)
        if channels.provider is not None:
            provider = self.table.columns.ppm[channels.provider]
            sent = int(provider.sent)
            octets_out += sent * int(provider.length)
            if channels.connection.multicast:
                multicast += sent
            else:
                unicast += sent
        return octets_in, taken, octets_out, unicast, multicast
