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
    from pnfarm.protocols.profinet.lldp.agent import LocalSystem, Neighbour
    from pnfarm.protocols.profinet.wire.lldp.tlvs import MacPhyStatus, PortId

__all__ = [
    "ADMIN_DISABLED",
    "ADMIN_RX_ONLY",
    "ADMIN_TX_AND_RX",
    "InterfaceCounters",
    "InterfaceView",
    "LldpPortStatistics",
    "LldpPortView",
    "LldpStatistics",
    "LldpView",
    "NeighbourView",
    "SnmpView",
    "SystemText",
    "SystemView",
    "capability_bits",
    "system_description",
]

#: lldpPortConfigAdminStatus.
ADMIN_RX_ONLY = 2
ADMIN_TX_AND_RX = 3
ADMIN_DISABLED = 4


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


@dataclass(frozen=True, slots=True)
class InterfaceView:
    """One row of ifTable and ifXTable.  ``speed`` is in bits a second."""

    index: int
    description: str
    name: str
    mac: bytes
    up: bool = True
    speed: int = 100_000_000
    has_connector: bool = True
    counters: InterfaceCounters = InterfaceCounters()


@dataclass(frozen=True, slots=True)
class LldpPortStatistics:
    """LLDP frames and TLVs of one port."""

    tx_frames: int = 0
    rx_frames_discarded: int = 0
    rx_frames_errors: int = 0
    rx_frames: int = 0
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
    port_id: PortId
    description: str
    mac_phy: MacPhyStatus
    admin_status: int = ADMIN_TX_AND_RX
    tlvs_enabled: bytes = b"\x00"
    statistics: LldpPortStatistics = LldpPortStatistics()


@dataclass(frozen=True, slots=True)
class NeighbourView:
    """A remote system that one local port receives LLDP from.

    ``time_mark_ns``, ``port`` and ``index`` make the row's index; ``time_mark_ns`` is when the row last changed.
    """

    time_mark_ns: int
    port: int
    index: int
    neighbour: Neighbour


@dataclass(frozen=True, slots=True)
class LldpView:
    """LLDP-MIB.  All ports advertise the one address of ``system``."""

    system: LocalSystem
    ports: tuple[LldpPortView, ...]
    neighbours: tuple[NeighbourView, ...] = ()
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
