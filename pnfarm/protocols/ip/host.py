"""A small IPv4 host: one interface, one address, UDP, no sockets.

A drive answers ARP, ping and UDP itself, so that it needs no address in the kernel, works on any link and can
be impaired in every reply.  It takes frames and time and returns frames and events; its owner calls
:meth:`IpHost.handle_timeout` at :meth:`IpHost.next_deadline`.

Next hop of a datagram, first match: a broadcast or multicast address; the source MAC address of a datagram from
this peer (also when the peer is behind a router); ARP for a peer in the own subnet; ARP for the gateway.
ARP requests are sent three times, one second apart.  Conflicts are detected (:mod:`pnfarm.protocols.ip.claim`) and
the address is defended as in RFC 5227: announced again, at most every ten seconds.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.ip.claim import AddressClaim, ClaimSign, ClaimState
from pnfarm.protocols.ip.neighbours import CAPACITY, NeighbourTable
from pnfarm.protocols.ip.reassembly import Reassembler
from pnfarm.wire.arp import OPERATION_REPLY, OPERATION_REQUEST, ArpPacket, emit_arp, parse_arp
from pnfarm.wire.ethernet import ETHERTYPE_ARP, ETHERTYPE_IPV4, EthernetFrame, emit_ethernet
from pnfarm.wire.icmp import TYPE_ECHO_REPLY, TYPE_ECHO_REQUEST, IcmpMessage, emit_icmp, parse_icmp
from pnfarm.wire.ipv4 import (
    HEADER_LENGTH,
    MAXIMUM_LENGTH,
    PROTOCOL_ICMP,
    PROTOCOL_UDP,
    Ipv4Packet,
    emit_ipv4,
    parse_ipv4,
)
from pnfarm.wire.mac import BROADCAST, NIL, is_group
from pnfarm.wire.udp import HEADER_LENGTH as UDP_HEADER_LENGTH
from pnfarm.wire.udp import ChecksumState, UdpDatagram, emit_udp, parse_udp, udp_checksum
from pnfarm.wire.value import value_class

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "ARP_INTERVAL_NS",
    "DEFEND_INTERVAL_NS",
    "MAXIMUM_DATA",
    "QUEUE_LIMIT",
    "AddressConflict",
    "AddressProbed",
    "AddressRefused",
    "AddressSettled",
    "DatagramReceived",
    "IpEvent",
    "IpHost",
]

#: Octets of the longest IPv4 packet in one frame.
MTU = 1500
#: Octets of the longest UDP datagram's data.
MAXIMUM_DATA = MAXIMUM_LENGTH - HEADER_LENGTH - UDP_HEADER_LENGTH
ARP_TRIES = 3
ARP_INTERVAL_NS = 10**9
#: Datagrams that wait for one next hop's address; a further one displaces the oldest.
QUEUE_LIMIT = 8
#: Next hops being resolved at a time.
RESOLUTION_LIMIT = 16
# RFC 5227, 1.1: PROBE_NUM, PROBE_MIN, DEFEND_INTERVAL.
PROBE_COUNT = 3
PROBE_INTERVAL_NS = 10**9
DEFEND_INTERVAL_NS = 10 * 10**9

_LIMITED_BROADCAST = IPv4Address("255.255.255.255")
_UNSPECIFIED = IPv4Address(0)


@value_class
class DatagramReceived:
    """A UDP datagram arrived at an open port."""

    source_ip: IPv4Address
    source_port: int
    destination_port: int
    data: bytes
    source_mac: bytes


@dataclass(frozen=True, slots=True)
class AddressConflict:
    """Another station uses the own address; at most one event per station in ten seconds."""

    ip: IPv4Address
    mac: bytes


@dataclass(frozen=True, slots=True)
class AddressProbed:
    """A probe ended: ``conflict_mac`` has the address, or no station (None)."""

    ip: IPv4Address
    conflict_mac: bytes | None


@dataclass(frozen=True, slots=True)
class AddressRefused:
    """Another station had the claimed address first: it is not used until that station is gone."""

    ip: IPv4Address
    mac: bytes


@dataclass(frozen=True, slots=True)
class AddressSettled:
    """The conflict is over: the host uses the address, no other station does."""

    ip: IPv4Address


IpEvent = DatagramReceived | AddressConflict | AddressProbed | AddressRefused | AddressSettled


@dataclass(slots=True)
class _Resolution:
    """ARP in progress for one next hop."""

    own: IPv4Address
    deadline: int
    tries: int = 1
    waiting: deque[list[Ipv4Packet]] = field(default_factory=deque)  # each item one datagram in its fragments


@dataclass(slots=True)
class _Probe:
    deadline: int
    sent: int = 1


class IpHost:
    """The IPv4 host of one interface. It has no address until :meth:`set_address`.

    ``neighbours`` bounds how many MAC addresses it remembers.
    """

    def __init__(self, mac: bytes, *, neighbours: int = CAPACITY) -> None:
        self.mac = mac
        #: UDP ports whose datagrams become events.
        self.open_ports: set[int] = set()
        #: What was not delivered or not sent, by reason.
        self.dropped: Counter[str] = Counter()
        self._address: IPv4Interface | None = None
        #: The last address without its subnet: `IPv4Interface.ip` makes a new object each time.
        self._own = _UNSPECIFIED
        self._gateway: IPv4Address | None = None
        self._claim = AddressClaim(mac)
        self._claimed: IPv4Interface | None = None
        self._neighbours = NeighbourTable(neighbours)
        self._reassembler = Reassembler(self.dropped)
        self._resolutions: dict[IPv4Address, _Resolution] = {}
        self._probes: dict[IPv4Address, _Probe] = {}
        self._conflicts: dict[bytes, int] = {}  # MAC -> when it was last reported
        self._defended: int | None = None
        self._identification = 0
        self._outbox: list[bytes] = []
        self._events: list[IpEvent] = []

    @property
    def address(self) -> IPv4Interface | None:
        """Own address and subnet."""
        return self._address

    @property
    def wanted(self) -> IPv4Interface | None:
        """The address in use, or the one to use once the station that has it now is gone."""
        return self._claimed

    @property
    def gateway(self) -> IPv4Address | None:
        """Router for everything outside of the subnet."""
        return self._gateway

    def set_address(self, address: IPv4Interface | None, gateway: IPv4Address | None = None) -> None:
        """Take an address and announce it, or give it up (None). Datagrams still waiting for ARP are dropped."""
        self._take(address, gateway)
        # the states after these signs have no timer
        self._follow(ClaimSign.GIVE_UP if address is None else ClaimSign.CONFIGURE, 0)

    def own_address(self, address: IPv4Interface | None, gateway: IPv4Address | None = None) -> None:
        """Set an address without announcing it, before the interface is up; :meth:`claim_address` announces it then."""
        self._take(address, gateway)

    def claim_address(self, address: IPv4Interface, gateway: IPv4Address | None, now: int) -> None:
        """Set an address and probe for it: another station that has it keeps it."""
        self._take(address, gateway)
        self._follow(ClaimSign.CLAIM, now)

    def _take(self, address: IPv4Interface | None, gateway: IPv4Address | None) -> None:
        self._drop_waiting(self._resolutions.values(), "address-changed")
        self._resolutions.clear()
        self._neighbours.clear()
        self._reassembler.clear()
        self._conflicts.clear()
        self._defended = None
        self._address = self._claimed = address
        self._gateway = gateway
        self._claim.ip = address.ip if address is not None else None
        self._own = self._claim.ip or _UNSPECIFIED

    def _follow(self, sign: ClaimSign, now: int, mac: bytes = NIL) -> None:
        """Pass an input to the claim and carry out its action; ``mac`` is the conflicting station."""
        action = self._claim.sign(sign, now)
        ip = self._claim.ip
        if ip is None:
            return
        match action:
            case "ask":
                self._send_arp(OPERATION_REQUEST, _UNSPECIFIED, NIL, ip, BROADCAST)
            case "announce":
                self._announce(ip)
            case "defend":
                self._conflict(ip, mac, now)
            case "refuse":
                self._drop_waiting(self._resolutions.values(), "address-refused")
                self._resolutions.clear()
                self._address = None
                self._events.append(AddressRefused(ip, mac))
            case "take":
                self._address = self._claimed
                self._announce(ip)
                self._events.append(AddressSettled(ip))
            case "settle":
                self._events.append(AddressSettled(ip))

    def learn(self, ip: IPv4Address, mac: bytes, now: int) -> None:
        """Learn a neighbour's MAC address from another source (DCP), which saves an ARP broadcast."""
        self._neighbours.learn(ip, mac, now)

    def probe(self, ip: IPv4Address, now: int) -> None:
        """Probe whether a station has ``ip``: three ARP probes one second apart, then :class:`AddressProbed`."""
        self._probes[ip] = _Probe(deadline=now + PROBE_INTERVAL_NS)
        self._send_arp(OPERATION_REQUEST, _UNSPECIFIED, NIL, ip, BROADCAST)

    def send(self, source_port: int, ip: IPv4Address, destination_port: int, data: bytes, now: int) -> None:
        """Send a UDP datagram, in fragments when it is longer than a frame.

        Those that cannot be sent count in ``dropped`` (``no-address``, ``no-route``, ``unresolved``, ``queue-full``).
        Raises :class:`ValueError` for data longer than a datagram.
        """
        if len(data) > MAXIMUM_DATA:
            raise ValueError(f"{len(data)} octets do not fit in a UDP datagram of at most {MAXIMUM_DATA}")
        if self._address is None:
            self.dropped["no-address"] += 1
            return
        payload = emit_udp(UdpDatagram(source_port, destination_port, data), self._own, ip)
        self._transmit(self._address, ip, PROTOCOL_UDP, payload, now)

    def receive(self, frame: EthernetFrame, now: int) -> None:
        """Take one frame; frames for others and of other protocols are counted and dropped."""
        if frame.destination != self.mac and not is_group(frame.destination):
            self.dropped["other-destination"] += 1
        elif is_group(frame.source) or frame.source == self.mac:
            self.dropped["bad-source"] += 1
        elif frame.ethertype == ETHERTYPE_ARP:
            self._receive_arp(frame, now)
        elif frame.ethertype == ETHERTYPE_IPV4:
            self._receive_ipv4(frame, now)
        else:
            self.dropped["other-protocol"] += 1

    def to_send(self, now: int) -> list[bytes]:
        """Whole frames that must go out now."""
        self.handle_timeout(now)
        frames, self._outbox = self._outbox, []
        return frames

    def events(self) -> list[IpEvent]:
        """Events since the last call."""
        events, self._events = self._events, []
        return events

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` has something to do, nanoseconds."""
        if not self._resolutions and not self._probes and self._claim.deadline is None:
            return self._reassembler.next_deadline()
        deadlines = [resolution.deadline for resolution in self._resolutions.values()]
        deadlines += [probe.deadline for probe in self._probes.values()]
        if self._claim.deadline is not None:
            deadlines.append(self._claim.deadline)
        oldest = self._reassembler.next_deadline()
        return min(deadlines if oldest is None else [*deadlines, oldest], default=None)

    def handle_timeout(self, now: int) -> None:
        """Repeat or give up requests that are due."""
        self._reassembler.handle_timeout(now)
        if self._claim.deadline is not None and self._claim.deadline <= now:
            self._follow(ClaimSign.QUIET, now)
        if not self._resolutions and not self._probes:
            return
        for ip, resolution in list(self._resolutions.items()):
            if resolution.deadline > now:
                continue
            if resolution.tries >= ARP_TRIES:
                del self._resolutions[ip]
                self._drop_waiting([resolution], "unresolved")
            else:
                resolution.tries += 1
                resolution.deadline = now + ARP_INTERVAL_NS
                self._send_arp(OPERATION_REQUEST, resolution.own, NIL, ip, BROADCAST)
        for ip, probe in list(self._probes.items()):
            if probe.deadline > now:
                continue
            if probe.sent >= PROBE_COUNT:
                self._finish_probe(ip, None)
            else:
                probe.sent += 1
                probe.deadline = now + PROBE_INTERVAL_NS
                self._send_arp(OPERATION_REQUEST, _UNSPECIFIED, NIL, ip, BROADCAST)

    # -- ARP ---------------------------------------------------------------------------------------------------------

    def _receive_arp(self, frame: EthernetFrame, now: int) -> None:
        try:
            packet = parse_arp(frame.payload)
        except DecodeError as exc:
            self.dropped[f"arp-{exc.reason}"] += 1
            return
        sender_ip, sender_mac = packet.sender_ip, packet.sender_mac
        if sender_mac == self.mac or is_group(sender_mac):
            self.dropped["arp-bad-sender"] += 1
            return
        if sender_ip in self._probes:
            self._finish_probe(sender_ip, sender_mac)
        elif sender_ip == _UNSPECIFIED and packet.target_ip in self._probes:
            self._finish_probe(packet.target_ip, sender_mac)  # two probe for the same address at once
        if self._objects(packet):
            self._follow(ClaimSign.OBJECTION, now, sender_mac)
            return
        own = self._own if self._address is not None else None
        if own is None:
            return
        if sender_ip != _UNSPECIFIED:
            for_us = packet.target_ip == own or sender_ip in self._resolutions
            (self._neighbours.learn if for_us else self._neighbours.refresh)(sender_ip, sender_mac, now)
            self._resolved(sender_ip, sender_mac)
        if packet.operation == OPERATION_REQUEST and packet.target_ip == own:
            self._send_arp(OPERATION_REPLY, own, sender_mac, sender_ip, sender_mac)

    def _objects(self, packet: ArpPacket) -> bool:
        """Whether another station uses the address, or probes for it while this host is probing."""
        claim = self._claim
        if packet.sender_ip != _UNSPECIFIED:
            return packet.sender_ip == claim.ip
        return claim.state is ClaimState.REPROBING and packet.target_ip == claim.ip

    def _conflict(self, own: IPv4Address, mac: bytes, now: int) -> None:
        reported = self._conflicts.get(mac)
        if reported is None or now - reported >= DEFEND_INTERVAL_NS:
            self._conflicts = {k: v for k, v in self._conflicts.items() if now - v < DEFEND_INTERVAL_NS}
            self._conflicts[mac] = now
            self._events.append(AddressConflict(own, mac))
        if self._defended is None or now - self._defended >= DEFEND_INTERVAL_NS:
            self._defended = now
            self._announce(own)

    def _finish_probe(self, ip: IPv4Address, mac: bytes | None) -> None:
        del self._probes[ip]
        self._events.append(AddressProbed(ip, mac))

    def _announce(self, ip: IPv4Address) -> None:
        self._send_arp(OPERATION_REQUEST, ip, NIL, ip, BROADCAST)

    def _send_arp(
        self, operation: int, sender_ip: IPv4Address, target_mac: bytes, target_ip: IPv4Address, destination: bytes
    ) -> None:
        packet = ArpPacket(operation, self.mac, sender_ip, target_mac, target_ip)
        self._emit(destination, ETHERTYPE_ARP, emit_arp(packet))

    # -- IPv4 in -----------------------------------------------------------------------------------------------------

    def _receive_ipv4(self, frame: EthernetFrame, now: int) -> None:
        try:
            packet = parse_ipv4(frame.payload, verify_checksum=True)
        except DecodeError as exc:
            self.dropped[f"ipv4-{exc.reason}"] += 1
            return
        if self._address is None:
            self.dropped["no-address"] += 1
            return
        if packet.destination != self._own and not self._is_broadcast(packet.destination):
            self.dropped["other-address"] += 1
            return
        source = packet.source
        if source == self._own or source.is_unspecified or source.is_multicast or self._is_broadcast(source):
            self.dropped["ipv4-bad-source"] += 1
            return
        self._neighbours.learn(source, frame.source, now)
        self._resolved(source, frame.source)
        whole = self._reassembler.receive(packet, now)
        if whole is None:
            return
        if whole.protocol == PROTOCOL_UDP:
            self._receive_udp(whole, frame.source)
        elif whole.protocol == PROTOCOL_ICMP:
            self._receive_icmp(self._address, whole, now)
        else:
            self.dropped["ipv4-protocol"] += 1

    def _receive_udp(self, packet: Ipv4Packet, source_mac: bytes) -> None:
        try:
            datagram = parse_udp(packet.payload)
        except DecodeError as exc:
            self.dropped[f"udp-{exc.reason}"] += 1
            return
        if udp_checksum(packet.payload, packet.source, packet.destination) is ChecksumState.BAD:
            self.dropped["udp-bad-checksum"] += 1
        elif datagram.destination_port not in self.open_ports:
            self.dropped["closed-port"] += 1
        else:
            self._events.append(
                DatagramReceived(
                    source_ip=packet.source,
                    source_port=datagram.source_port,
                    destination_port=datagram.destination_port,
                    data=datagram.data,
                    source_mac=source_mac,
                )
            )

    def _receive_icmp(self, own: IPv4Interface, packet: Ipv4Packet, now: int) -> None:
        try:
            message = parse_icmp(packet.payload, verify_checksum=True)
        except DecodeError as exc:
            self.dropped[f"icmp-{exc.reason}"] += 1
            return
        if message.message_type != TYPE_ECHO_REQUEST or self._is_broadcast(packet.destination):
            self.dropped["icmp-other"] += 1
            return
        reply = IcmpMessage(TYPE_ECHO_REPLY, 0, message.identifier, message.sequence, message.data)
        self._transmit(own, packet.source, PROTOCOL_ICMP, emit_icmp(reply), now)

    # -- IPv4 out ----------------------------------------------------------------------------------------------------

    def _transmit(self, own: IPv4Interface, ip: IPv4Address, protocol: int, payload: bytes, now: int) -> None:
        packets = self._fragments(self._own, ip, protocol, payload)
        if self._is_broadcast(ip):
            self._emit_packets(BROADCAST, packets)
            return
        if ip.is_multicast:
            # RFC 1112, 6.4: the low 23 bits of the group after 01:00:5e.
            self._emit_packets(b"\x01\x00\x5e" + (int(ip) & 0x7F_FFFF).to_bytes(3, "big"), packets)
            return
        next_hop = ip if ip in own.network else self._gateway
        mac = self._neighbours.lookup(ip, now)
        if mac is None and next_hop is not None:
            mac = self._neighbours.lookup(next_hop, now)
        if mac is not None:
            self._emit_packets(mac, packets)
        elif next_hop is None or next_hop == self._own:
            self.dropped["no-route"] += 1
        else:
            self._wait(self._own, next_hop, packets, now)

    def _wait(self, own: IPv4Address, next_hop: IPv4Address, packets: list[Ipv4Packet], now: int) -> None:
        resolution = self._resolutions.get(next_hop)
        if resolution is None:
            if len(self._resolutions) >= RESOLUTION_LIMIT:
                self.dropped["queue-full"] += 1
                return
            resolution = self._resolutions[next_hop] = _Resolution(own, deadline=now + ARP_INTERVAL_NS)
            self._send_arp(OPERATION_REQUEST, own, NIL, next_hop, BROADCAST)
        if len(resolution.waiting) >= QUEUE_LIMIT:
            resolution.waiting.popleft()
            self.dropped["queue-full"] += 1
        resolution.waiting.append(packets)

    def _resolved(self, ip: IPv4Address, mac: bytes) -> None:
        if not self._resolutions:
            return
        resolution = self._resolutions.pop(ip, None)
        if resolution is not None:
            for packets in resolution.waiting:
                self._emit_packets(mac, packets)

    def _fragments(
        self, source: IPv4Address, destination: IPv4Address, protocol: int, payload: bytes
    ) -> list[Ipv4Packet]:
        self._identification = (self._identification + 1) & 0xFFFF
        room = MTU - HEADER_LENGTH
        step = room if len(payload) <= room else room // 8 * 8
        return [
            Ipv4Packet(
                source=source,
                destination=destination,
                protocol=protocol,
                payload=payload[offset : offset + step],
                identification=self._identification,
                more_fragments=offset + step < len(payload),
                fragment_offset=offset,
            )
            for offset in range(0, len(payload), step)
        ]

    def _emit_packets(self, destination: bytes, packets: Iterable[Ipv4Packet]) -> None:
        for packet in packets:
            self._emit(destination, ETHERTYPE_IPV4, emit_ipv4(packet))

    def _emit(self, destination: bytes, ethertype: int, payload: bytes) -> None:
        self._outbox.append(emit_ethernet(EthernetFrame(destination, self.mac, ethertype, payload)))

    def _is_broadcast(self, ip: IPv4Address) -> bool:
        if ip == _LIMITED_BROADCAST:
            return True
        network = self._address.network if self._address is not None else None
        # A subnet of one or two addresses has no broadcast address (RFC 3021).
        return network is not None and network.prefixlen < 31 and ip == network.broadcast_address

    def _drop_waiting(self, resolutions: Iterable[_Resolution], reason: str) -> None:
        for resolution in resolutions:
            self.dropped[reason] += len(resolution.waiting)
