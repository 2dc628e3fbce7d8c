"""The decoder of a capture: gives each frame to its bus, and makes lines of the descriptions.

The descriptions of a frame come from a generator, which may raise :class:`~pnfarm.errors.DecodeError`;
that becomes a line of its own.  The words for families are those of a capture's filter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from pnfarm.captures.conversations import Conversations
from pnfarm.captures.neutral import arp, icmp, other, unreadable
from pnfarm.captures.packet import SAME_NS, Capture, Description, Packet
from pnfarm.captures.stations import Bounded
from pnfarm.errors import DecodeError
from pnfarm.wire.ethernet import ETHERTYPE_ARP, ETHERTYPE_IPV4, ETHERTYPE_SERVICE_VLAN, ETHERTYPE_VLAN
from pnfarm.wire.ipv4 import PROTOCOL_ICMP, emit_ipv4, parse_ipv4

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from pnfarm.captures.conversations import CyclicChannel
    from pnfarm.captures.reading import CapturedFrame
    from pnfarm.drives.description.model import Model

__all__ = ["Decoder", "FrameDecoder", "Line", "LineDecoder", "PlannedDrive", "family_of"]

#: Families of frames without a bus -> the function that describes them.
_NEUTRAL: Mapping[str, Callable[[Packet], Iterator[Description]]] = MappingProxyType(
    {"arp": arp, "icmp": icmp, "other": other}
)
_HEADER, _TAG = 14, 4
_TAGS = frozenset({ETHERTYPE_VLAN, ETHERTYPE_SERVICE_VLAN})
#: Length of an IPv4 header in octets, and offset of its protocol.
_IPV4_HEADER, _IPV4_PROTOCOL = 20, 9
_OUTBOUND = 2


@dataclass(frozen=True, slots=True)
class PlannedDrive:
    """A drive or device of a farm file: its address, and how the bus's controller is to connect it (a plan of the bus's
    own).  A device has no model."""

    mac: bytes
    model: Model | None
    plan: Any


class FrameDecoder(Protocol):
    """Decodes the frames of one bus in a capture."""

    def family_of(self, packet: Packet) -> str | None:
        """The family of a frame, one of the bus's or ``other``; None for a frame of another bus."""

    def describe(self, family: str, packet: Packet) -> Iterator[Description]:
        """The descriptions of a frame; may raise :class:`~pnfarm.errors.DecodeError`."""

    def cyclic_channels(self) -> Iterable[CyclicChannel]:
        """Channels with frames so far, for the summary."""

    def expect(self, controller: str, mac: bytes, drives: Sequence[PlannedDrive]) -> None:
        """Connections that a farm file's controller makes, where the capture does not show how they were made."""


@runtime_checkable
class LineDecoder(FrameDecoder, Protocol):
    """A bus's decoder whose telegrams are on a line, with a link type of their own."""

    @property
    def link_type(self) -> int:
        """LINKTYPE of its telegrams, as :attr:`pnfarm.buses.bus.LineBus.link_type` has it."""

    def packet(self, frame: CapturedFrame) -> Packet:
        """A telegram with its stations; the decoder then gets it as it gets frames.

        Addresses are octets of any number but six, which is Ethernet's.  Raises nothing: octets that are no telegram
        have empty addresses.
        """

    def learn(self, station: Any, model: Model | None) -> None:
        """A drive or device of a farm file, by the configuration that its bus makes of it."""

    def learn_controller(self, section: Any) -> None:
        """A farm file's controller on this bus, by its section."""


@dataclass(frozen=True, slots=True)
class Line:
    """One line of output; ``source`` and ``destination`` are addresses, which the decoder names."""

    number: int
    time_ns: int
    source: bytes
    destination: bytes
    family: str
    description: Description


def family_of(packet: Packet) -> str:
    """The family of a frame that no bus claims."""
    payload = packet.payload
    if packet.ethertype == ETHERTYPE_IPV4 and len(payload) >= _IPV4_HEADER:
        return "icmp" if payload[_IPV4_PROTOCOL] == PROTOCOL_ICMP else "other"
    return "arp" if packet.ethertype == ETHERTYPE_ARP else "other"


