"""The LLDP agent of one port: announces the station, and keeps its neighbours (IEEE 802.1AB-2016 clause 9).

PROFINET sends every 5 s with a time to live of 20 s (IEC 61158-6-10, LLDP).  A thousand drives that are switched on
together would always send together; ``phase_ns`` shifts each agent's first frame, and so all that follow.  An
unchanged frame is encoded once.  Changed own data are sent at once, at most once a second.

What a device sends, and why:

* Names follow MultipleInterfaceMode.NameOfDevice, which a controller writes in PDInterfaceAdjust; until it does, the
  coding's default holds: the port id alone names the port, the chassis id is the NameOfStation.  Controllers with
  the newer scheme (S7-1500) write it at each start-up; others expect the default.
* PROFINET's port status and chassis MAC, the MAC/PHY status and a management address are mandatory for conformance
class B; descriptions, system name and capabilities are sent because SNMP shows them (LLDP-MIB).
* Delays are not sent: they are not measured.

A neighbour is identified by chassis id and port id together, as in IEEE 802.1AB; it is gone when its time to live has
passed, when it sends time to live 0, or when the link goes down.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from ipaddress import IPv4Address
from typing import TYPE_CHECKING, TypeAlias

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.lldp.pdu import LLDP_MULTICAST, Lldpdu, NameMode, emit_lldp, parse_lldp, peer_names
from pnfarm.protocols.profinet.wire.lldp.tlvs import (
    MAU_100BASE_TX_FULL_DUPLEX,
    AddressFamily,
    Capability,
    ChassisId,
    ChassisIdSubtype,
    ChassisMac,
    MacPhyStatus,
    ManagementAddress,
    PortDescription,
    PortId,
    PortIdSubtype,
    PortStatus,
    SystemCapabilities,
    SystemDescription,
    SystemName,
    ipv4_management,
    mac_management,
    mac_name,
)
from pnfarm.wire.ethernet import ETHERTYPE_LLDP, EthernetFrame, emit_ethernet

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.wire.lldp.tlvs import Tlv

__all__ = [
    "MAXIMUM_NEIGHBOURS",
    "SEND_INTERVAL_NS",
    "TIME_TO_LIVE",
    "LldpPort",
    "LocalPort",
    "LocalSystem",
    "Neighbour",
    "NeighbourAppeared",
    "NeighbourChanged",
    "NeighbourGone",
    "local_lldpdu",
    "spread_phase",
]

#: IEC 61158-6-10, LLDP: message transmit interval, and time to live in seconds.
SEND_INTERVAL_NS = 5_000_000_000
TIME_TO_LIVE = 20
#: Agents with a phase send at multiples of this: those of a farm share the turns of its event loop.
_TOGETHER_NS = 100_000_000
#: Changes of the own data that follow each other faster wait (IEEE 802.1AB: txDelay).
_SHORTEST_GAP_NS = 1_000_000_000
#: Default number of neighbours that one port keeps.
MAXIMUM_NEIGHBOURS = 8
_SECOND_NS = 1_000_000_000
#: Autonegotiation supported and enabled; ifMauAutoNegCapAdvertisedBits: 10BASE-T and 100BASE-TX, half and full duplex.
_AUTONEGOTIATION = 0x03
_ADVERTISED_100 = 0x6C00


@dataclass(frozen=True, slots=True)
class LocalPort:
    """An own port.

    ``number`` counts from 1; ``name`` is ``port-001``; ``mac`` is the port's own.  A virtual interface has no speed:
    ``mau_type`` is assumed to be 100BASE-TX full duplex.
    """

    number: int
    mac: bytes
    description: str = ""
    mau_type: int = MAU_100BASE_TX_FULL_DUPLEX

    @property
    def name(self) -> str:
        return f"port-{self.number:03}"

    @property
    def mac_phy(self) -> MacPhyStatus:
        return MacPhyStatus(_AUTONEGOTIATION, _ADVERTISED_100, self.mau_type)


@dataclass(frozen=True, slots=True)
class LocalSystem:
    """The device that the ports belong to; ``mac`` is its interface's, ``name`` its NameOfStation, empty for none."""

    mac: bytes
    name: str = ""
    description: str = ""
    address: IPv4Address | None = None
    interface_number: int = 1
    capabilities: int = Capability.STATION
    name_mode: NameMode = NameMode.PORT

    @property
    def chassis(self) -> ChassisId:
        if self.name_mode is NameMode.PORT_AND_STATION:
            return ChassisId(ChassisIdSubtype.LOCAL, _octets(self.description or mac_name(self.mac)))
        if self.name:
            return ChassisId(ChassisIdSubtype.LOCAL, _octets(self.name))
        return ChassisId(ChassisIdSubtype.MAC_ADDRESS, self.mac)

    def port_id(self, port: LocalPort) -> PortId:
        if self.name_mode is NameMode.PORT:
            return PortId(PortIdSubtype.LOCAL, _octets(port.name))
        return PortId(PortIdSubtype.LOCAL, _octets(f"{port.name}.{self.name or mac_name(self.mac)}"))

    @property
    def management(self) -> ManagementAddress:
        if self.address is None:
            return mac_management(self.mac, self.interface_number)
        return ipv4_management(self.address, self.interface_number)


