"""LLDP-MIB (IEEE 802.1AB-2005) with the extensions of IEEE 802.3 and of PROFINET.

The extensions are LLDP-EXT-DOT3-MIB (arc 4623) and LLDP-EXT-PNO-MIB (arc 3791, IEC 61158-6-10); of both, what a device
of conformance class B is asked for: the state of its ports and of its neighbours'.  A manager configures nothing here:
what the MIBs call read-write is read-only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.lldp.agent import SEND_INTERVAL_NS, TIME_TO_LIVE
from pnfarm.protocols.profinet.snmp.mib import Scalar, Table, admin_text, display_text, truth
from pnfarm.protocols.profinet.snmp.view import LldpPortView, NeighbourView, SnmpView, capability_bits
from pnfarm.protocols.profinet.wire.lldp.tlvs import (
    ChassisMac,
    MacPhyStatus,
    ManagementAddress,
    MeasuredDelays,
    PortStatus,
)
from pnfarm.protocols.profinet.wire.snmp.ber import parse_oid
from pnfarm.protocols.profinet.wire.snmp.message import (
    Oid,
    Value,
    counter32,
    gauge32,
    integer,
    object_id,
    octets,
    time_ticks,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from pnfarm.protocols.profinet.lldp.agent import Neighbour

__all__ = ["LLDP_SCALARS", "LLDP_TABLES"]

Part = TypeVar("Part")

LLDP: Oid = (1, 0, 8802, 1, 1, 2, 1)
CONFIGURATION: Oid = (*LLDP, 1)
STATISTICS: Oid = (*LLDP, 2)
LOCAL: Oid = (*LLDP, 3)
REMOTE: Oid = (*LLDP, 4)
DOT3: Oid = (*LLDP, 5, 4623, 1)
PNO: Oid = (*LLDP, 5, 3791, 1)

#: Seconds, the MIB's defaults: this agent sends no notifications, and a manager cannot change them.
TX_INTERVAL = SEND_INTERVAL_NS // 1_000_000_000
REINIT_DELAY = 2
TX_DELAY = 2
NOTIFICATION_INTERVAL = 5

LLDP_SCALARS = (
    Scalar((*CONFIGURATION, 1), lambda _: integer(TX_INTERVAL)),
    Scalar((*CONFIGURATION, 2), lambda _: integer(TIME_TO_LIVE // TX_INTERVAL)),
    Scalar((*CONFIGURATION, 3), lambda _: integer(REINIT_DELAY)),
    Scalar((*CONFIGURATION, 4), lambda _: integer(TX_DELAY)),
    Scalar((*CONFIGURATION, 5), lambda _: integer(NOTIFICATION_INTERVAL)),
    # ZeroBasedCounter32 (RFC 2021) is a Gauge32 on the wire.
    Scalar((*STATISTICS, 1), lambda r: time_ticks(r.view.lldp.statistics.last_change_ns)),
    Scalar((*STATISTICS, 2), lambda r: gauge32(r.view.lldp.statistics.inserts)),
    Scalar((*STATISTICS, 3), lambda r: gauge32(r.view.lldp.statistics.deletes)),
    Scalar((*STATISTICS, 4), lambda r: gauge32(r.view.lldp.statistics.drops)),
    Scalar((*STATISTICS, 5), lambda r: gauge32(r.view.lldp.statistics.ageouts)),
    Scalar((*LOCAL, 1), lambda r: integer(r.view.lldp.system.chassis.subtype)),
    Scalar((*LOCAL, 2), lambda r: octets(r.view.lldp.system.chassis.value)),
    Scalar((*LOCAL, 3), lambda r: admin_text(r.view.lldp.system.name)),
    Scalar((*LOCAL, 4), lambda r: admin_text(r.view.lldp.system.description)),
    Scalar((*LOCAL, 5), lambda r: octets(capability_bits(r.view.lldp.system.capabilities))),
    Scalar((*LOCAL, 6), lambda r: octets(capability_bits(r.view.lldp.system.capabilities))),
)


class _Part(NamedTuple, Generic[Part]):
    """A part of a port or of a neighbour that has rows of its own."""

    arcs: Oid
    part: Part


class _Pno(NamedTuple):
    """What PROFINET's TLVs say of a port."""

    status: PortStatus
    delays: MeasuredDelays
    station_name: str


