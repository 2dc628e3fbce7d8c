"""EtherNet/IP's part of the capture decoder: the table of its families, and the layouts from a farm file.

A family is one function ``(packet, shared) -> descriptions``.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from pnfarm.buses.decoding.decoder import FamilyDecoder
from pnfarm.buses.ethernetip.decode.channels import Template
from pnfarm.buses.ethernetip.decode.cyclic import cyclic
from pnfarm.buses.ethernetip.decode.enip import encapsulated
from pnfarm.buses.ethernetip.decode.shared import Shared
from pnfarm.protocols.enip.wire.encapsulation import ENIP_PORT, IO_PORT, Command
from pnfarm.wire.ethernet import ETHERTYPE_IPV4
from pnfarm.wire.ipv4 import PROTOCOL_UDP
from pnfarm.wire.tcp import PROTOCOL_TCP

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from pnfarm.buses.ethernetip.controller.device_plan import DevicePlan
    from pnfarm.captures.decoder import PlannedDrive
    from pnfarm.captures.packet import Capture, Description, Packet

__all__ = ["FAMILIES", "EthernetIpDecoder", "family_of"]

#: Family of frames -> its describing function.
FAMILIES: Mapping[str, Callable[[Packet, Shared], Iterator[Description]]] = MappingProxyType(
    {"cyclic": cyclic, "enip": encapsulated, "cip": encapsulated}
)
_IPV4_HEADER, _IPV4_PROTOCOL, _UDP_HEADER, _TCP_OFFSET = 20, 9, 8, 12
#: Commands that carry CIP.
_CARRIERS: Final = frozenset(
    command.to_bytes(2, "little") for command in (Command.SEND_RR_DATA, Command.SEND_UNIT_DATA)
)


def family_of(ethertype: int, payload: bytes) -> str | None:
    """The family of a frame by its ports and the command that it begins with; None for frames of others."""
    if ethertype != ETHERTYPE_IPV4 or len(payload) < _IPV4_HEADER:
        return None
    protocol = payload[_IPV4_PROTOCOL]
    if protocol not in {PROTOCOL_TCP, PROTOCOL_UDP}:
        return None
    at = (payload[0] & 0x0F) * 4
    ports = {int.from_bytes(payload[place : place + 2], "big") for place in (at, at + 2)}
    if protocol == PROTOCOL_UDP:
        if IO_PORT in ports and ENIP_PORT not in ports:
            return "cyclic"
        at += _UDP_HEADER
    elif at + _TCP_OFFSET < len(payload):
        at += (payload[at + _TCP_OFFSET] >> 4) * 4
    if ENIP_PORT not in ports:
        return None
    return "cip" if payload[at : at + 2] in _CARRIERS else "enip"


class EthernetIpDecoder(FamilyDecoder[Shared]):
    """See :class:`~pnfarm.captures.decoder.FrameDecoder`."""

    families = FAMILIES

    def __init__(self, capture: Capture) -> None:
        super().__init__(Shared(capture))

    def family_of(self, packet: Packet) -> str | None:
        return family_of(packet.ethertype, packet.payload)

    def expect(self, controller: str, mac: bytes, drives: Sequence[PlannedDrive]) -> None:  # noqa: ARG002 - the protocol's shape
        """``plan`` of each drive is a :class:`~pnfarm.buses.ethernetip.controller.device_plan.DevicePlan`."""
        for drive in drives:
            plan: DevicePlan = drive.plan
            connection = plan.connection
            timeout_ns = plan.rpi_ns * plan.timeout_multiplier
            for from_device, octets, header in (
                (False, connection.output_octets, connection.runs),
                (True, connection.input_octets, connection.input_header),
            ):
                self.shared.templates[drive.mac, from_device] = Template(
                    from_device, octets, header, plan.rpi_ns, timeout_ns, None, drive.model
                )
