"""What is compared with other implementations: layers that they have too, read by our parsers as plain fields.

An *answer* to some octets is a mapping of fields, or a text: the reason of a refusal.  A field that is None is not
compared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.wire.encapsulation import parse_encapsulation
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmNotification, parse_alarm
from pnfarm.protocols.profinet.wire.alarms.rta import RtaType, error_status, parse_rta
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import split_blocks
from pnfarm.protocols.profinet.wire.dcp.blocks import NameBlock, UnknownBlock
from pnfarm.protocols.profinet.wire.dcp.pdu import SERVICE_HELLO, TYPE_REQUEST, TYPE_SUCCESS, parse_dcp
from pnfarm.protocols.profinet.wire.lldp.pdu import parse_lldp
from pnfarm.protocols.profinet.wire.lldp.tlvs import tlv_value
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    UUID_EPM,
    PacketType,
    parse_request_args,
    parse_response_args,
    parse_rpc,
)
from pnfarm.protocols.profinet.wire.snmp.message import GET_BULK, OtherPdu, parse_snmp
from pnfarm.wire.arp import parse_arp
from pnfarm.wire.ethernet import parse_ethernet
from pnfarm.wire.icmp import parse_icmp
from pnfarm.wire.ipv4 import parse_ipv4
from pnfarm.wire.udp import parse_udp

__all__ = ["LAYERS", "Answer", "Fields", "Layer", "ours"]

Fields = Mapping[str, object]
Answer = Fields | str


def ethernet(data: bytes) -> Fields:
    frame = parse_ethernet(data)
    tag = frame.vlan
    return {
        "destination": frame.destination.hex(),
        "source": frame.source.hex(),
        # below 0x0600 it is a length, which others tell in other ways
        "type": frame.ethertype if frame.ethertype >= 0x600 else None,
        "priority": tag and tag.priority,
        "vlan": tag and tag.vid,
    }


def arp(data: bytes) -> Fields:
    packet = parse_arp(data)
    return {
        "operation": packet.operation,
        "sender": packet.sender_mac.hex(),
        "target": packet.target_mac.hex(),
        "sender address": str(packet.sender_ip),
        "target address": str(packet.target_ip),
    }


def ipv4(data: bytes) -> Fields:
    packet = parse_ipv4(data)
    return {
        "source": str(packet.source),
        "destination": str(packet.destination),
        "protocol": packet.protocol,
        "time to live": packet.ttl,
        "identification": packet.identification,
        "fragment offset": packet.fragment_offset // 8,
        "more fragments": int(packet.more_fragments),
    }


def udp(data: bytes) -> Fields:
    datagram = parse_udp(data)
    return {"source": datagram.source_port, "destination": datagram.destination_port, "length": len(datagram.data) + 8}


def icmp(data: bytes) -> Fields:
    message = parse_icmp(data)
    echo = message.message_type in {0, 8}
    return {
        "type": message.message_type,
        "code": message.code,
        "identifier": message.identifier if echo else None,
        "sequence": message.sequence if echo else None,
    }


def _printable(octets: bytes) -> str | None:
    """Other texts are shown in many ways; a semicolon stands between Wireshark's."""
    return octets.decode("ascii") if octets and all(0x20 < one < 0x7F and one != 0x3B for one in octets) else None


def dcp(data: bytes) -> Fields:
    pdu = parse_dcp(data)
    options = [*pdu.requested]
    names = []
    for block in pdu.blocks:
        options.append(block.option_id)
        if isinstance(block, NameBlock):
            names.append(_printable(block.name.encode("latin-1")))
    # others go on in another way where they do not know the service or a block
    alike = (
        pdu.service_type in {TYPE_REQUEST, TYPE_SUCCESS}
        and pdu.service_id <= SERVICE_HELLO
        and not pdu.undecoded
        and not any(isinstance(block, UnknownBlock) for block in pdu.blocks)
    )
    return {
        "frame id": pdu.frame_id,
        "service": pdu.service_id,
        "service type": pdu.service_type,
        "xid": pdu.xid,
        "options": tuple(option.option for option in options) if alike else None,
        "names": tuple(names) if alike and None not in names else None,
    }


def lldp(data: bytes) -> Fields:
    pdu = parse_lldp(data)
    return {
        "chassis subtype": pdu.chassis.subtype,
        "port subtype": pdu.port.subtype,
        "port": _printable(pdu.port.value) if pdu.port.subtype == 7 else None,
        "time to live": pdu.time_to_live,
        "types": (1, 2, 3, *(int(tlv_value(tlv)[0]) for tlv in pdu.tlvs)),
    }