def _index(row: _Part[Any]) -> Oid:
    return row.arcs


def _ports(view: SnmpView) -> tuple[LldpPortView, ...]:
    return view.lldp.ports


def _port_index(row: LldpPortView) -> Oid:
    return (row.number,)


def _address_index(address: ManagementAddress) -> Oid:
    """Subtype, and the address with its length before it (RFC 2578, 7.7)."""
    return (address.subtype, len(address.address), *address.address)


def _object_id(address: ManagementAddress) -> Value:
    try:
        return object_id(parse_oid(address.oid) if address.oid else (0, 0))
    except DecodeError:
        # a neighbour may send something else than an object identifier; a manager must get one
        return object_id((0, 0))


def _local_addresses(view: SnmpView) -> list[_Part[ManagementAddress]]:
    own = view.lldp.system.management
    return [_Part(_address_index(own), own)]


def _neighbours(view: SnmpView) -> tuple[NeighbourView, ...]:
    return view.lldp.neighbours


def _neighbour_index(row: NeighbourView) -> Oid:
    """lldpRemTimeMark, lldpRemLocalPortNum, lldpRemIndex."""
    return (row.time_mark_ns // 10_000_000 & 0xFFFF_FFFF, row.port, row.index)


def _of_neighbours(find: Callable[[Neighbour], Part | None]) -> Callable[[SnmpView], list[_Part[Part]]]:
    def rows(view: SnmpView) -> list[_Part[Part]]:
        found = [(_neighbour_index(row), find(row.neighbour)) for row in view.lldp.neighbours]
        return [_Part(index, part) for index, part in found if part is not None]

    return rows


def _mac_phy(neighbour: Neighbour) -> MacPhyStatus | None:
    return next((t for t in neighbour.tlvs if isinstance(t, MacPhyStatus)), None)


def _pno(neighbour: Neighbour) -> _Pno | None:
    if not any(isinstance(t, PortStatus | MeasuredDelays | ChassisMac) for t in neighbour.tlvs):
        return None
    status = next((t for t in neighbour.tlvs if isinstance(t, PortStatus)), PortStatus())
    delays = next((t for t in neighbour.tlvs if isinstance(t, MeasuredDelays)), MeasuredDelays())
    return _Pno(status, delays, neighbour.station_name)


def _port_list(ports: Iterable[LldpPortView]) -> Value:
    """LldpPortList: port 1 is the highest bit of the first octet."""
    numbers = [port.number for port in ports]
    bits = bytearray((max(numbers, default=0) + 7) // 8)
    for number in numbers:
        bits[(number - 1) // 8] |= 0x80 >> (number - 1) % 8
    return octets(bytes(bits))


def _capabilities(neighbour: Neighbour, which: str) -> Value:
    sent = neighbour.capabilities
    return octets(b"" if sent is None else capability_bits(getattr(sent, which)))


_DOT3_COLUMNS: tuple[tuple[int, Callable[[_Part[MacPhyStatus]], Value]], ...] = (
    (1, lambda row: integer(truth(bool(row.part.autonegotiation & 1)))),
    (2, lambda row: integer(truth(bool(row.part.autonegotiation & 2)))),
    (3, lambda row: octets(row.part.advertised.to_bytes(2, "big"))),
    (4, lambda row: integer(row.part.mau_type)),
)
# The delays are Unsigned32.
_PNO_COLUMNS: tuple[tuple[int, Callable[[_Part[_Pno]], Value]], ...] = (
    (1, lambda row: gauge32(row.part.delays.cable_local)),
    (2, lambda row: gauge32(row.part.delays.tx_local)),
    (3, lambda row: gauge32(row.part.delays.rx_local)),
    (4, lambda row: integer(row.part.status.rtclass2 & 3)),
    (5, lambda row: integer(row.part.status.rtclass3 & 7)),
    (6, lambda row: display_text(row.part.station_name)),
)

LLDP_TABLES: tuple[Table[Any], ...] = (
    # lldpPortConfigTable: notifications are off
    Table[LldpPortView](
        (*CONFIGURATION, 6, 1),
        _ports,
        _port_index,
        (
            (2, lambda row: integer(row.admin_status)),
            (3, lambda _: integer(truth(False))),
            (4, lambda row: octets(row.tlvs_enabled)),
        ),
    ),
    # lldpConfigManAddrTable
    Table[_Part[tuple[LldpPortView, ...]]](
        (*CONFIGURATION, 7, 1),
        lambda view: [_Part(_address_index(view.lldp.system.management), view.lldp.ports)],
        _index,
        ((1, lambda row: _port_list(row.part)),),
    ),
    # lldpStatsTxPortTable
    Table[LldpPortView](
        (*STATISTICS, 6, 1), _ports, _port_index, ((2, lambda row: counter32(row.statistics.tx_frames)),)
    ),
    # lldpStatsRxPortTable
    Table[LldpPortView](
        (*STATISTICS, 7, 1),
        _ports,
        _port_index,
        (
            (2, lambda row: counter32(row.statistics.rx_frames_discarded)),
            (3, lambda row: counter32(row.statistics.rx_frames_errors)),
            (4, lambda row: counter32(row.statistics.rx_frames)),
            (5, lambda _: counter32(0)),
            (6, lambda _: counter32(0)),
            (7, lambda row: gauge32(row.statistics.rx_ageouts)),
        ),
    ),
    # lldpLocPortTable
    Table[LldpPortView](
        (*LOCAL, 7, 1),
        _ports,
        _port_index,
        (
            (2, lambda row: integer(row.port_id.subtype)),
            (3, lambda row: octets(row.port_id.value)),
            (4, lambda row: admin_text(row.description)),
        ),
    ),
    # lldpLocManAddrTable; the length counts the subtype's octet too
    Table[_Part[ManagementAddress]](
        (*LOCAL, 8, 1),
        _local_addresses,
        _index,
        (
            (3, lambda row: integer(1 + len(row.part.address))),
            (4, lambda row: integer(row.part.interface_subtype)),
            (5, lambda row: integer(row.part.interface_number)),
            (6, lambda row: _object_id(row.part)),
        ),
    ),
    # lldpRemTable
    Table[NeighbourView](
        (*REMOTE, 1, 1),
        _neighbours,
        _neighbour_index,
        (
            (4, lambda row: integer(row.neighbour.chassis.subtype)),
            (5, lambda row: octets(row.neighbour.chassis.value)),
            (6, lambda row: integer(row.neighbour.port_id.subtype)),
            (7, lambda row: octets(row.neighbour.port_id.value)),
            (8, lambda row: admin_text(row.neighbour.port_description)),
            (9, lambda row: admin_text(row.neighbour.system_name)),
            (10, lambda row: admin_text(row.neighbour.system_description)),
            (11, lambda row: _capabilities(row.neighbour, "supported")),
            (12, lambda row: _capabilities(row.neighbour, "enabled")),
        ),
    ),
    # lldpRemManAddrTable
    Table[_Part[ManagementAddress]](
        (*REMOTE, 2, 1),
        lambda view: [
            _Part((*_neighbour_index(row), *_address_index(address)), address)
            for row in view.lldp.neighbours
            for address in row.neighbour.management
        ],
        _index,
        (
            (3, lambda row: integer(row.part.interface_subtype)),
            # 32 bits without sign in the frame, Integer32 in the MIB
            (4, lambda row: integer(min(row.part.interface_number, 0x7FFF_FFFF))),
            (5, lambda row: _object_id(row.part)),
        ),
    ),
    # lldpXdot3LocPortTable, lldpXdot3RemPortTable
    Table[_Part[MacPhyStatus]](
        (*DOT3, 2, 1, 1),
        lambda view: [_Part(_port_index(port), port.mac_phy) for port in view.lldp.ports],
        _index,
        _DOT3_COLUMNS,
    ),
    Table[_Part[MacPhyStatus]]((*DOT3, 3, 1, 1), _of_neighbours(_mac_phy), _index, _DOT3_COLUMNS),
    # lldpXPnoLocTable, lldpXPnoRemTable
    Table[_Part[_Pno]](
        (*PNO, 2, 1, 1),
        lambda view: [
            _Part(_port_index(port), _Pno(PortStatus(), MeasuredDelays(), view.lldp.system.name))
            for port in view.lldp.ports
        ],
        _index,
        _PNO_COLUMNS,
    ),
    Table[_Part[_Pno]]((*PNO, 3, 1, 1), _of_neighbours(_pno), _index, _PNO_COLUMNS),
)
