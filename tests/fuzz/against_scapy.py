"""Scapy as the other implementation."""

# ruff: noqa: E402 - scapy writes to its logger while it is imported

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

from tests.fuzz.layers import Answer, Fields

logging.getLogger("scapy").setLevel(logging.CRITICAL)

import scapy
from scapy.config import conf
from scapy.contrib.enipTCP import ENIPTCP
from scapy.contrib.lldp import LLDPDU, LLDPDUChassisID, LLDPDUPortID, LLDPDUTimeToLive
from scapy.contrib.pnio import ProfinetIO
from scapy.contrib.pnio_dcp import DCPNameOfStationBlock, ProfinetDCP
from scapy.contrib.pnio_rpc import Alarm_High, Alarm_Low, Block, PNIOServiceReqPDU, PNIOServiceResPDU
from scapy.layers.dcerpc import DceRpc4
from scapy.layers.inet import ICMP, IP, UDP
from scapy.layers.l2 import ARP, Dot1Q, Ether
from scapy.layers.snmp import SNMP
from scapy.packet import NoPayload, Packet

__all__ = ["LAYERS", "answers", "version"]

#: What a layer cannot read is an exception then, and no raw remainder.
conf.debug_dissector = True


def _mac(text: str) -> str:
    return text.replace(":", "")


def _text(octets: bytes) -> str:
    return octets.decode("latin-1")


def ethernet(data: bytes) -> Fields:
    frame = Ether(data)
    tag = frame.payload if isinstance(frame.payload, Dot1Q) else None
    return {
        "destination": _mac(frame.dst), "source": _mac(frame.src), "type": (tag or frame).type,
        "priority": None if tag is None else tag.prio, "vlan": None if tag is None else tag.vlan,
    }  # fmt: skip


def arp(data: bytes) -> Fields:
    packet = ARP(data)
    return {
        "operation": packet.op, "sender": _mac(packet.hwsrc), "target": _mac(packet.hwdst),
        "sender address": packet.psrc, "target address": packet.pdst,
    }  # fmt: skip


def ipv4(data: bytes) -> Fields:
    packet = IP(data)
    return {
        "source": packet.src, "destination": packet.dst, "protocol": packet.proto, "time to live": packet.ttl,
        "identification": packet.id, "fragment offset": packet.frag, "more fragments": int(packet.flags.MF),
    }  # fmt: skip


def udp(data: bytes) -> Fields:
    packet = UDP(data)
    return {"source": packet.sport, "destination": packet.dport, "length": packet.len}


def icmp(data: bytes) -> Fields:
    packet = ICMP(data)
    return {
        "type": packet.type, "code": packet.code,
        "identifier": packet.fields.get("id"), "sequence": packet.fields.get("seq"),
    }  # fmt: skip


def lldp(data: bytes) -> Fields:
    whole = LLDPDU(data)
    parts = [part for part in whole.iterpayloads() if isinstance(part, LLDPDU) and "_type" in part.fields]
    by_kind = {type(part): part for part in reversed(parts)}
    port = by_kind[LLDPDUPortID]
    return {
        "chassis subtype": by_kind[LLDPDUChassisID].subtype, "port subtype": port.subtype,
        "port": _text(bytes(port.id)) if port.subtype == 7 else None,
        "time to live": by_kind[LLDPDUTimeToLive].ttl,
        "types": tuple(part._type for part in parts if part._type),
    }  # fmt: skip


def _profinet(data: bytes) -> tuple[int, Packet]:
    frame = ProfinetIO(data)
    return frame.frameID, frame.payload


def dcp(data: bytes) -> Fields:
    frame_id, pdu = _profinet(data)
    if not isinstance(pdu, ProfinetDCP):
        raise NotSeenError
    named = [pdu, *_inside(pdu, DCPNameOfStationBlock)]
    return {
        "frame id": frame_id, "service": pdu.service_id, "service type": pdu.service_type, "xid": pdu.xid,
        "names": tuple(_text(part.fields["name_of_station"]) for part in named if "name_of_station" in part.fields),
    }  # fmt: skip


