"""LLDP as text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.captures.packet import Description
from pnfarm.protocols.profinet.wire.lldp.pdu import parse_lldp, peer_names
from pnfarm.protocols.profinet.wire.lldp.tlvs import ChassisMac

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.profinet.decode.shared import Shared
    from pnfarm.captures.packet import Packet

__all__ = ["lldp"]


def lldp(packet: Packet, shared: Shared) -> Iterator[Description]:
    """An announcement of a neighbour."""
    pdu = parse_lldp(packet.payload)
    port, station = peer_names(pdu.chassis, pdu.port)
    shared.stations.guess(packet.source, station)
    if shared.observed is not None and pdu.time_to_live:
        own = next((tlv.mac for tlv in pdu.tlvs if isinstance(tlv, ChassisMac)), packet.source)
        shared.observed.announced(own, station, port)
    if not pdu.time_to_live:
        yield Description("LLDP", f"{port} of {station} shuts down")
        return
    yield Description("LLDP", f"{port} of {station}, valid for {pdu.time_to_live} s")
