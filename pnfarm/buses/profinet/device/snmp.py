"""What a station shows to SNMP managers: its identity, its interfaces with their counters, its LLDP data.

The interfaces are numbered as PROFINET managers are used to: port *n* is interface *n*, as in its LLDP frames, and the
device's own interface, with the IP address, comes behind the ports (assumed: the standard leaves the numbers to the
device).  One cable leads to a virtual drive, at port 1; further ports have no link.  Ports have the interface's MAC
address (assumed: the numbers behind it may be the next drive's).

Counters start at power-on and count what reached the station: frames that the farm passed over for all drives alike,
such as an Identify for another one, are not among them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.device.neighbours import port_numbers
from pnfarm.buses.profinet.device.snmp_neighbours import management_view
from pnfarm.protocols.profinet.mib_view import (
    ADMIN_DISABLED,
    ADMIN_TX_AND_RX,
    InterfaceCounters,
    InterfaceView,
    LldpPortStatistics,
    LldpPortView,
    LldpView,
    PnoPort,
    SnmpView,
    SystemText,
    SystemView,
    system_description,
)
from pnfarm.table.channel import DISCARD_IMPAIRED, DISCARDS
from pnfarm.wire.mac import BROADCAST, is_group

if TYPE_CHECKING:
    from pnfarm.buses.profinet.device.channels import ArChannels, StationChannels
    from pnfarm.buses.profinet.device.neighbours import StationNeighbours
    from pnfarm.buses.profinet.device.station import DriveStation
    from pnfarm.engine.schedule import ChannelTable

__all__ = ["PortTraffic", "snmp_view"]

#: Octets of the shortest frame, and of the frame check sequence that no counter here has seen.
_SHORTEST, _FCS = 60, 4
#: Octets of a cyclic frame around its IO data: addresses and EtherType, frame id, APDU status.
_CYCLIC_ENVELOPE = 14 + 2 + 4
#: The optional TLVs: port description, system name, description and capabilities.
_EVERY_TLV = b"\xf0"
#: The first interface's subslot (IEC 61158-6-10, coding of SubslotNumber).
_INTERFACE = 0x8000

# Reasons of DriveStation.discards(), in the words of ifTable; what stands in none of these is ifInDiscards.
#: For somebody else: a network controller would not have passed it on.
_NOT_OURS = frozenset(
    {"other-destination", "other-address", "arp-for-another", "identify-for-another", "filter", "hello", "no-address"}
)
_UNKNOWN_PROTOCOL = frozenset({"other-protocol", "ipv4-protocol"})
_NOT_SENT = frozenset({"no-route", "unresolved", "queue-full", "address-changed"})
#: Ends of the reasons of malformed frames.
_ERRORS = ("short", "-length", "-checksum", "trailing")


class PortTraffic:
    """Frames and octets of one station's port since power-on; see the module's head."""

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
        """Take over what the rows of an AR counted, before others use them."""
        received, received_octets, sent, sent_octets = self._cyclic(ar)
        self.received[0] += received
        self.received_octets += received_octets
        self.sent[0] += sent
        self.sent_octets += sent_octets

    def counters(self, discards: dict[str, int]) -> InterfaceCounters:
        """All counters now; ``discards`` are the station's, those of cyclic frames are read here."""
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
        """The discards with those of cyclic frames; what a fault took on the line did not come to the port."""
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


def snmp_view(station: DriveStation, now: int) -> SnmpView:
    """The station at ``now``; it is powered.  Without LLDP its ports are shown as disabled.

    What LLDP-MIB tells of the station itself is what its frames say.
    """
    agent = station.neighbours
    im0 = station.description.im0
    description = system_description(
        station.description.station_type,
        im0.order_id,
        im0.serial_number,
        im0.hardware_revision,
        im0.software_revision[0],
        im0.software_revision[1:],
    )
    texts = station.snmp_texts
    name = texts.get(SystemText.NAME, station.name)
    system = SystemView(
        description=description,
        uptime_ns=max(0, now - station.booted_ns),
        contact=texts.get(SystemText.CONTACT, ""),
        name=name,
        location=texts.get(SystemText.LOCATION, ""),
    )
    mac = station.port.mac
    names = {s.subslot - _INTERFACE: s.name for s in station.model.dap.submodules}
    counters = station.traffic.counters(station.discards())
    numbers = port_numbers(station.description)
    index = numbers[-1] + 1
    interfaces = [
        InterfaceView(
            index=number,
            description=names.get(number) or f"Port {number}",
            name=f"port-{number:03}",
            mac=mac,
            up=number == numbers[0],
            counters=counters if number == numbers[0] else InterfaceCounters(),
        )
        for number in numbers
    ]
    interfaces.append(
        InterfaceView(
            index=index,
            description=names.get(0) or "Interface",
            name="interface",
            mac=mac,
            has_connector=False,
            counters=counters,
        )
    )
    own = agent.lldp.system
    chassis, port_id = own.chassis, own.port_id(agent.lldp.port)
    heard = station.neighbour_rows.views(agent.lldp.neighbours, numbers[0], station.booted_ns)
    lldp = LldpView(
        chassis_id=chassis.value,
        chassis_id_subtype=chassis.subtype,
        system_name=station.name,
        system_description=own.description,
        ports=tuple(
            LldpPortView(
                number=number,
                port_id=port_id.value if number == numbers[0] else f"port-{number:03}".encode(),
                description=agent.lldp.port.description if number == numbers[0] else f"port {number}",
                admin_status=ADMIN_TX_AND_RX if agent.enabled else ADMIN_DISABLED,
                tlvs_enabled=_EVERY_TLV if agent.enabled else b"\x00",
                pno=PnoPort(station_name=station.name),
                statistics=_lldp_statistics(agent) if number == numbers[0] else LldpPortStatistics(),
            )
            for number in numbers
        ),
        addresses=(management_view(own.management),),
        neighbours=tuple(heard),
    )
    return SnmpView(system, lldp, tuple(interfaces))


def _lldp_statistics(agent: StationNeighbours) -> LldpPortStatistics:
    dropped = agent.lldp.dropped
    return LldpPortStatistics(
        tx_frames=agent.lldp.sent,
        rx_frames=agent.lldp.received + sum(dropped.values()),
        rx_frames_discarded=sum(dropped.values()),
        rx_frames_errors=sum(dropped.values()) - dropped["too-many-neighbours"] - dropped["own-frame"],
    )
