"""Describes frames without a bus: ARP, ICMP, and the headers of everything else."""

from __future__ import annotations

from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.captures.packet import Description
from pnfarm.wire.arp import OPERATION_REPLY, OPERATION_REQUEST, parse_arp
from pnfarm.wire.ethernet import ETHERTYPE_IPV4
from pnfarm.wire.icmp import TYPE_ECHO_REPLY, TYPE_ECHO_REQUEST, parse_icmp
from pnfarm.wire.ipv4 import PROTOCOL_UDP, Ipv4Packet, parse_ipv4
from pnfarm.wire.udp import parse_udp

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.captures.packet import Capture, Packet
    from pnfarm.errors import DecodeError
    from pnfarm.wire.udp import UdpDatagram

__all__ = ["arp", "describe_udp", "icmp", "ip_packet", "other", "unreadable"]

_NOBODY = IPv4Address(0)


def describe_udp(datagram: UdpDatagram) -> Description:
    """Ports and length of any other UDP datagram."""
    return Description(
        "UDP", f"port {datagram.source_port} -> {datagram.destination_port}, {len(datagram.data)} octets"
    )


def ip_packet(packet: Packet, capture: Capture) -> Ipv4Packet | None:
    """The whole IP packet that a frame completes; None while fragments of it are missing."""
    ip = parse_ipv4(packet.payload)
    if not (ip.more_fragments or ip.fragment_offset):
        return ip
    return capture.joined(ip, packet.time_ns)


def arp(packet: Packet, _: Capture) -> Iterator[Description]:
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


def icmp(packet: Packet, capture: Capture) -> Iterator[Description]:
    """ICMP: echo and other messages."""
    ip = ip_packet(packet, capture)
    if ip is None:
        return
    message = parse_icmp(ip.payload)
    kind = {TYPE_ECHO_REQUEST: "request", TYPE_ECHO_REPLY: "reply"}.get(message.message_type)
    text = f"echo {kind}" if kind else f"type {message.message_type} code {message.code}"
    yield Description("ICMP", f"{text}, {len(message.data)} octets")


def other(packet: Packet, capture: Capture) -> Iterator[Description]:
    """Any other frame; its lines are shown only on request."""
    if packet.ethertype == ETHERTYPE_IPV4:
        ip = ip_packet(packet, capture)
        if ip is not None and ip.protocol == PROTOCOL_UDP:
            yield describe_udp(parse_udp(ip.payload))
        elif ip is not None:
            yield Description("IP", f"protocol {ip.protocol}")
    elif packet.ethertype < 0x0600:
        yield Description("IEEE 802.3", f"{packet.ethertype} octets")
    else:
        yield Description(f"EtherType 0x{packet.ethertype:04X}", f"{len(packet.payload)} octets")


def unreadable(exc: DecodeError) -> Description:
    """A PDU that does not follow its format."""
    return Description("malformed", str(exc), {"reason": exc.reason}, {"malformed": exc.reason})
