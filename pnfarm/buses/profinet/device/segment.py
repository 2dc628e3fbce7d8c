"""The drives of a farm on one PROFINET segment: group-addressed frames are parsed once, for the drives they concern.

A wire delivers each group-addressed frame to every drive: finding a thousand drives by name takes a million copies.
So an Identify is parsed once for all of them, an ARP for another station or a Hello is dropped early, and drives
that share a cable receive the same LLDP frame, which mostly repeats the last one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.dcp_device import identify_matches
from pnfarm.protocols.profinet.wire.dcp import DcpPdu, parse_dcp
from pnfarm.protocols.profinet.wire.dcp_blocks import NameBlock
from pnfarm.protocols.profinet.wire.lldp import parse_lldp
from pnfarm.wire.ethernet import ETHERTYPE_LLDP

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.protocols.profinet.wire.lldp import Lldpdu

__all__ = ["ProfinetSegment"]

#: Ethertypes of ARP and of LLDP as in a frame; ethertype and frame id of DCP's Identify request and of its Hello.
ARP = bytes.fromhex("0806")
LLDP = ETHERTYPE_LLDP.to_bytes(2, "big")
DCP_IDENTIFY = bytes.fromhex("8892fefe")
DCP_HELLO = bytes.fromhex("8892fefc")


class ProfinetSegment:
    """See the module's docstring; :class:`pnfarm.buses.bus.Segment` defines the interface."""

    def __init__(self, stations: Sequence[ProfinetDevice]) -> None:
        self._by_port = {station.port.index: station for station in stations}
        #: The last Identify, its PDU, and the name if that is its only filter.
        self._identify: tuple[bytes, DcpPdu | None, str | None] = (b"", None, None)
        #: The last LLDP frame and its PDU, or its decode error.
        self._lldp: tuple[bytes, Lldpdu | str] = (b"", "short")
        #: Ports by their station's address as in an ARP packet, and the address that each is listed under.
        self._by_ip: dict[bytes, list[int]] = {}
        self._listed = dict.fromkeys(self._by_port, b"")
        for port in self._by_port:
            self.settled(port)

    def admits(self, port: int, frame: bytes, now: int) -> bool:
        """See :class:`pnfarm.buses.bus.Segment`; LLDP frames are handled here."""
        station = self._by_port[port]
        if frame[12:14] == LLDP:
            if frame is not self._lldp[0] and frame != self._lldp[0]:
                self._lldp = (frame, _read_lldp(frame))
            return station.hear_neighbour(frame, self._lldp[1], now)
        if frame and frame[0] & 1 and not self._concerns(station, frame):
            return False
        return station.budget.passes(frame, now) or station.passed_over("connect-flood")

    def _concerns(self, station: ProfinetDevice, frame: bytes) -> bool:
        """Whether a group-addressed frame can concern this station."""
        if frame[12:14] == ARP:
            own = station.own_ip
            if own and own in {frame[28:32], frame[38:42]}:
                return True
            return station.passed_over("arp-for-another")
        if frame[12:16] == DCP_HELLO:
            return station.passed_over("hello")
        if frame[12:16] == DCP_IDENTIFY:
            if frame != self._identify[0]:
                self._identify = (frame, *_read_identify(frame))
            _, pdu, name = self._identify
            if pdu is not None and (
                station.dcp.name != name if name is not None else not identify_matches(pdu, station.dcp)
            ):
                return station.passed_over("identify-for-another")
        return True

    def audience(self, frame: bytes) -> list[int] | None:
        """See :class:`pnfarm.buses.bus.Segment`."""
        if frame[12:16] == DCP_HELLO:
            return []
        if frame[12:14] != ARP or len(frame) < 42:
            return None
        sender, target = frame[28:32], frame[38:42]
        found = self._by_ip.get(target, [])
        if sender != target:
            found = found + self._by_ip.get(sender, [])
        return list(found)

    def settled(self, port: int) -> None:
        """See :class:`pnfarm.buses.bus.Segment`."""
        before, own = self._listed[port], self._by_port[port].own_ip
        if own == before:
            return
        if before:
            self._by_ip[before].remove(port)
        if own:
            self._by_ip.setdefault(own, []).append(port)
        self._listed[port] = own


def _read_identify(frame: bytes) -> tuple[DcpPdu | None, str | None]:
    """The PDU of an Identify request, or None; and the name, if that is its only filter."""
    try:
        pdu = parse_dcp(frame[14:])
    except DecodeError:
        return None, None
    if len(pdu.blocks) == 1 and isinstance(pdu.blocks[0], NameBlock):
        return pdu, pdu.blocks[0].name
    return pdu, None


def _read_lldp(frame: bytes) -> Lldpdu | str:
    try:
        return parse_lldp(frame[14:])
    except DecodeError as exc:
        return exc.reason
