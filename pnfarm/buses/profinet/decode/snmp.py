"""SNMP as text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.captures.packet import Description
from pnfarm.protocols.profinet.wire.snmp.message import GET, GET_BULK, GET_NEXT, RESPONSE, SET, Pdu, parse_snmp
from pnfarm.wire.ipv4 import parse_ipv4
from pnfarm.wire.udp import parse_udp

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.profinet.decode.shared import Shared
    from pnfarm.captures.packet import Packet

__all__ = ["snmp"]

_SNMP_TEXTS = {GET: "Get", GET_NEXT: "GetNext", GET_BULK: "GetBulk", SET: "Set", RESPONSE: "Response"}


def snmp(packet: Packet, _: Shared) -> Iterator[Description]:
    """An SNMP message."""
    message = parse_snmp(parse_udp(parse_ipv4(packet.payload).payload).data)
    version = "v2c" if message.version else "v1"
    if not isinstance(message.pdu, Pdu):
        yield Description(f"SNMP {version}", f"message of type 0x{message.pdu.tag:02X}")
        return
    names = [".".join(map(str, varbind.name)) for varbind in message.pdu.varbinds]
    first = f" {names[0]}" if names else ""
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    yield Description(
        f"SNMP {version} {_SNMP_TEXTS.get(message.pdu.tag, hex(message.pdu.tag))}", f"{first}{more}".strip()
    )