class Decoder:
    """Give it the frames of a capture one after the other; its memory is bounded.

    ``buses`` are asked for each frame in their order; a frame that none of them knows is described without one.
    """

    def __init__(self, capture: Capture, buses: Mapping[str, FrameDecoder]) -> None:
        self.capture = capture
        self.buses = buses
        self._line_decoders = {one.link_type: one for one in buses.values() if isinstance(one, LineDecoder)}
        self._conversations = Conversations()
        self._groups: Bounded[bytes, int] = Bounded(256)
        #: The last telegrams of lines and their times: the interface that had each first.
        self._telegrams: Bounded[tuple[bytes, int], str | None] = Bounded(256)
        #: Frames too short to have an EtherType.
        self.short = 0

    @property
    def link_types(self) -> frozenset[int]:
        """Link types besides Ethernet's that some bus decodes."""
        return frozenset(self._line_decoders)

    def ends(self, frame: CapturedFrame) -> tuple[bytes, bytes]:
        """Destination and source of a frame, empty where it has none."""
        if (own := self._line_decoders.get(frame.link_type)) is not None:
            packet = own.packet(frame)
            return packet.destination, packet.source
        return frame.data[:6], frame.data[6:12]

    def feed(self, frame: CapturedFrame) -> list[Line]:
        """The lines of this frame: often none.  A copy of a broadcast, at another interface, is left out."""
        if (own := self._line_decoders.get(frame.link_type)) is not None:
            return [] if self._copied(frame) else self._lines_of(frame, own.packet(frame), own)
        data = frame.data
        if len(data) < _HEADER:
            self.short += 1
            return []
        ethertype = data[12] << 8 | data[13]
        start = _HEADER
        while ethertype in _TAGS and len(data) >= start + _TAG:
            # the identifier 0 is a priority alone
            if vid := (data[start] << 8 | data[start + 1]) & 0x0FFF:
                self.capture.stations.learn(data[6:12], vlan=vid)
            ethertype = data[start + 2] << 8 | data[start + 3]
            start += _TAG
        if data[0] & 1 and self._again(frame):
            return []
        packet = Packet(frame.time_ns, data[:6], data[6:12], ethertype, data[start:], frame.cut)
        if frame.direction is not None and frame.interface:
            drive = packet.source if frame.direction == _OUTBOUND else packet.destination
            self.capture.stations.guess(drive, frame.interface)
        return self._lines_of(frame, packet)

    def _lines_of(self, frame: CapturedFrame, packet: Packet, own: FrameDecoder | None = None) -> list[Line]:
        """The lines of a packet; ``own``: the decoder of its link type."""
        family = None if own is None else own.family_of(packet)
        if own is not None and family is not None:
            descriptions = own.describe(family, packet)
        else:
            family, descriptions = self._described(packet)
        talk = self._conversations.between(packet.source, packet.destination)
        talk.add(frame.time_ns, family)
        lines = []
        try:
            for description in descriptions:
                source, destination = description.ends or (packet.source, packet.destination)
                if description.counts:
                    self._conversations.between(source, destination).count(description.counts)
                if not description.what:
                    continue
                named = description.family or family
                lines.append(Line(frame.number, frame.time_ns, source, destination, named, description))
        except DecodeError as exc:
            if frame.cut:
                description = Description("cut off", f"{frame.cut} octets of the frame are not in the capture")
            else:
                description = unreadable(exc)
                talk.count(description.counts)
            lines.append(Line(frame.number, frame.time_ns, packet.source, packet.destination, family, description))
        return lines

    def _described(self, packet: Packet) -> tuple[str, Iterator[Description]]:
        """The family of a frame, and its descriptions; fragments of an IP packet are described as the whole one."""
        payload = packet.payload
        if packet.ethertype == ETHERTYPE_IPV4 and len(payload) >= _IPV4_HEADER and (payload[6] & 0x3F or payload[7]):
            try:
                whole = self.capture.joined(parse_ipv4(payload), packet.time_ns)
            except DecodeError:
                return "other", other(packet)
            if whole is None:
                return "other", iter(())
            packet = replace(packet, payload=emit_ipv4(whole))
        for bus in self.buses.values():
            if (family := bus.family_of(packet)) is not None:
                return family, bus.describe(family, packet)
        family = family_of(packet)
        return family, _NEUTRAL[family](packet)

    def summary(self) -> list[dict[str, Any]]:
        """The conversation of each pair of stations, plain JSON values, the longest first."""
        channels = [channel for bus in self.buses.values() for channel in bus.cyclic_channels()]
        return self._conversations.as_list(self.capture.stations, channels)

    def _copied(self, frame: CapturedFrame) -> bool:
        """Whether a telegram was seen at another interface at the same moment: each station of a line hears it."""
        this = frame.data, frame.time_ns
        first = self._telegrams.get(this, frame.interface)
        self._telegrams[this] = first
        return first != frame.interface

    def _again(self, frame: CapturedFrame) -> bool:
        """Whether a multicast was seen a moment ago: a capture of many drives has a copy for each."""
        before = self._groups.get(frame.data)
        self._groups[frame.data] = frame.time_ns
        return before is not None and abs(frame.time_ns - before) < SAME_NS

    def name(self, mac: bytes) -> str:
        """A station's name as far as it is known now."""
        return self.capture.stations.name(mac)

    def as_dict(self, line: Line) -> dict[str, Any]:
        """A line for JSON."""
        return {
            "frame": line.number,
            "time": line.time_ns / 1e9,
            "from": self.name(line.source),
            "to": self.name(line.destination),
            "family": line.family,
            "what": line.description.what,
            "text": line.description.text,
            **line.description.details,
        }
