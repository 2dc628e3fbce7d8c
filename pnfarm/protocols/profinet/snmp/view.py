"""The station's data for its SNMP agent: plain values, read for each request.

The agent gets a :class:`SnmpView` only for a request, so that it costs nothing
otherwise.  Times are nanoseconds since power-on, like sysUpTime.  Capabilities and the like are octets
of a BITS value: the first bit is the highest one of the first octet.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.wire.snmp.ber import Oid

__all__ = [
    "ADMIN_DISABLED",
    "ADMIN_RX_ONLY",
    "ADMIN_TX_AND_RX",
    "PROFINET_OBJECT_ID",
    "Dot3Port",
    "InterfaceCounters",
    "InterfaceView",
    "LldpPortStatistics",
    "LldpPortView",
    "LldpStatistics",
    "LldpView",
    "ManagementAddress",
    "NeighbourView",
    "PnoPort",
    "SnmpView",
    "SystemText",
    "SystemView",
    "capability_bits",
    "system_description",
]

#: PROFIBUS Nutzerorganisation's enterprise, the sysObjectID of a PROFINET device (private enterprise number 24686).
PROFINET_OBJECT_ID: Oid = (1, 3, 6, 1, 4, 1, 24686)
#: LldpChassisIdSubtype and LldpPortIdSubtype have the same number for "local".
SUBTYPE_LOCAL = 7
#: AddressFamilyNumbers: ipV4.
ADDRESS_IPV4 = 1
#: LldpManAddrIfSubtype: ifIndex.
IF_SUBTYPE_IFINDEX = 2
#: lldpPortConfigAdminStatus.
ADMIN_RX_ONLY = 2
ADMIN_TX_AND_RX = 3
ADMIN_DISABLED = 4
#: LldpSystemCapabilitiesMap: bit 7.
CAPABILITY_STATION_ONLY = b"\x01"
#: RFC 3636: dot3MauType100BaseTXFD; ifMauAutoNegCapAdvertisedBits of 10BASE-T and 100BASE-TX, half and full duplex.
MAU_100BASE_TX_FULL = 16
AUTONEG_10_100 = b"\x6c\x00"


class SystemText(Enum):
    """The texts that a manager may write; the value is the arc below system (RFC 3418)."""

    CONTACT = 4
    NAME = 5
    LOCATION = 6


@dataclass(frozen=True, slots=True)
class SystemView:
    """The system group.  Texts are ASCII, at most 255 characters; the agent replaces what is not ASCII."""

    description: str
    uptime_ns: int
    contact: str = ""
    name: str = ""
    location: str = ""
    object_id: Oid = PROFINET_OBJECT_ID


@dataclass(frozen=True, slots=True)
class InterfaceCounters:
    """Frames and octets (with header and FCS) of one interface since power-on; they may only grow."""

    in_octets: int = 0
    in_unicast: int = 0
    in_multicast: int = 0
    in_broadcast: int = 0
    in_discards: int = 0
    in_errors: int = 0
    in_unknown_protocols: int = 0
    out_octets: int = 0
    out_unicast: int = 0
    out_multicast: int = 0
    out_broadcast: int = 0
    out_discards: int = 0
    out_errors: int = 0


@dataclass(frozen=True, slots=True)
class InterfaceView:
    """One row of ifTable and ifXTable.  ``speed`` is in bits a second, ``last_change_ns`` when ``up`` changed."""

    index: int
    description: str
    name: str
    mac: bytes
    up: bool = True
    last_change_ns: int = 0
    speed: int = 100_000_000
    mtu: int = 1500
    has_connector: bool = True
    counters: InterfaceCounters = InterfaceCounters()


@dataclass(frozen=True, slots=True)
class ManagementAddress:
    """Where a system can be managed; ``address`` in network order, ``if_id`` as ``if_subtype`` says.

    ``object_id`` must be one that can be sent: two arcs at least, each of 32 bits.
    """

    address: bytes
    if_id: int
    subtype: int = ADDRESS_IPV4
    if_subtype: int = IF_SUBTYPE_IFINDEX
    object_id: Oid = (0, 0)


@dataclass(frozen=True, slots=True)
class Dot3Port:
    """LLDP-EXT-DOT3-MIB: MAC/PHY status of a port."""

    autoneg_supported: bool = True
    autoneg_enabled: bool = True
    autoneg_advertised: bytes = AUTONEG_10_100
    mau_type: int = MAU_100BASE_TX_FULL


@dataclass(frozen=True, slots=True)
class PnoPort:
    """LLDP-EXT-PNO-MIB: delays (0: not measured), port status of RT class 2 and 3 (0: off), name of the station."""

    line_delay_ns: int = 0
    tx_delay_ns: int = 0
    rx_delay_ns: int = 0
    rt2_status: int = 0
    rt3_status: int = 0
    station_name: str = ""


@dataclass(frozen=True, slots=True)
class LldpPortStatistics:
    """LLDP frames and TLVs of one port."""

    tx_frames: int = 0
    rx_frames_discarded: int = 0
    rx_frames_errors: int = 0
    rx_frames: int = 0
    rx_tlvs_discarded: int = 0
    rx_tlvs_unrecognized: int = 0
    rx_ageouts: int = 0


@dataclass(frozen=True, slots=True)
class LldpStatistics:
    """Changes of the table of neighbours."""

    last_change_ns: int = 0
    inserts: int = 0
    deletes: int = 0
    drops: int = 0
    ageouts: int = 0


@dataclass(frozen=True, slots=True)
class LldpPortView:
    """A local port: ``number`` from 1.

    ``admin_status`` as the MIB counts: 1 sends only, 2 receives only, 3 both, 4 neither.  ``tlvs_enabled``: BITS of the
    optional TLVs that are sent: port description, system name, system description, system capabilities.
    """

    number: int
    port_id: bytes
    description: str
    port_id_subtype: int = SUBTYPE_LOCAL
    admin_status: int = ADMIN_TX_AND_RX
    tlvs_enabled: bytes = b"\x00"
    dot3: Dot3Port = Dot3Port()
    pno: PnoPort = PnoPort()
    statistics: LldpPortStatistics = LldpPortStatistics()


@dataclass(frozen=True, slots=True)
class NeighbourView:
    """A remote system that one local port receives LLDP from.

    ``time_mark_ns``, ``port`` and ``index`` make the row's index; ``time_mark_ns`` is when the row last changed.
    ``dot3`` and ``pno`` are None where the neighbour sends no such TLVs.
    """

    time_mark_ns: int
    port: int
    index: int
    chassis_id: bytes
    port_id: bytes
    chassis_id_subtype: int = SUBTYPE_LOCAL
    port_id_subtype: int = SUBTYPE_LOCAL
    port_description: str = ""
    system_name: str = ""
    system_description: str = ""
    capabilities_supported: bytes = b""
    capabilities_enabled: bytes = b""
    addresses: tuple[ManagementAddress, ...] = ()
    dot3: Dot3Port | None = None
    pno: PnoPort | None = None


@dataclass(frozen=True, slots=True)
class LldpView:
    """LLDP-MIB.  Intervals in seconds; a PROFINET device sends every 5 s, with a time to live of 20 s."""

    chassis_id: bytes
    ports: tuple[LldpPortView, ...]
    chassis_id_subtype: int = SUBTYPE_LOCAL
    system_name: str = ""
    system_description: str = ""
    capabilities_supported: bytes = CAPABILITY_STATION_ONLY
    capabilities_enabled: bytes = CAPABILITY_STATION_ONLY
    addresses: tuple[ManagementAddress, ...] = ()
    neighbours: tuple[NeighbourView, ...] = ()
    tx_interval: int = 5
    hold_multiplier: int = 4
    statistics: LldpStatistics = LldpStatistics()


@dataclass(frozen=True, slots=True)
class SnmpView:
    """Everything that the agent shows."""

    system: SystemView
    lldp: LldpView
    interfaces: tuple[InterfaceView, ...] = field(default=())


def capability_bits(capabilities: int) -> bytes:
    """LldpSystemCapabilitiesMap from the field of a TLV: its bit 0 (other) is the first, highest bit of the octet."""
    return bytes([int(f"{capabilities & 0xFF:08b}"[::-1], 2)])


def system_description(
    station_type: str,
    order_id: str,
    serial_number: str,
    hardware_revision: int,
    software_prefix: str,
    software_revision: tuple[int, int, int],
) -> str:
    """SystemIdentification (IEC 61158-6-10, LLDP_ChassisID): what sysDescr and LLDP's system description say.

    Fields of fixed width with a blank between them: type (25), order id (20), serial number (16), hardware revision
    (5), prefix (1) and three numbers (3 each) of the software.  Longer texts are cut to their field.
    """
    version = "".join(f"{part:3d}"[:3] for part in software_revision)
    texts = f"{station_type:<25.25} {order_id:<20.20} {serial_number:<16.16}"
    return f"{texts} {hardware_revision:>5} {software_prefix:1.1}{version}"
