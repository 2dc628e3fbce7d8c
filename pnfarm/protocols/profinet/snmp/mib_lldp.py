"""LLDP-MIB (IEEE 802.1AB-2005) with the extensions of IEEE 802.3 and of PROFINET.

The extensions are LLDP-EXT-DOT3-MIB (arc 4623) and LLDP-EXT-PNO-MIB (arc 3791, IEC 61158-6-10); of both, what a device
of conformance class B is asked for: the state of its ports and of its neighbours'.  A manager configures nothing here:
what the MIBs call read-write is read-only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from pnfarm.protocols.profinet.snmp.mib import Scalar, Table, admin_text, display_text, truth
from pnfarm.protocols.profinet.snmp.view import (
    Dot3Port,
    LldpPortView,
    ManagementAddress,
    NeighbourView,
    PnoPort,
    SnmpView,
)
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

__all__ = ["LLDP_SCALARS", "LLDP_TABLES"]

Row = TypeVar("Row")
Part = TypeVar("Part")

LLDP: Oid = (1, 0, 8802, 1, 1, 2, 1)
CONFIGURATION: Oid = (*LLDP, 1)
STATISTICS: Oid = (*LLDP, 2)
LOCAL: Oid = (*LLDP, 3)
REMOTE: Oid = (*LLDP, 4)
DOT3: Oid = (*LLDP, 5, 4623, 1)
PNO: Oid = (*LLDP, 5, 3791, 1)

#: Seconds, the MIB's defaults: this agent sends no notifications, and a manager cannot change them.
REINIT_DELAY = 2
TX_DELAY = 2
NOTIFICATION_INTERVAL = 5

LLDP_SCALARS = (
    Scalar((*CONFIGURATION, 1), lambda r: integer(r.view.lldp.tx_interval)),
    Scalar((*CONFIGURATION, 2), lambda r: integer(r.view.lldp.hold_multiplier)),
    Scalar((*CONFIGURATION, 3), lambda _: integer(REINIT_DELAY)),
    Scalar((*CONFIGURATION, 4), lambda _: integer(TX_DELAY)),
    Scalar((*CONFIGURATION, 5), lambda _: integer(NOTIFICATION_INTERVAL)),
    # ZeroBasedCounter32 (RFC 2021) is a Gauge32 on the wire.
    Scalar((*STATISTICS, 1), lambda r: time_ticks(r.view.lldp.statistics.last_change_ns)),
    Scalar((*STATISTICS, 2), lambda r: gauge32(r.view.lldp.statistics.inserts)),
    Scalar((*STATISTICS, 3), lambda r: gauge32(r.view.lldp.statistics.deletes)),
    Scalar((*STATISTICS, 4), lambda r: gauge32(r.view.lldp.statistics.drops)),
    Scalar((*STATISTICS, 5), lambda r: gauge32(r.view.lldp.statistics.ageouts)),
    Scalar((*LOCAL, 1), lambda r: integer(r.view.lldp.chassis_id_subtype)),
    Scalar((*LOCAL, 2), lambda r: octets(r.view.lldp.chassis_id)),
    Scalar((*LOCAL, 3), lambda r: admin_text(r.view.lldp.system_name)),
    Scalar((*LOCAL, 4), lambda r: admin_text(r.view.lldp.system_description)),
    Scalar((*LOCAL, 5), lambda r: octets(r.view.lldp.capabilities_supported)),
    Scalar((*LOCAL, 6), lambda r: octets(r.view.lldp.capabilities_enabled)),
)


class _LocalAddress(NamedTuple):
    """An own address, and the ports that advertise it."""

    address: ManagementAddress
    ports: tuple[LldpPortView, ...]


class _Remote(NamedTuple, Generic[Part]):
    """A part of a neighbour that has rows of its own."""

    neighbour: NeighbourView
    part: Part


def _ports(view: SnmpView) -> tuple[LldpPortView, ...]:
    return view.lldp.ports


def _port_index(row: LldpPortView) -> Oid:
    return (row.number,)


def _local_addresses(view: SnmpView) -> list[_LocalAddress]:
    return [_LocalAddress(address, view.lldp.ports) for address in view.lldp.addresses]


def _local_address_index(row: _LocalAddress) -> Oid:
    return _address_index(row.address)


def _address_index(address: ManagementAddress) -> Oid:
    """Subtype, and the address with its length before it (RFC 2578, 7.7)."""
    return (address.subtype, len(address.address), *address.address)


def _neighbours(view: SnmpView) -> tuple[NeighbourView, ...]:
    return view.lldp.neighbours


def _neighbour_index(row: NeighbourView) -> Oid:
    """lldpRemTimeMark, lldpRemLocalPortNum, lldpRemIndex."""
    return (row.time_mark_ns // 10_000_000 & 0xFFFF_FFFF, row.port, row.index)


def _remote_index(row: _Remote[Any]) -> Oid:
    return _neighbour_index(row.neighbour)


def _port_list(ports: Iterable[LldpPortView]) -> Value:
    """LldpPortList: port 1 is the highest bit of the first octet."""
    numbers = [port.number for port in ports]
    bits = bytearray((max(numbers, default=0) + 7) // 8)
    for number in numbers:
        bits[(number - 1) // 8] |= 0x80 >> (number - 1) % 8
    return octets(bytes(bits))


def _of(
    part: Callable[[Row], Part], columns: Iterable[tuple[int, Callable[[Part], Value]]]
) -> tuple[tuple[int, Callable[[Row], Value]], ...]:
    """The columns of a part of a row as columns of the row."""

    def lifted(read: Callable[[Part], Value]) -> Callable[[Row], Value]:
        return lambda row: read(part(row))

    return tuple((arc, lifted(read)) for arc, read in columns)


_DOT3_COLUMNS: tuple[tuple[int, Callable[[Dot3Port], Value]], ...] = (
    (1, lambda port: integer(truth(port.autoneg_supported))),
    (2, lambda port: integer(truth(port.autoneg_enabled))),
    (3, lambda port: octets(port.autoneg_advertised)),
    (4, lambda port: integer(port.mau_type)),
)
# The delays are Unsigned32.
_PNO_COLUMNS: tuple[tuple[int, Callable[[PnoPort], Value]], ...] = (
    (1, lambda port: gauge32(port.line_delay_ns)),
    (2, lambda port: gauge32(port.tx_delay_ns)),
    (3, lambda port: gauge32(port.rx_delay_ns)),
    (4, lambda port: integer(port.rt2_status)),
    (5, lambda port: integer(port.rt3_status)),
    (6, lambda port: display_text(port.station_name)),
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
    Table[_LocalAddress](
        (*CONFIGURATION, 7, 1), _local_addresses, _local_address_index, ((1, lambda row: _port_list(row.ports)),)
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
            (5, lambda row: counter32(row.statistics.rx_tlvs_discarded)),
            (6, lambda row: counter32(row.statistics.rx_tlvs_unrecognized)),
            (7, lambda row: gauge32(row.statistics.rx_ageouts)),
        ),
    ),
    # lldpLocPortTable
    Table[LldpPortView](
        (*LOCAL, 7, 1),
        _ports,
        _port_index,
        (
            (2, lambda row: integer(row.port_id_subtype)),
            (3, lambda row: octets(row.port_id)),
            (4, lambda row: admin_text(row.description)),
        ),
    ),
    # lldpLocManAddrTable; the length counts the subtype's octet too
    Table[_LocalAddress](
        (*LOCAL, 8, 1),
        _local_addresses,
        _local_address_index,
        (
            (3, lambda row: integer(1 + len(row.address.address))),
            (4, lambda row: integer(row.address.if_subtype)),
            (5, lambda row: integer(row.address.if_id)),
            (6, lambda row: object_id(row.address.object_id)),
        ),
    ),
    # lldpRemTable
    Table[NeighbourView](
        (*REMOTE, 1, 1),
        _neighbours,
        _neighbour_index,
        (
            (4, lambda row: integer(row.chassis_id_subtype)),
            (5, lambda row: octets(row.chassis_id)),
            (6, lambda row: integer(row.port_id_subtype)),
            (7, lambda row: octets(row.port_id)),
            (8, lambda row: admin_text(row.port_description)),
            (9, lambda row: admin_text(row.system_name)),
            (10, lambda row: admin_text(row.system_description)),
            (11, lambda row: octets(row.capabilities_supported)),
            (12, lambda row: octets(row.capabilities_enabled)),
        ),
    ),
    # lldpRemManAddrTable
    Table[_Remote[ManagementAddress]](
        (*REMOTE, 2, 1),
        lambda view: [_Remote(n, address) for n in view.lldp.neighbours for address in n.addresses],
        lambda row: (*_remote_index(row), *_address_index(row.part)),
        (
            (3, lambda row: integer(row.part.if_subtype)),
            # 32 bits without sign in the frame, Integer32 in the MIB
            (4, lambda row: integer(min(row.part.if_id, 0x7FFF_FFFF))),
            (5, lambda row: object_id(row.part.object_id)),
        ),
    ),
    # lldpXdot3LocPortTable, lldpXdot3RemPortTable
    Table[LldpPortView]((*DOT3, 2, 1, 1), _ports, _port_index, _of(lambda row: row.dot3, _DOT3_COLUMNS)),
    Table[_Remote[Dot3Port]](
        (*DOT3, 3, 1, 1),
        lambda view: [_Remote(n, n.dot3) for n in view.lldp.neighbours if n.dot3 is not None],
        _remote_index,
        _of(lambda row: row.part, _DOT3_COLUMNS),
    ),
    # lldpXPnoLocTable, lldpXPnoRemTable
    Table[LldpPortView]((*PNO, 2, 1, 1), _ports, _port_index, _of(lambda row: row.pno, _PNO_COLUMNS)),
    Table[_Remote[PnoPort]](
        (*PNO, 3, 1, 1),
        lambda view: [_Remote(n, n.pno) for n in view.lldp.neighbours if n.pno is not None],
        _remote_index,
        _of(lambda row: row.part, _PNO_COLUMNS),
    ),
)
