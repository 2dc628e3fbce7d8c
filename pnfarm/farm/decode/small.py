"""The small families in words: ARP, ICMP, the end of an AR, and the heads of what has no words of its own here."""

from __future__ import annotations

from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.farm.decode.calls import ip_packet
from pnfarm.farm.decode.packet import Said
from pnfarm.protocols.profinet.errors import ConnectFault, RtaError, describe_status
from pnfarm.protocols.profinet.rta import parse_rta_error
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH, classify_frame_id
from pnfarm.wire.arp import OPERATION_REPLY, OPERATION_REQUEST, parse_arp
from pnfarm.wire.icmp import TYPE_ECHO_REPLY, TYPE_ECHO_REQUEST, parse_icmp
from pnfarm.wire.octets import Reader

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.errors import DecodeError
    from pnfarm.farm.decode.packet import Packet, Shared

__all__ = ["alarm", "arp", "icmp", "lldp", "other", "snmp"]

_NOBODY = IPv4Address(0)
#: IEC 61158-6-10, coding of PDUType.Type.
_RTA_TYPES = {1: "DATA", 2: "NACK", 3: "ACK", 4: "ERR"}
_ERR = 4


def arp(packet: Packet, shared: Shared) -> Iterator[Said]:
    """Who asks for whose address."""
    pdu = parse_arp(packet.payload)
    shared.stations.learn(pdu.sender_mac, ip=pdu.sender_ip)
    if pdu.operation == OPERATION_REPLY:
        yield Said("ARP", f"{pdu.sender_ip} is at {pdu.sender_mac.hex(':')}")
    elif pdu.operation != OPERATION_REQUEST:
        yield Said("ARP", f"operation {pdu.operation}")
    elif pdu.sender_ip == pdu.target_ip:
        yield Said("ARP", f"announces {pdu.sender_ip}")
    elif pdu.sender_ip == _NOBODY:
        yield Said("ARP", f"probes {pdu.target_ip}")
    else:
        yield Said("ARP", f"who has {pdu.target_ip}? tell {pdu.sender_ip}")


def icmp(packet: Packet, shared: Shared) -> Iterator[Said]:
    """Echo and the rest."""
    ip = ip_packet(packet, shared)
    if ip is None:
        return
    message = parse_icmp(ip.payload)
    kind = {TYPE_ECHO_REQUEST: "request", TYPE_ECHO_REPLY: "reply"}.get(message.message_type)
    text = f"echo {kind}" if kind else f"type {message.message_type} code {message.code}"
    yield Said("ICMP", f"{text}, {len(message.data)} octets")


def alarm(packet: Packet, shared: Shared) -> Iterator[Said]:
    """An RTA-PDU: the end of an AR with its reason, or an alarm's head."""
    reader = Reader(packet.payload)
    priority = "high" if reader.u16() == ALARM_HIGH else "low"
    reader.skip(4)
    kind = reader.u8() & 0x0F
    if kind == _ERR:
        status = parse_rta_error(packet.payload).status
        words = describe_status(status).removeprefix("RTA error: ").removeprefix("RTA_ERR_CLS_PROTOCOL: ")
        counts = {"aborts": words}
        if (status.error_code1, status.error_code2) == (
            ConnectFault.RTA_ERR_CLS_PROTOCOL,
            RtaError.CONSUMER_DHT_EXPIRED,
        ):
            counts["watchdogs"] = ""
        yield Said("ERR-RTA", words + _silence(packet, shared), {"status": f"0x{int(status):08X}"}, counts)
        return
    reader.skip(1)
    send, acknowledged, length = reader.u16(), reader.u16(), reader.u16()
    name = _RTA_TYPES.get(kind, f"type {kind}")
    numbers = f"sequence 0x{send:04X}, acknowledges 0x{acknowledged:04X}"
    octets = f", {length} octets" if length else ""
    yield Said(f"alarm {name}", f"{priority} priority, {numbers}{octets}", {}, {"alarms": ""} if length else {})


def _silence(packet: Packet, shared: Shared) -> str:
    """How long ago the other end was heard last: what ended the connection, where its frames stayed away."""
    for (to, source, _), channel in shared.channels.items():
        if (to, source) == (packet.source, packet.destination) and channel.begun:
            ago = (packet.time_ns - channel.last_ns) / 1e6
            return f"; last cyclic frame of {shared.stations.name(source)} {ago:.1f} ms ago"
    return ""


def lldp(packet: Packet, shared: Shared) -> Iterator[Said]:
    """A neighbour tells itself."""
    del shared
    yield Said("LLDP", f"{len(packet.payload)} octets")


def snmp(packet: Packet, shared: Shared) -> Iterator[Said]:
    """A question or an answer of network management."""
    ip = ip_packet(packet, shared)
    if ip is not None:
        yield Said("SNMP", f"{len(ip.payload)} octets")


def other(packet: Packet, shared: Shared) -> Iterator[Said]:
    """What is no business of a drive's; its lines are left out unless they are asked for."""
    del shared
    if packet.ethertype == 0x8892 and len(packet.payload) >= 2:
        frame_id = int.from_bytes(packet.payload[:2], "big")
        yield Said(f"frame id 0x{frame_id:04X}", classify_frame_id(frame_id).value)
    elif packet.ethertype < 0x0600:
        yield Said("IEEE 802.3", f"{packet.ethertype} octets")
    else:
        yield Said(f"EtherType 0x{packet.ethertype:04X}", f"{len(packet.payload)} octets")


def unreadable(exc: DecodeError) -> Said:
    """A PDU that does not follow its format."""
    return Said("malformed", str(exc), {"reason": exc.reason}, {"malformed": exc.reason})
