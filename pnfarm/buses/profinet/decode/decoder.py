"""The decoder: each frame to its family, each family's words to lines.

:data:`FAMILIES` is the table.  A family is one function ``(packet, shared) -> what is worth a line``; it may raise
:class:`~pnfarm.errors.DecodeError`, which becomes a line of its own.  The words are those of a capture's filter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.decode import small
from pnfarm.buses.profinet.decode.calls import is_call, rpc
from pnfarm.buses.profinet.decode.conversations import Conversations
from pnfarm.buses.profinet.decode.cyclic import cyclic
from pnfarm.buses.profinet.decode.dcp import dcp
from pnfarm.buses.profinet.decode.packet import Packet, Said, Shared
from pnfarm.buses.profinet.decode.stations import Bounded
from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH, ALARM_LOW, DCP_HELLO, DCP_IDENTIFY_RESPONSE
from pnfarm.protocols.profinet.wire.ptcp import PTCP_NAMES
from pnfarm.wire.ethernet import (
    ETHERTYPE_ARP,
    ETHERTYPE_IPV4,
    ETHERTYPE_LLDP,
    ETHERTYPE_PROFINET,
    ETHERTYPE_VLAN,
)
from pnfarm.wire.ipv4 import PROTOCOL_ICMP, PROTOCOL_UDP
from pnfarm.wire.rtc import FIRST_ACYCLIC_FRAME_ID, FIRST_CYCLIC_FRAME_ID

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.profinet.decode.reading import CapturedFrame

__all__ = ["FAMILIES", "Decoder", "Line", "family_of"]

Family = Callable[[Packet, Shared], Iterator[Said]]

#: Kind of frame -> who puts it into words.
FAMILIES: Mapping[str, Family] = MappingProxyType(
    {
        "cyclic": cyclic,
        "dcp": dcp,
        "alarm": small.alarm,
        "rpc": rpc,
        "snmp": small.snmp,
        "arp": small.arp,
        "icmp": small.icmp,
        "lldp": small.lldp,
        "ptcp": small.ptcp,
        "other": small.other,
    }
)
_SNMP_PORTS = frozenset({161, 162})
#: Fragment offset of an IP packet, and whether more follow; octets of a datagram's head.
_OFFSET, _MORE, _UDP_HEAD = 0x1FFF, 0x2000, 8
_HEADER, _TAG = 14, 4
_OUTBOUND = 2
#: Copies of one frame at several interfaces lie closer together than this.
_SAME_NS = 20_000_000


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a capture's story; ``source`` and ``destination`` are addresses, names are the decoder's."""

    number: int
    time_ns: int
    source: bytes
    destination: bytes
    family: str
    said: Said


def family_of(ethertype: int, payload: bytes) -> str:
    """The kind of a frame by its EtherType and what follows it."""
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
    if ethertype == ETHERTYPE_IPV4 and len(payload) >= 20:
        if payload[9] == PROTOCOL_ICMP:
            return "icmp"
        if payload[9] != PROTOCOL_UDP:
            return "other"
        fragment = payload[6] << 8 | payload[7]
        if fragment & _OFFSET:
            return "rpc"  # only calls are longer than a frame; the whole datagram tells if it is none
        at = (payload[0] & 0x0F) * 4
        source, destination = (int.from_bytes(payload[place : place + 2], "big") for place in (at, at + 2))
        if {source, destination} & _SNMP_PORTS:
            return "snmp"
        return "rpc" if fragment & _MORE or is_call(source, destination, payload[at + _UDP_HEAD :]) else "other"
    return {ETHERTYPE_ARP: "arp", ETHERTYPE_LLDP: "lldp"}.get(ethertype, "other")


class Decoder:
    """Give it the frames of a capture one after the other; it holds a bounded part of what it saw.

    ``gap_cycles``: a silence longer than so many cycles is told.  ``every_frame``: cyclic frames each get a line.
    """

    def __init__(self, *, gap_cycles: float = 3.0, every_frame: bool = False) -> None:
        self.shared = Shared(gap_cycles=gap_cycles, every_frame=every_frame)
        self.conversations = Conversations()
        self._groups: Bounded[bytes, int] = Bounded(256)
        #: Frames too short to have an EtherType.
        self.short = 0

    def feed(self, frame: CapturedFrame) -> list[Line]:
        """What this frame is worth: often nothing.  A copy of a broadcast, at another interface, is left out."""
        data = frame.data
        if len(data) < _HEADER:
            self.short += 1
            return []
        ethertype = data[12] << 8 | data[13]
        start = _HEADER
        while ethertype == ETHERTYPE_VLAN and len(data) >= start + _TAG:
            ethertype = data[start + 2] << 8 | data[start + 3]
            start += _TAG
        if data[0] & 1 and self._again(frame):
            return []
        packet = Packet(frame.time_ns, data[:6], data[6:12], ethertype, data[start:])
        if frame.direction is not None and frame.interface:
            drive = packet.source if frame.direction == _OUTBOUND else packet.destination
            self.shared.stations.guess(drive, frame.interface)
        family = family_of(ethertype, packet.payload)
        talk = self.conversations.between(packet.source, packet.destination)
        talk.add(frame.time_ns, family)
        lines = []
        try:
            for said in FAMILIES[family](packet, self.shared):
                if said.counts:
                    talk.count(said.counts)
                told = said.family or family
                lines.append(Line(frame.number, frame.time_ns, packet.source, packet.destination, told, said))
        except DecodeError as exc:
            if frame.cut:
                said = Said("cut off", f"{frame.cut} octets of the frame are not in the capture")
            else:
                said = small.unreadable(exc)
                talk.count(said.counts)
            lines.append(Line(frame.number, frame.time_ns, packet.source, packet.destination, family, said))
        return lines

    def _again(self, frame: CapturedFrame) -> bool:
        """Whether a group-addressed frame was seen a moment ago: a capture of many drives has it once for each."""
        before = self._groups.get(frame.data)
        self._groups[frame.data] = frame.time_ns
        return before is not None and abs(frame.time_ns - before) < _SAME_NS

    def name(self, mac: bytes) -> str:
        """A station's name as far as it is known now."""
        return self.shared.stations.name(mac)

    def as_dict(self, line: Line) -> dict[str, Any]:
        """A line for JSON."""
        return {
            "frame": line.number,
            "time": line.time_ns / 1e9,
            "from": self.name(line.source),
            "to": self.name(line.destination),
            "family": line.family,
            "what": line.said.what,
            "text": line.said.text,
            **line.said.details,
        }
