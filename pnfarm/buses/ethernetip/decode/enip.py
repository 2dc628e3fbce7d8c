"""The encapsulation in words: sessions, searches, and the messages that carry CIP (CIP volume 2, chapter 2)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from pnfarm.buses.ethernetip.decode.cip import message
from pnfarm.buses.ethernetip.decode.identity import learn_identity
from pnfarm.buses.ethernetip.decode.names import octets_text
from pnfarm.buses.ethernetip.decode.shared import Route
from pnfarm.captures.packet import Description
from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.wire.cpf import CommonPacket, ConnectedAddress, ConnectedData, UnconnectedData, parse_items
from pnfarm.protocols.enip.wire.encapsulation import (
    ENIP_PORT,
    NO_CONTEXT,
    Command,
    EncapsulationPdu,
    EncapsulationStatus,
    RegisterSession,
    parse_encapsulation,
)
from pnfarm.protocols.enip.wire.identity import IdentityItem, ServiceItem
from pnfarm.wire.code import words_of
from pnfarm.wire.ipv4 import PROTOCOL_UDP, parse_ipv4
from pnfarm.wire.octets import Reader
from pnfarm.wire.tcp import PROTOCOL_TCP, parse_tcp
from pnfarm.wire.udp import parse_udp

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.ethernetip.decode.shared import Shared
    from pnfarm.captures.packet import Packet
    from pnfarm.protocols.enip.wire.cpf import Item
    from pnfarm.wire.ipv4 import Ipv4Packet
    from pnfarm.wire.tcp import TcpSegment

__all__ = ["encapsulated"]

_NAMES: Final = {
    Command.NOP: "NOP",
    Command.LIST_SERVICES: "ListServices",
    Command.LIST_IDENTITY: "ListIdentity",
    Command.LIST_INTERFACES: "ListInterfaces",
    Command.REGISTER_SESSION: "RegisterSession",
    Command.UNREGISTER_SESSION: "UnRegisterSession",
    Command.SEND_RR_DATA: "SendRRData",
    Command.SEND_UNIT_DATA: "SendUnitData",
    Command.INDICATE_STATUS: "IndicateStatus",
    Command.CANCEL: "Cancel",
}
_LISTS: Final = frozenset({Command.LIST_SERVICES, Command.LIST_IDENTITY, Command.LIST_INTERFACES})
#: Shown devices and services of one answer.
_MOST: Final = 8


def encapsulated(packet: Packet, shared: Shared) -> Iterator[Description]:
    """One frame from or to port 44818; raises :class:`DecodeError`."""
    ip = parse_ipv4(packet.payload)
    if ip.protocol == PROTOCOL_UDP:
        datagram = parse_udp(ip.payload)
        ports = (datagram.source_port, datagram.destination_port)
        pdu = parse_encapsulation(datagram.data)
        yield from _pdu(pdu, _route(packet, ip, ports, asks=pdu.command in _LISTS and not pdu.data), shared)
    elif ip.protocol == PROTOCOL_TCP:
        yield from _segment(packet, ip, parse_tcp(ip.payload), shared)


def _route(packet: Packet, ip: Ipv4Packet, ports: tuple[int, int], *, asks: bool = True) -> Route:
    to_device = ports[1] == ENIP_PORT and (ports[0] != ENIP_PORT or asks)
    ends = (ip.source, ports[0]), (ip.destination, ports[1])
    return Route(*ends, packet.source, packet.destination, to_device, packet.time_ns)


def _segment(packet: Packet, ip: Ipv4Packet, segment: TcpSegment, shared: Shared) -> Iterator[Description]:
    ports = (segment.source_port, segment.destination_port)
    route = _route(packet, ip, ports)
    back = Route(
        route.destination, route.source, packet.destination, packet.source, not route.to_device, packet.time_ns
    )
    streams = shared.streams
    if segment.opens:
        # the former user of these ports waits no more
        shared.missed(route.pair, keep=0)
        kind = "accepted" if segment.acknowledges else "asked for"
        yield Description("TCP connection", f"{kind}, port {ports[0]} -> {ports[1]}", family="enip")
    repeated = streams.repeated
    for octets, missing in streams.acknowledged(route.source, route.destination, segment):
        for one in _message(octets, back, shared, missing=missing):
            yield replace(one, ends=(back.source_mac, back.destination_mac))
    for octets, missing in streams.take(route.source, route.destination, segment):
        yield from _message(octets, route, shared, missing=missing)
    if streams.repeated > repeated:
        text = f"{len(segment.data)} octets"
        yield Description("sent again", text, {"octets": len(segment.data)}, {"repeated": ""}, family="enip")
    if segment.resets:
        yield Description("TCP connection", "reset", family="enip")
    elif segment.ends:
        yield Description("TCP connection", "ends", family="enip")


def _message(octets: bytes, route: Route, shared: Shared, *, missing: bool) -> Iterator[Description]:
    """One message of a stream; one that is malformed does not hide those after it."""
    if missing:
        if not route.to_device:
            shared.missed(route.pair, keep=1)
        yield Description("octets missing", "in front of this message, in the capture", family="enip")
    try:
        yield from _pdu(parse_encapsulation(octets), route, shared)
    except DecodeError as exc:
        details, counts = {"reason": exc.reason}, {"malformed": exc.reason}
        yield Description("malformed", str(exc), details, counts, family="enip")


def _pdu(pdu: EncapsulationPdu, route: Route, shared: Shared) -> Iterator[Description]:
    command = Command(pdu.command) if pdu.command in _NAMES else None
    name = _NAMES[command] if command is not None else f"command 0x{pdu.command:04X}"
    what = f"{name}.{'req' if route.to_device else 'res'}"
    if pdu.status != EncapsulationStatus.SUCCESS:
        text = _status(pdu.status)
        yield Description(what, text, {"encapsulation_status": pdu.status}, {"errors": text}, family="enip")
        return
    match command:
        case Command.SEND_RR_DATA | Command.SEND_UNIT_DATA:
            items = CommonPacket.parse(pdu.data).items
            yield from _carried(what, pdu, items, route, shared)
        case Command.REGISTER_SESSION:
            registered = RegisterSession.parse(pdu.data)
            text = f"version {registered.version}"
            text += f", options 0x{registered.options:04X}" if registered.options else ""
            text = text if route.to_device else f"OK, session 0x{pdu.session:08X}, {text}"
            yield Description(what, text, {"session": pdu.session}, family="enip")
        case Command.UNREGISTER_SESSION:
            text = f"session 0x{pdu.session:08X}"
            yield Description(what, text, {"session": pdu.session}, family="enip")
        case Command.LIST_IDENTITY | Command.LIST_SERVICES | Command.LIST_INTERFACES if not route.to_device:
            yield from _listed(what, pdu, route, shared)
        case Command.LIST_IDENTITY:
            delay = int.from_bytes(pdu.context[:2], "little")
            text = f"answers within {delay} ms" if pdu.context != NO_CONTEXT and delay else ""
            yield Description(what, text, family="enip")
        case _:
            text = octets_text(pdu.data) if pdu.data else ""
            yield Description(what if command is not Command.NOP else "NOP", text, family="enip")


def _status(status: int) -> str:
    return f"{words_of(EncapsulationStatus, status, 'status')} (0x{status:04X})"


def _listed(what: str, pdu: EncapsulationPdu, route: Route, shared: Shared) -> Iterator[Description]:
    items = parse_items(pdu.data) if pdu.data else ()
    identities = [item for item in items if isinstance(item, IdentityItem)]
    services = [item for item in items if isinstance(item, ServiceItem)]
    for one in identities[:_MOST]:
        learn_identity(shared.stations, route.source_mac, one.vendor_id, one.device_type, one.product_code)
        if shared.observed is not None and not route.to_device:
            shared.observed.identified(route.device, route.source_mac, one)
        name = one.name.decode("latin-1")
        text = (
            f"{name!r} at {one.address}, vendor {one.vendor_id} type {one.device_type} product {one.product_code} "
            f"revision {one.revision[0]}.{one.revision[1]} status 0x{one.status:04X} serial 0x{one.serial:08X} "
            f"state {one.state}"
        )
        details = {
            "vendor_id": one.vendor_id,
            "device_type": one.device_type,
            "product_code": one.product_code,
            "revision": list(one.revision),
            "serial": one.serial,
            "name": name,
            "ip": str(one.address),
        }
        yield Description(what, text, details, family="enip")
    for service in services[:_MOST]:
        name = service.name.rstrip(b"\0").decode("latin-1")
        text = f"{name!r} version {service.version}, capabilities 0x{service.capabilities:04X}"
        yield Description(what, text, {"capabilities": service.capabilities}, family="enip")
    if not identities and not services:
        yield Description(what, f"{len(items)} items", family="enip")


def _carried(
    what: str, pdu: EncapsulationPdu, items: tuple[Item, ...], route: Route, shared: Shared
) -> Iterator[Description]:
    """A CIP message in the items of SendRRData or SendUnitData."""
    for item in items:
        if isinstance(item, UnconnectedData):
            yield from message(item.data, (route.pair, pdu.session, pdu.context), route, items, shared)
            return
        if isinstance(item, ConnectedData):
            r = Reader(item.data, little=True)
            sequence = r.bytes(2)
            address = next((one.connection_id for one in items if isinstance(one, ConnectedAddress)), None)
            if not r.remaining:
                text = f"connection 0x{address or 0:08X}, count {int.from_bytes(sequence, 'little')}, no message"
                yield Description(what, text, family="enip")
                return
            yield from message(r.rest(), (route.pair, pdu.session, sequence), route, items, shared)
            return
    yield Description(what, f"{len(items)} items, none of them a message", family="enip")