def _inside(packet: Packet, kind: type[Packet]) -> list[Packet]:
    found: list[Packet] = []
    waiting: list[object] = [packet]
    while waiting:
        one = waiting.pop(0)
        if isinstance(one, kind):
            found.append(one)
        if isinstance(one, Packet) and not isinstance(one, NoPayload):
            waiting += [value for value in one.fields.values() if isinstance(value, Packet)]
            waiting += [part for value in one.fields.values() if isinstance(value, list) for part in value]
            waiting.append(one.payload)
    return found


def rta(data: bytes) -> Fields:
    frame_id, outer = _profinet(data)
    if not isinstance(outer, Alarm_High | Alarm_Low):
        raise NotSeenError
    alarm = next(iter(_inside(outer, Block)), None)
    told = {} if alarm is None else alarm.fields
    return {
        "frame id": frame_id, "destination": outer.AlarmDstEndpoint, "source": outer.AlarmSrcEndpoint,
        "type": outer.PDUTypeType, "version": outer.PDUTypeVersion, "send sequence": outer.SendSeqNum,
        "acknowledged sequence": outer.AckSeqNum, "alarm": told.get("AlarmType"), "slot": told.get("SlotNumber"),
        "subslot": told.get("SubslotNumber"), "module": told.get("ModuleIdentNumber"),
    }  # fmt: skip


def rpc(data: bytes) -> Fields:
    pdu = DceRpc4(data)
    return {
        "packet type": pdu.ptype, "flags": int(pdu.flags1), "object": str(pdu.object), "interface": str(pdu.if_id),
        "activity": str(pdu.act_id), "sequence": pdu.seqnum, "operation": pdu.opnum, "fragment": pdu.fragnum,
        "length": pdu.len,
    }  # fmt: skip


def call(data: bytes) -> Fields:
    pdu = DceRpc4(data)
    found = dict(rpc(data))
    body = pdu.payload
    if isinstance(body, PNIOServiceReqPDU):
        found["maximum"] = body.args_max
    if isinstance(body, PNIOServiceResPDU):
        found["status"] = tuple(body.status.to_bytes(4, "big"))
    blocks = _inside(body, Block)
    found["first block"] = blocks[0].block_type if blocks else None
    return found


def snmp(data: bytes) -> Fields:
    message = SNMP(data)
    pdu = message.PDU
    found: dict[str, object] = {"version": message.version.val, "community": _text(message.community.val)}
    names = {"request": "id", "status": "error", "index": "error_index"}
    found |= {ours: getattr(pdu, theirs).val if theirs in pdu.fields else None for ours, theirs in names.items()}
    if "varbindlist" in pdu.fields:
        found["names"] = tuple(one.oid.val for one in pdu.varbindlist)
    return found


def enip(data: bytes) -> Fields:
    pdu = ENIPTCP(data)
    return {
        "command": pdu.commandId, "length": pdu.length, "session": pdu.session, "status": pdu.status,
        "context": pdu.senderContext.to_bytes(8, "little").hex(), "options": pdu.options,
    }  # fmt: skip


class NotSeenError(Exception):
    """Scapy takes the octets for something else."""


LAYERS: dict[str, Callable[[bytes], Fields]] = {
    "ethernet": ethernet, "arp": arp, "ipv4": ipv4, "udp": udp, "icmp": icmp, "lldp": lldp, "dcp": dcp, "rta": rta,
    "rpc": rpc, "call": call, "snmp": snmp, "enip": enip,
}  # fmt: skip


def version() -> str:
    return f"scapy {scapy.__version__}"


def answers(layer: str, inputs: Sequence[bytes]) -> list[Answer]:
    """Scapy's answers, in order."""
    return [_answer(LAYERS[layer], data) for data in inputs]


def _answer(read: Callable[[bytes], Fields], data: bytes) -> Answer:
    try:
        return read(data)
    except NotSeenError:
        return "not seen"
    except Exception as exc:  # noqa: BLE001 - whatever it raises is its refusal
        return type(exc).__name__
