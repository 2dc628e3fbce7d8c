"""MIB-II: the groups system, interfaces and snmp, with the interfaces' extension.

Names and types are those of RFC 3418 (SNMPv2-MIB), RFC 1213 and RFC 2863 (IF-MIB).  The snmp group also has the
counters that RFC 3418 calls obsolete: PROFINET refers to RFC 1213, where they are current.
"""

from __future__ import annotations

from enum import IntEnum

from pnfarm.protocols.profinet.snmp.mib import Reading, Scalar, Table, display_text, truth
from pnfarm.protocols.profinet.snmp.view import InterfaceView, SystemText
from pnfarm.protocols.profinet.wire.snmp.message import (
    Oid,
    Value,
    counter32,
    counter64,
    gauge32,
    integer,
    object_id,
    octets,
    time_ticks,
)

__all__ = ["INTERFACE_TABLES", "PROFINET_OBJECT_ID", "SYSTEM_SCALARS", "WRITABLE", "Statistic"]

MIB_2: Oid = (1, 3, 6, 1, 2, 1)
SYSTEM: Oid = (*MIB_2, 1)
INTERFACES: Oid = (*MIB_2, 2)
SNMP: Oid = (*MIB_2, 11)
IF_X_ENTRY: Oid = (*MIB_2, 31, 1, 1, 1)

#: PROFIBUS Nutzerorganisation's enterprise, the sysObjectID of a PROFINET device (private enterprise number 24686).
PROFINET_OBJECT_ID: Oid = (1, 3, 6, 1, 4, 1, 24686)
#: What a device of the physical, data link, network and application layer says: the value for PROFINET devices.
SYS_SERVICES = 78
#: IANAifType: ethernetCsmacd.
ETHERNET_CSMACD = 6
_MTU = 1500
#: ifAdminStatus and ifOperStatus.
_UP, _DOWN = 1, 2
#: snmpEnableAuthenTraps and ifLinkUpDownTrapEnable: this agent sends none.
_DISABLED = 2
#: ifSpecific: no reference, zeroDotZero.
_ZERO_DOT_ZERO: Oid = (0, 0)


class Statistic(IntEnum):
    """The snmp group (RFC 1213, 6.10): the arc below it."""

    IN_PKTS = 1
    OUT_PKTS = 2
    IN_BAD_VERSIONS = 3
    IN_BAD_COMMUNITY_NAMES = 4
    IN_BAD_COMMUNITY_USES = 5
    IN_ASN_PARSE_ERRS = 6
    IN_TOO_BIGS = 8
    IN_NO_SUCH_NAMES = 9
    IN_BAD_VALUES = 10
    IN_READ_ONLYS = 11
    IN_GEN_ERRS = 12
    IN_TOTAL_REQ_VARS = 13
    IN_TOTAL_SET_VARS = 14
    IN_GET_REQUESTS = 15
    IN_GET_NEXTS = 16
    IN_SET_REQUESTS = 17
    IN_GET_RESPONSES = 18
    IN_TRAPS = 19
    OUT_TOO_BIGS = 20
    OUT_NO_SUCH_NAMES = 21
    OUT_BAD_VALUES = 22
    OUT_GEN_ERRS = 24
    OUT_GET_REQUESTS = 25
    OUT_GET_NEXTS = 26
    OUT_SET_REQUESTS = 27
    OUT_GET_RESPONSES = 28
    OUT_TRAPS = 29
    SILENT_DROPS = 31
    PROXY_DROPS = 32


#: The objects that a manager may write, by the name of their instance.
WRITABLE: dict[Oid, SystemText] = {(*SYSTEM, text.value, 0): text for text in SystemText}


def _statistic(which: Statistic) -> Scalar:
    def read(reading: Reading) -> Value:
        return counter32(reading.statistics[which])

    return Scalar((*SNMP, which), read)


