"""PTCP as text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.captures.packet import Description
from pnfarm.protocols.profinet.wire.ptcp import PTCP_NAMES, parse_ptcp

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.profinet.decode.shared import Shared
    from pnfarm.captures.packet import Packet

__all__ = ["ptcp"]


def ptcp(packet: Packet, shared: Shared) -> Iterator[Description]:
    """Neighbours measure the cable delay several times a second: the first of each kind and a new master count.

    Every frame gets a line if every frame is requested.
    """
    pdu = parse_ptcp(packet.payload)
    key = packet.source, pdu.frame_id
    clock = pdu.master, pdu.subdomain
    known = shared.clocks.get(key)
    shared.clocks[key] = clock
    if known == clock and not shared.capture.every_frame:
        return
    texts = [f"sequence {pdu.sequence}"]
    if pdu.port_mac is not None:
        texts.append(f"port {pdu.port_mac.hex(':')}")
    if pdu.delay_ns:
        texts.append(f"delay {pdu.delay_ns} ns")
    if pdu.master is not None:
        texts.append(f"master {shared.stations.name(pdu.master)}, domain {pdu.subdomain}")
    if known is None and not shared.capture.every_frame:
        texts.append("further ones are only counted")
    yield Description("PTCP", f"{PTCP_NAMES[pdu.frame_id]}, {', '.join(texts)}", {"sequence": pdu.sequence})