@dataclass(slots=True)
class Neighbour:
    """A neighbour of a port.  Only the agent changes it (``seen_ns``, ``expires_ns``).

    ``changed_ns``: when it was heard first, or last said something else.
    """

    port: str
    mac: bytes
    chassis: ChassisId
    port_id: PortId
    time_to_live: int
    tlvs: tuple[Tlv, ...]
    changed_ns: int
    seen_ns: int
    expires_ns: int
    payload: bytes = field(default=b"", repr=False, compare=False)

    @property
    def port_name(self) -> str:
        return peer_names(self.chassis, self.port_id)[0]

    @property
    def station_name(self) -> str:
        """NameOfStation, or the MAC address of a station without one."""
        return peer_names(self.chassis, self.port_id)[1]

    @property
    def alias(self) -> str:
        """``<port>.<station>``, for an alias filter of DCP (IEC 61158-6-10, AliasNameValue)."""
        return f"{self.port_name}.{self.station_name}"

    @property
    def port_description(self) -> str:
        return next((t.text for t in self.tlvs if isinstance(t, PortDescription)), "")

    @property
    def system_name(self) -> str:
        return next((t.text for t in self.tlvs if isinstance(t, SystemName)), "")

    @property
    def system_description(self) -> str:
        return next((t.text for t in self.tlvs if isinstance(t, SystemDescription)), "")

    @property
    def capabilities(self) -> SystemCapabilities | None:
        return next((t for t in self.tlvs if isinstance(t, SystemCapabilities)), None)

    @property
    def management(self) -> tuple[ManagementAddress, ...]:
        return tuple(t for t in self.tlvs if isinstance(t, ManagementAddress))

    @property
    def ip(self) -> IPv4Address | None:
        """The first IPv4 management address; 0.0.0.0 for none."""
        for found in self.management:
            if found.subtype == AddressFamily.IPV4 and len(found.address) == 4 and any(found.address):
                return IPv4Address(found.address)
        return None

    @property
    def chassis_mac(self) -> bytes | None:
        """MAC address of the neighbour's interface, as PROFINET's TLV has it."""
        return next((t.mac for t in self.tlvs if isinstance(t, ChassisMac)), None)

    def facts(self) -> dict[str, str]:
        """Its names and address, for events."""
        return {"neighbour": self.station_name, "neighbour_port": self.port_name, "mac": self.mac.hex(":")}

    @property
    def mau_type(self) -> int | None:
        return next((t.mau_type for t in self.tlvs if isinstance(t, MacPhyStatus)), None)


@dataclass(frozen=True, slots=True)
class NeighbourAppeared:
    """A new neighbour appeared at ``port``."""

    port: str
    neighbour: Neighbour


@dataclass(frozen=True, slots=True)
class NeighbourChanged:
    """The data of a known neighbour changed."""

    port: str
    neighbour: Neighbour


@dataclass(frozen=True, slots=True)
class NeighbourGone:
    """``reason``: ``aged-out``, ``shutdown`` or ``link-down``."""

    port: str
    neighbour: Neighbour
    reason: str


LldpEvent: TypeAlias = NeighbourAppeared | NeighbourChanged | NeighbourGone


