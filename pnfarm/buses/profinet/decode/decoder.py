"""PROFINET's part of the capture decoder: the table of its families, and the layouts from a farm file.

A family is one function ``(packet, shared) -> descriptions``.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from pnfarm.buses.decoding.decoder import FamilyDecoder
from pnfarm.buses.profinet.decode.alarm import alarm
from pnfarm.buses.profinet.decode.calls import is_call, rpc
from pnfarm.buses.profinet.decode.channels import make_template, telegrams_of
from pnfarm.buses.profinet.decode.cyclic import cyclic
from pnfarm.buses.profinet.decode.dcp import dcp
from pnfarm.buses.profinet.decode.lldp import lldp
from pnfarm.buses.profinet.decode.ptcp import ptcp
from pnfarm.buses.profinet.decode.shared import Shared
from pnfarm.buses.profinet.decode.snmp import snmp
from pnfarm.captures.packet import Capture, Description, Packet
from pnfarm.protocols.profinet.cm.controller.frames import plan_frames
from pnfarm.protocols.profinet.wire.frame_id import (
    ALARM_HIGH,
    ALARM_LOW,
    DCP_HELLO,
    DCP_IDENTIFY_RESPONSE,
    classify_frame_id,
)
from pnfarm.protocols.profinet.wire.ptcp import PTCP_NAMES
from pnfarm.protocols.profinet.wire.rpc.pdu import NIL_UUID
from pnfarm.wire.ethernet import ETHERTYPE_IPV4, ETHERTYPE_LLDP, ETHERTYPE_PROFINET
from pnfarm.wire.ipv4 import PROTOCOL_UDP
from pnfarm.wire.rtc import FIRST_ACYCLIC_FRAME_ID, FIRST_CYCLIC_FRAME_ID

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from pnfarm.buses.profinet.controller.device_plan import DevicePlan
    from pnfarm.captures.decoder import PlannedDrive

__all__ = ["FAMILIES", "ProfinetDecoder", "family_of"]


def _unknown(packet: Packet, _: Shared) -> Iterator[Description]:
    """A frame id of no known family."""
    frame_id = int.from_bytes(packet.payload[:2], "big")
    yield Description(f"frame id 0x{frame_id:04X}", classify_frame_id(frame_id).value)


#: Family of frames -> its describing function.
FAMILIES: Mapping[str, Callable[[Packet, Shared], Iterator[Description]]] = MappingProxyType(
    {
        "cyclic": cyclic,
        "dcp": dcp,
        "rpc": rpc,
        "alarm": alarm,
        "lldp": lldp,
        "ptcp": ptcp,
        "snmp": snmp,
        "other": _unknown,
    }
)
_SNMP_PORTS = frozenset({161, 162})
#: Octets of a datagram's header.
_UDP_HEAD = 8


def family_of(ethertype: int, payload: bytes) -> str | None:
    """The family of a frame by its EtherType and payload; None for frames that are not PROFINET's."""
    if ethertype == ETHERTYPE_PROFINET and len(payload) >= 2:
        frame_id = payload[0] << 8 | payload[1]
        if frame_id in PTCP_NAMES:
            return "ptcp"
        if frame_id < FIRST_CYCLIC_FRAME_ID:
            return "other"
        if frame_id < FIRST_ACYCLIC_FRAME_ID:
            return "cyclic"
        if DCP_HELLO <= frame_id <= DCP_IDENTIFY_RESPONSE:
            return "dcp"
        return "alarm" if frame_id in {ALARM_HIGH, ALARM_LOW} else "other"
    if ethertype == ETHERTYPE_IPV4 and len(payload) >= 20 and payload[9] == PROTOCOL_UDP:
        at = (payload[0] & 0x0F) * 4
        source, destination = (int.from_bytes(payload[place : place + 2], "big") for place in (at, at + 2))
        if {source, destination} & _SNMP_PORTS:
            return "snmp"
        return "rpc" if is_call(source, destination, payload[at + _UDP_HEAD :]) else None
    return "lldp" if ethertype == ETHERTYPE_LLDP else None


class ProfinetDecoder(FamilyDecoder[Shared]):
    """See :class:`~pnfarm.captures.decoder.FrameDecoder`."""

    families = FAMILIES

    def __init__(self, capture: Capture) -> None:
        super().__init__(Shared(capture))

    def family_of(self, packet: Packet) -> str | None:
        return family_of(packet.ethertype, packet.payload)

    def expect(self, controller: str, mac: bytes, drives: Sequence[PlannedDrive]) -> None:
        """``plan`` of each drive is a :class:`~pnfarm.buses.profinet.controller.device_plan.DevicePlan`."""
        for drive in drives:
            plan: DevicePlan = drive.plan
            modules: dict[int, tuple[int, dict[int, int]]] = {}
            for one in plan.submodules:
                modules.setdefault(one.slot, (one.module_ident, {}))[1][one.subslot] = one.submodule_ident
            telegrams = telegrams_of(modules, drive.model)
            asked = plan.ar_plan(
                controller_name=controller,
                controller_mac=mac,
                controller_object_uuid=NIL_UUID,
                ar_uuid=NIL_UUID,
                session_key=0,
            )
            for layout in plan_frames(asked):
                self.shared.templates[drive.mac, layout.is_input] = make_template(layout, telegrams, drive.model)
