"""Classes of a PROFINET drive's acyclic frames, as injections select them."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.alarms.rta import FIRST_ACK, RtaType, parse_rta
from pnfarm.protocols.profinet.wire.frame_id import FrameClass, classify_frame_id
from pnfarm.wire.ethernet import ETHERTYPE_ARP, ETHERTYPE_IPV4, ETHERTYPE_LLDP, ETHERTYPE_PROFINET, ETHERTYPE_VLAN

__all__ = [
    "ALARM", "ALARM_ACK", "ALARM_ERROR", "ARP", "CLASSES", "DCP", "LLDP", "OTHER", "RPC", "acknowledging_nothing",
    "frame_class",
]  # fmt: skip

#: Hello, Get, Set, Identify and their answers.
DCP: Final = "dcp"
#: UDP other than SNMP; later fragments carry no ports and are lost with the first.
RPC: Final = "rpc"
#: DATA-RTA-PDU: an alarm or an AlarmAck.
ALARM: Final = "alarm"
#: ACK-RTA-PDU and NACK-RTA-PDU.
ALARM_ACK: Final = "alarm-ack"
#: ERR-RTA-PDU: it ends a connection, and acknowledges nothing.
ALARM_ERROR: Final = "alarm-error"
ARP: Final = "arp"
LLDP: Final = "lldp"
OTHER: Final = ""
CLASSES: Final = frozenset({DCP, RPC, ALARM, ALARM_ACK, ALARM_ERROR, ARP, LLDP})

_ETHERTYPES = {ETHERTYPE_ARP: ARP, ETHERTYPE_LLDP: LLDP}
_UDP = 17
#: SNMP and its traps: the only other UDP of a drive.
_SNMP = frozenset({161, 162})
_RTA: dict[int, str] = {RtaType.DATA: ALARM, RtaType.ACK: ALARM_ACK, RtaType.NACK: ALARM_ACK, RtaType.ERR: ALARM_ERROR}


def frame_class(frame: bytes) -> str:
    """The class of a frame; any bytes have one."""
    ethertype, payload = _payload(frame)
    if ethertype == ETHERTYPE_IPV4:
        return RPC if _is_rpc(payload) else OTHER
    if ethertype in _ETHERTYPES:
        return _ETHERTYPES[ethertype]
    if ethertype != ETHERTYPE_PROFINET or len(payload) < 2:
        return OTHER
    if classify_frame_id(int.from_bytes(payload[:2], "big")) is FrameClass.DCP:
        return DCP
    try:
        return _RTA.get(parse_rta(payload).type, OTHER)
    except DecodeError:
        return OTHER


def _payload(frame: bytes) -> tuple[int, bytes]:
    """EtherType and what follows, after a VLAN tag if there is one; (0, b"") for what is too short."""
    start = 12
    if int.from_bytes(frame[12:14], "big") == ETHERTYPE_VLAN:
        start = 16
    if len(frame) < start + 2:
        return 0, b""
    return int.from_bytes(frame[start : start + 2], "big"), frame[start + 2 :]


def _is_rpc(packet: bytes) -> bool:
    if len(packet) < 20 or packet[9] != _UDP:
        return False
    if int.from_bytes(packet[6:8], "big") & 0x1FFF:
        return True
    header = (packet[0] & 0x0F) * 4
    ports = {int.from_bytes(packet[at : at + 2], "big") for at in (header, header + 2)}
    return not ports & _SNMP


def acknowledging_nothing(frame: bytes) -> bytes | None:
    """What is left of an :data:`ALARM` or :data:`ALARM_ACK`: of an alarm its VarPart, of an acknowledgement nothing."""
    _, payload = _payload(frame)
    pdu = parse_rta(payload)
    if pdu.type != RtaType.DATA:
        return None
    return frame[: len(frame) - len(payload)] + replace(pdu, ack_sequence=FIRST_ACK).emit()