def spread_phase(index: int) -> int:
    """When agent ``index`` sends first, nanoseconds: any number of agents is spread evenly over the interval."""
    # Fibonacci hashing: each further one is placed in the widest gap
    return ((index * 0x9E37_79B1 & 0xFFFF_FFFF) * SEND_INTERVAL_NS) >> 32


def local_lldpdu(system: LocalSystem, port: LocalPort, time_to_live: int = TIME_TO_LIVE) -> Lldpdu:
    """The LLDPDU of ``port``; in a shutdown its identity alone (IEEE 802.1AB-2016 9.1.2.3)."""
    tlvs: list[Tlv] = []
    if time_to_live:
        tlvs = [
            PortStatus(),
            ChassisMac(system.mac),
            port.mac_phy,
            system.management,
        ]
        if port.description:
            tlvs.append(PortDescription(_octets(port.description)))
        if system.name:
            tlvs.append(SystemName(_octets(system.name)))
        if system.description:
            tlvs.append(SystemDescription(_octets(system.description)))
        tlvs.append(SystemCapabilities(system.capabilities, system.capabilities))
    return Lldpdu(system.chassis, system.port_id(port), time_to_live, tuple(tlvs))


class LldpPort:
    """See the module's docstring.  The first :meth:`to_send` begins the first interval.

    ``maximum`` bounds the neighbours: more than one means that something between forwards LLDP.
    """

    def __init__(
        self, system: LocalSystem, port: LocalPort, *, phase_ns: int = 0, maximum: int = MAXIMUM_NEIGHBOURS
    ) -> None:
        self.port = port
        self._system = system
        self._phase_ns = phase_ns
        self._maximum = maximum
        #: Frames that were not accepted, by reason.
        self.dropped: Counter[str] = Counter()
        self.sent = 0
        self.received = 0
        self._sending = True
        self._closed = False
        self._next_ns: int | None = None
        self._last_ns: int | None = None
        self._frame: bytes | None = None
        self._neighbours: dict[tuple[ChassisId, PortId], Neighbour] = {}
        #: Who sent last from a MAC address: mostly the same as before, which need not be parsed.
        self._by_source: dict[bytes, Neighbour] = {}
        self._look_ns: int | None = None  # no neighbour expires before
        self._outbox: list[bytes] = []
        self._events: list[LldpEvent] = []

    # -- own data ----------------------------------------------------------------------------------------------------

    @property
    def system(self) -> LocalSystem:
        return self._system

    def update(self, system: LocalSystem, now: int) -> None:
        """Set the own data; if they differ they are sent soon, once the first frame was sent."""
        if system == self._system:
            return
        self._system = system
        self._frame = None
        if self._last_ns is not None and self._next_ns is not None:
            self._next_ns = min(self._next_ns, max(now, self._last_ns + _SHORTEST_GAP_NS))

    def send_frames(self, wanted: bool, now: int) -> None:
        """Enable or disable sending (PeerToPeerBoundary bit 0); receiving continues."""
        if wanted == self._sending or self._closed:
            return
        self._sending = wanted
        self._next_ns = now if wanted else None

    def shut_down(self, now: int) -> None:
        """Send a shutdown frame, unless nothing was ever sent, and send nothing more."""
        if self._sending and self._last_ns is not None:
            self._outbox.append(self._emit(local_lldpdu(self._system, self.port, 0)))
        self._last_ns = now
        self._sending = False
        self._closed = True
        self._next_ns = None

    # -- the machine -------------------------------------------------------------------------------------------------

    def to_send(self, now: int) -> list[bytes]:
        """Whole frames that are due."""
        if self._sending and self._next_ns is None:
            due = now + self._phase_ns
            self._next_ns = due if not self._phase_ns else due + -due % _TOGETHER_NS
        if self._next_ns is not None and self._next_ns <= now:
            if self._frame is None:
                self._frame = self._emit(local_lldpdu(self._system, self.port))
            self._outbox.append(self._frame)
            self._last_ns = now
            # an agent that was late keeps its place in the interval
            self._next_ns += ((now - self._next_ns) // SEND_INTERVAL_NS + 1) * SEND_INTERVAL_NS
        frames, self._outbox = self._outbox, []
        self.sent += len(frames)
        return frames

    def _emit(self, pdu: Lldpdu) -> bytes:
        return emit_ethernet(EthernetFrame(LLDP_MULTICAST, self.port.mac, ETHERTYPE_LLDP, emit_lldp(pdu)))

    def next_deadline(self) -> int | None:
        """Time of the next frame or of the next expiring neighbour; None before the first :meth:`to_send`."""
        if self._next_ns is None or self._look_ns is None:
            return self._look_ns if self._next_ns is None else self._next_ns
        return min(self._look_ns, self._next_ns)

    def only_sends(self, now: int) -> bool:
        """Whether nothing but a frame is due by now, and nothing is left to report."""
        return not self._events and (self._look_ns is None or now < self._look_ns)

    def handle_timeout(self, now: int) -> None:
        for key in [k for k, n in self._neighbours.items() if n.expires_ns <= now]:
            self._forget(key, "aged-out")
        # neighbours that sent again are checked once more at their old expiry
        self._look_ns = min((n.expires_ns for n in self._neighbours.values()), default=None)

    def link_down(self) -> None:
        """The cable is off: no neighbour is left."""
        for key in list(self._neighbours):
            self._forget(key, "link-down")

    def events(self) -> list[LldpEvent]:
        events, self._events = self._events, []
        return events

    @property
    def neighbours(self) -> tuple[Neighbour, ...]:
        """In the order in which they appeared."""
        return tuple(self._neighbours.values())

    # -- receiving -----------------------------------------------------------------------------------------------------

    def receive(self, frame: EthernetFrame, now: int) -> bool:
        """One LLDP frame; whether anything changed but the time."""
        known = self._by_source.get(frame.source)
        if known is not None and known.payload == frame.payload:
            self.received += 1
            self._is_there(known, now)
            return False
        try:
            pdu = parse_lldp(frame.payload)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return False
        return self.hear(pdu, frame.source, frame.payload, now)

    def hear(self, pdu: Lldpdu, source: bytes, payload: bytes, now: int) -> bool:
        """A parsed LLDPDU, ``payload`` as received; one parse serves all ports that receive the frame."""
        if source == self.port.mac:
            self.dropped["own-frame"] += 1
            return False
        self.received += 1
        key = (pdu.chassis, pdu.port)
        known = self._neighbours.get(key)
        if pdu.time_to_live == 0:
            if known is not None:
                self._forget(key, "shutdown")
            return known is not None
        if known is not None and known.payload == payload and known.mac == source:
            self._is_there(known, now)
            return False
        if known is None and len(self._neighbours) >= self._maximum:
            self.dropped["too-many-neighbours"] += 1
            return False
        expires = now + pdu.time_to_live * _SECOND_NS
        found = Neighbour(
            port=self.port.name,
            mac=source,
            chassis=pdu.chassis,
            port_id=pdu.port,
            time_to_live=pdu.time_to_live,
            tlvs=pdu.tlvs,
            changed_ns=now,
            seen_ns=now,
            expires_ns=expires,
            payload=payload,
        )
        if known is not None:
            self._forget_source(known)
        self._neighbours[key] = self._by_source[source] = found
        self._look_ns = expires if self._look_ns is None else min(self._look_ns, expires)
        if known is None:
            self._events.append(NeighbourAppeared(self.port.name, found))
        elif (known.mac, known.tlvs) != (source, pdu.tlvs):
            self._events.append(NeighbourChanged(self.port.name, found))
        return True

    def _is_there(self, known: Neighbour, now: int) -> None:
        """A neighbour sent the same as before."""
        known.seen_ns, known.expires_ns = now, now + known.time_to_live * _SECOND_NS
        if len(self._neighbours) == 1:
            self._look_ns = known.expires_ns

    def _forget(self, key: tuple[ChassisId, PortId], reason: str) -> None:
        gone = self._neighbours.pop(key)
        self._forget_source(gone)
        self._events.append(NeighbourGone(self.port.name, gone, reason))
        if not self._neighbours:
            self._look_ns = None

    def _forget_source(self, gone: Neighbour) -> None:
        if self._by_source.get(gone.mac) is gone:
            del self._by_source[gone.mac]


def _octets(text: str) -> bytes:
    """At most 255 octets of UTF-8: the limit of the TLVs of names and texts."""
    return text.encode()[:255]