SYSTEM_SCALARS = (
    Scalar((*SYSTEM, 1), lambda r: display_text(r.view.system.description)),
    Scalar((*SYSTEM, 2), lambda _: object_id(PROFINET_OBJECT_ID)),
    Scalar((*SYSTEM, 3), lambda r: time_ticks(r.view.system.uptime_ns)),
    Scalar((*SYSTEM, 4), lambda r: display_text(r.view.system.contact)),
    Scalar((*SYSTEM, 5), lambda r: display_text(r.view.system.name)),
    Scalar((*SYSTEM, 6), lambda r: display_text(r.view.system.location)),
    Scalar((*SYSTEM, 7), lambda _: integer(SYS_SERVICES)),
    Scalar((*INTERFACES, 1), lambda r: integer(len(r.view.interfaces))),
    *(_statistic(which) for which in Statistic),
    Scalar((*SNMP, 30), lambda _: integer(_DISABLED)),
)


def _status(row: InterfaceView) -> Value:
    return integer(_UP if row.up else _DOWN)


#: ifTable: the state that the manager requests (ifAdminStatus) is always up.
_IF_COLUMNS = (
    (1, lambda row: integer(row.index)),
    (2, lambda row: display_text(row.description)),
    (3, lambda _: integer(ETHERNET_CSMACD)),
    (4, lambda _: integer(_MTU)),
    (5, lambda row: gauge32(row.speed)),
    (6, lambda row: octets(row.mac)),
    (7, lambda _: integer(_UP)),
    (8, _status),
    (9, lambda _: time_ticks(0)),
    (10, lambda row: counter32(row.counters.in_octets)),
    (11, lambda row: counter32(row.counters.in_unicast)),
    (12, lambda row: counter32(row.counters.in_multicast + row.counters.in_broadcast)),
    (13, lambda row: counter32(row.counters.in_discards)),
    (14, lambda row: counter32(row.counters.in_errors)),
    (15, lambda row: counter32(row.counters.in_unknown_protocols)),
    (16, lambda row: counter32(row.counters.out_octets)),
    (17, lambda row: counter32(row.counters.out_unicast)),
    (18, lambda row: counter32(row.counters.out_multicast + row.counters.out_broadcast)),
    (19, lambda row: counter32(row.counters.out_discards)),
    (20, lambda _: counter32(0)),
    (21, lambda _: gauge32(0)),
    (22, lambda _: object_id(_ZERO_DOT_ZERO)),
)

_IF_X_COLUMNS = (
    (1, lambda row: display_text(row.name)),
    (2, lambda row: counter32(row.counters.in_multicast)),
    (3, lambda row: counter32(row.counters.in_broadcast)),
    (4, lambda row: counter32(row.counters.out_multicast)),
    (5, lambda row: counter32(row.counters.out_broadcast)),
    (6, lambda row: counter64(row.counters.in_octets)),
    (7, lambda row: counter64(row.counters.in_unicast)),
    (8, lambda row: counter64(row.counters.in_multicast)),
    (9, lambda row: counter64(row.counters.in_broadcast)),
    (10, lambda row: counter64(row.counters.out_octets)),
    (11, lambda row: counter64(row.counters.out_unicast)),
    (12, lambda row: counter64(row.counters.out_multicast)),
    (13, lambda row: counter64(row.counters.out_broadcast)),
    (14, lambda _: integer(_DISABLED)),
    (15, lambda row: gauge32(row.speed // 1_000_000)),
    (16, lambda _: integer(truth(False))),
    (17, lambda row: integer(truth(row.has_connector))),
    (18, lambda _: octets(b"")),
    (19, lambda _: time_ticks(0)),
)

INTERFACE_TABLES = (
    Table[InterfaceView]((*INTERFACES, 2, 1), lambda view: view.interfaces, lambda row: (row.index,), _IF_COLUMNS),
    Table[InterfaceView](IF_X_ENTRY, lambda view: view.interfaces, lambda row: (row.index,), _IF_X_COLUMNS),
)