def rta(data: bytes) -> Fields:
    pdu = parse_rta(data)
    alarm = None
    if pdu.type == RtaType.DATA:
        alarm = parse_alarm(pdu.body)
    if pdu.type == RtaType.ERR:
        error_status(pdu)
    return {
        "frame id": pdu.frame_id,
        "destination": pdu.destination,
        "source": pdu.source,
        "type": pdu.type,
        "version": pdu.version,
        "send sequence": pdu.send_sequence,
        "acknowledged sequence": pdu.ack_sequence,
        "alarm": alarm and alarm.alarm_type,
        "slot": alarm and alarm.slot,
        "subslot": alarm and alarm.subslot,
        "module": alarm.module_ident if isinstance(alarm, AlarmNotification) else None,
    }


def rpc(data: bytes) -> Fields:
    pdu = parse_rpc(data)
    return {
        "packet type": pdu.packet_type,
        "flags": pdu.flags1,
        "object": str(pdu.object_uuid),
        "interface": str(pdu.interface),
        "activity": str(pdu.activity),
        "sequence": pdu.sequence,
        "operation": pdu.opnum,
        "fragment": pdu.fragment_number,
        "length": len(pdu.body),
    }


def call(data: bytes) -> Fields:
    """A call of PROFINET down to its blocks."""
    pdu = parse_rpc(data)
    found = dict(rpc(data))
    if pdu.interface == UUID_EPM or pdu.is_fragment or pdu.kind not in {PacketType.REQUEST, PacketType.RESPONSE}:
        return found
    if pdu.kind == PacketType.REQUEST:
        args = parse_request_args(pdu.body, little_endian=pdu.little_endian)
        found["maximum"] = args.args_maximum
    else:
        args = parse_response_args(pdu.body, little_endian=pdu.little_endian)
        found["status"] = tuple(args.status.emit())
    if pdu.opnum in {0, 1, 4}:
        parse_blocks(args.payload)
    blocks = split_blocks(args.payload) if pdu.opnum in {0, 1, 4} else ()
    found["first block"] = blocks[0].block_type if blocks else None
    return found


def snmp(data: bytes) -> Fields:
    message = parse_snmp(data)
    found: dict[str, object] = {"version": message.version, "community": _printable(message.community)}
    if not isinstance(message.pdu, OtherPdu):
        pdu = message.pdu
        bulk = pdu.tag == GET_BULK
        found |= {
            "kind": pdu.tag - 0xA0,
            "request": pdu.request_id,
            "status": None if bulk else pdu.error_status,
            "index": None if bulk else pdu.error_index,
            "names": tuple(".".join(map(str, one.name)) for one in pdu.varbinds),
        }
    return found


def enip(data: bytes) -> Fields:
    pdu = parse_encapsulation(data)
    return {
        "command": pdu.command,
        "length": len(pdu.data),
        "session": pdu.session,
        "status": pdu.status,
        "context": pdu.context.hex(),
        "options": pdu.options,
    }


@dataclass(frozen=True)
class Layer:
    """``pools``: the layers of the corpus that hold good octets of it."""

    name: str
    read: Callable[[bytes], Fields]
    pools: tuple[str, ...]

    def pool(self, layers: Mapping[str, Sequence[bytes]]) -> list[bytes]:
        return [octets for name in self.pools for octets in layers[name]]


LAYERS = {
    name: Layer(name, read, pools)
    for name, read, pools in (
        ("ethernet", ethernet, ("frame",)),
        ("arp", arp, ("arp",)),
        ("ipv4", ipv4, ("ipv4",)),
        ("udp", udp, ("udp",)),
        ("icmp", icmp, ("icmp",)),
        ("lldp", lldp, ("lldp",)),
        ("dcp", dcp, ("dcp",)),
        ("rta", rta, ("rta",)),
        ("rpc", rpc, ("rpc",)),
        ("call", call, ("rpc",)),
        ("snmp", snmp, ("snmp",)),
        ("enip", enip, ("enip",)),
    )
}


def ours(layer: Layer, data: bytes) -> Answer:
    """What our parser says."""
    try:
        return layer.read(data)
    except DecodeError as exc:
        return exc.reason
