"""The small families in words: ARP, ICMP, the end of an AR, and the heads of what has no words of its own here."""

from __future__ import annotations

from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.decode.calls import ip_packet, udp_words
from pnfarm.buses.profinet.decode.packet import Said
from pnfarm.protocols.profinet.errors import ConnectFault, RtaError, describe_status
from pnfarm.protocols.profinet.wire.alarm_words import alarm_in_words
from pnfarm.protocols.profinet.wire.alarms import AlarmAck, describe_place, parse_alarm
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH, classify_frame_id
from pnfarm.protocols.profinet.wire.lldp import parse_lldp, peer_names
from pnfarm.protocols.profinet.wire.ptcp import PTCP_NAMES, parse_ptcp
from pnfarm.protocols.profinet.wire.rta import RtaType, error_of, parse_rta
from pnfarm.protocols.profinet.wire.snmp import GET, GET_BULK, GET_NEXT, RESPONSE, SET, Pdu, parse_snmp
from pnfarm.wire.arp import OPERATION_REPLY, OPERATION_REQUEST, parse_arp
from pnfarm.wire.ethernet import ETHERTYPE_IPV4, ETHERTYPE_PROFINET
from pnfarm.wire.icmp import TYPE_ECHO_REPLY, TYPE_ECHO_REQUEST, parse_icmp
from pnfarm.wire.ipv4 import PROTOCOL_UDP
from pnfarm.wire.udp import parse_udp

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.profinet.decode.packet import Packet, Shared
    from pnfarm.errors import DecodeError

__all__ = ["alarm", "arp", "icmp", "lldp", "other", "ptcp", "snmp", "unreadable"]

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
    """An RTA-PDU: the end of an AR with its reason, an alarm, its acknowledgement, or the transport's."""
    pdu = parse_rta(packet.payload)
    priority = "high" if pdu.frame_id == ALARM_HIGH else "low"
    if pdu.type == RtaType.ERR:
        status = error_of(pdu).status
        words = describe_status(status).removeprefix("RTA error: ").removeprefix("RTA_ERR_CLS_PROTOCOL: ")
        counts = {"aborts": words}
        if (status.error_code1, status.error_code2) == (
            ConnectFault.RTA_ERR_CLS_PROTOCOL,
            RtaError.CONSUMER_DHT_EXPIRED,
        ):
            counts["watchdogs"] = ""
        yield Said("ERR-RTA", words + _silence(packet, shared), {"status": f"0x{int(status):08X}"}, counts)
        return
    numbers = f"sequence 0x{pdu.send_sequence:04X}, acknowledges 0x{pdu.ack_sequence:04X}"
    if pdu.type != RtaType.DATA:
        name = _RTA_TYPES.get(pdu.type, f"type {pdu.type}")
        yield Said(f"alarm {name}", f"{priority} priority, {numbers}")
        return
    said = parse_alarm(pdu.body)
    if isinstance(said, AlarmAck):
        words = "taken" if said.status.ok else describe_status(said.status)
        yield Said("AlarmAck", f"{describe_place(said)}: {words} ({priority} priority, {numbers})")
        return
    yield Said("Alarm", f"{alarm_in_words(said)} ({priority} priority, {numbers})", {}, {"alarms": ""})


def _silence(packet: Packet, shared: Shared) -> str:
    """How long ago the other end was heard last: what ended the connection, where its frames stayed away."""
    for (to, source, _), channel in shared.channels.items():
        if (to, source) == (packet.source, packet.destination) and channel.begun:
            ago = (packet.time_ns - channel.last_ns) / 1e6
            return f"; last cyclic frame of {shared.stations.name(source)} {ago:.1f} ms ago"
    return ""


def lldp(packet: Packet, shared: Shared) -> Iterator[Said]:
    """A neighbour tells itself."""
    pdu = parse_lldp(packet.payload)
    port, station = peer_names(pdu.chassis, pdu.port)
    shared.stations.guess(packet.source, station)
    if not pdu.time_to_live:
        yield Said("LLDP", f"{port} of {station} says good-bye")
        return
    yield Said("LLDP", f"{port} of {station}, believed for {pdu.time_to_live} s")


_SNMP_WORDS = {GET: "Get", GET_NEXT: "GetNext", GET_BULK: "GetBulk", SET: "Set", RESPONSE: "Response"}


def snmp(packet: Packet, shared: Shared) -> Iterator[Said]:
    """A question or an answer of network management."""
    ip = ip_packet(packet, shared)
    if ip is None:
        return
    message = parse_snmp(parse_udp(ip.payload).data)
    version = "v2c" if message.version else "v1"
    if not isinstance(message.pdu, Pdu):
        yield Said(f"SNMP {version}", f"message of type 0x{message.pdu.tag:02X}")
        return
    names = [".".join(map(str, varbind.name)) for varbind in message.pdu.varbinds]
    first = f" {names[0]}" if names else ""
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    yield Said(f"SNMP {version} {_SNMP_WORDS.get(message.pdu.tag, hex(message.pdu.tag))}", f"{first}{more}".strip())


def ptcp(packet: Packet, shared: Shared) -> Iterator[Said]:
    """Neighbours measure the cable several times a second: the first of each kind is worth a line, and another master.

    Every frame where every one is wanted.
    """
    pdu = parse_ptcp(packet.payload)
    key = packet.source, pdu.frame_id
    clock = pdu.master, pdu.subdomain
    known = shared.clocks.get(key)
    shared.clocks[key] = clock
    if known == clock and not shared.every_frame:
        return
    texts = [f"sequence {pdu.sequence}"]
    if pdu.port_mac is not None:
        texts.append(f"port {pdu.port_mac.hex(':')}")
    if pdu.delay_ns:
        texts.append(f"delay {pdu.delay_ns} ns")
    if pdu.master is not None:
        texts.append(f"master {shared.stations.name(pdu.master)}, domain {pdu.subdomain}")
    if known is None and not shared.every_frame:
        texts.append("further ones are only counted")
    yield Said("PTCP", f"{PTCP_NAMES[pdu.frame_id]}, {', '.join(texts)}", {"sequence": pdu.sequence})


def other(packet: Packet, shared: Shared) -> Iterator[Said]:
    """What is no business of a drive's; its lines are left out unless they are asked for."""
    if packet.ethertype == ETHERTYPE_IPV4:
        ip = ip_packet(packet, shared)
        if ip is not None and ip.protocol == PROTOCOL_UDP:
            yield udp_words(parse_udp(ip.payload))
        elif ip is not None:
            yield Said("IP", f"protocol {ip.protocol}")
        return
    if packet.ethertype == ETHERTYPE_PROFINET and len(packet.payload) >= 2:
        frame_id = int.from_bytes(packet.payload[:2], "big")
        yield Said(f"frame id 0x{frame_id:04X}", classify_frame_id(frame_id).value)
    elif packet.ethertype < 0x0600:
        yield Said("IEEE 802.3", f"{packet.ethertype} octets")
    else:
        yield Said(f"EtherType 0x{packet.ethertype:04X}", f"{len(packet.payload)} octets")


def unreadable(exc: DecodeError) -> Said:
    """A PDU that does not follow its format."""
    return Said("malformed", str(exc), {"reason": exc.reason}, {"malformed": exc.reason})
