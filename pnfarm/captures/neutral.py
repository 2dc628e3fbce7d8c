"""Describes frames without a bus: ARP, ICMP, and the headers of everything else."""

from __future__ import annotations

from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.captures.packet import Description
from pnfarm.wire.arp import OPERATION_REPLY, OPERATION_REQUEST, parse_arp
from pnfarm.wire.ethernet import ETHERTYPE_IPV4
from pnfarm.wire.icmp import TYPE_ECHO_REPLY, TYPE_ECHO_REQUEST, parse_icmp
from pnfarm.wire.ipv4 import PROTOCOL_UDP, parse_ipv4
from pnfarm.wire.udp import parse_udp

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.captures.packet import Packet
    from pnfarm.errors import DecodeError

__all__ = ["arp", "icmp", "other", "unreadable"]

_NOBODY = IPv4Address(0)


def arp(packet: Packet) -> Iterator[Description]:
    """ARP: who asks for whose address."""
    pdu = parse_arp(packet.payload)
    if pdu.operation == OPERATION_REPLY:
        yield Description("ARP", f"{pdu.sender_ip} is at {pdu.sender_mac.hex(':')}")
    elif pdu.operation != OPERATION_REQUEST:
        yield Description("ARP", f"operation {pdu.operation}")
    elif pdu.sender_ip == pdu.target_ip:
        yield Description("ARP", f"announces {pdu.sender_ip}")
    elif pdu.sender_ip == _NOBODY:
        yield Description("ARP", f"probes {pdu.target_ip}")
    else:
        yield Description("ARP", f"who has {pdu.target_ip}? tell {pdu.sender_ip}")


def icmp(packet: Packet) -> Iterator[Description]:
    """ICMP: echo and other messages."""
    message = parse_icmp(parse_ipv4(packet.payload).payload)
    kind = {TYPE_ECHO_REQUEST: "request", TYPE_ECHO_REPLY: "reply"}.get(message.message_type)
    text = f"echo {kind}" if kind else f"type {message.message_type} code {message.code}"
    yield Description("ICMP", f"{text}, {len(message.data)} octets")


def other(packet: Packet) -> Iterator[Description]:
    """Any other frame; its lines are shown only on request."""
    if packet.ethertype == ETHERTYPE_IPV4:
        ip = parse_ipv4(packet.payload)
        if ip.protocol == PROTOCOL_UDP:
            udp = parse_udp(ip.payload)
            yield Description("UDP", f"port {udp.source_port} -> {udp.destination_port}, {len(udp.data)} octets")
        else:
            yield Description("IP", f"protocol {ip.protocol}")
    elif packet.ethertype < 0x0600:
        yield Description("IEEE 802.3", f"{packet.ethertype} octets")
    else:
        yield Description(f"EtherType 0x{packet.ethertype:04X}", f"{len(packet.payload)} octets")


def unreadable(exc: DecodeError) -> Description:
    """A PDU that does not follow its format."""
    return Description("malformed", str(exc), {"reason": exc.reason}, {"malformed": exc.reason})
