"""The drives of a farm on one PROFINET segment: group-addressed frames are parsed once, for the drives they concern.

A wire delivers each group-addressed frame to every drive: finding a thousand drives by name takes a million copies.
So drives that share a cable are found by what an Identify or an ARP asks for (:meth:`ProfinetSegment.audience`), and
the others never see it.  Where each has a cable of its own, an Identify is parsed once for all of them, an ARP for
another station or a Hello is dropped early (:meth:`ProfinetSegment.admits`); both ways count the same.  An LLDP frame
mostly repeats the last one, and is parsed once, too.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.dcp.device import identify_matches
from pnfarm.protocols.profinet.wire.dcp.blocks import AliasBlock, AllSelectorBlock, DeviceInstanceBlock, NameBlock
from pnfarm.protocols.profinet.wire.dcp.pdu import DcpPdu, parse_dcp
from pnfarm.protocols.profinet.wire.lldp.pdu import parse_lldp
from pnfarm.station.absent import Absent
from pnfarm.station.visits import Caller
from pnfarm.wire.ethernet import ETHERTYPE_LLDP

if TYPE_CHECKING:
    from collections.abc import Collection, Hashable, Mapping, Sequence

    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.protocols.profinet.wire.lldp.pdu import Lldpdu

__all__ = ["ProfinetSegment"]

#: Ethertypes of ARP and of LLDP as in a frame; ethertype and frame id of DCP's Identify request and of its Hello.
ARP = bytes.fromhex("0806")
LLDP = ETHERTYPE_LLDP.to_bytes(2, "big")
DCP_IDENTIFY = bytes.fromhex("8892fefe")
DCP_HELLO = bytes.fromhex("8892fefc")


class _Asked(NamedTuple):
    """What a station can be asked for by: address as in an ARP packet, name, aliases, instance."""

    ip: bytes = b""
    name: str = ""
    aliases: frozenset[str] = frozenset()
    instance: tuple[int, int] | None = None

    def wanted_by(self) -> list[Hashable]:
        """The keys of an index; an address is octets, a name a text, an alias a pair."""
        found: list[Hashable] = [("alias", alias) for alias in self.aliases]
        if self.ip:
            found.append(self.ip)
        if self.instance is not None:
            found += [self.instance, self.name]
        return found


class ProfinetSegment:
    """See the module's docstring; :class:`pnfarm.buses.bus.Segment` defines the interface."""

    def __init__(self, stations: Sequence[ProfinetDevice]) -> None:
        self._by_port = {station.port.index: station for station in stations}
        self.absent = Absent()
        #: The last Identify, its PDU, and the name if that is its only filter.
        self._identify: tuple[bytes, DcpPdu | None, str | None] = (b"", None, None)
        #: The last LLDP frame and its PDU, or its decode error.
        self._lldp: tuple[bytes, Lldpdu | str] = (b"", "short")
        #: Ports by what their stations can be asked for, and what each is listed under.
        self._index: defaultdict[Hashable, list[int]] = defaultdict(list)
        self._listed = dict.fromkeys(self._by_port, _Asked())
        #: Frames that were not handed to all, by reason, and those of them that a port got nevertheless.
        self._passed_over: Counter[str] = Counter()
        self._heard: dict[int, Counter[str]] = {}
        for port, station in self._by_port.items():
            station.unheard = partial(self._unheard, port)
            self.settled(port)

    def admits(self, port: int, frame: bytes, now: int) -> bool:
        """See :class:`pnfarm.buses.bus.Segment`; LLDP frames are handled here."""
        station = self._by_port[port]
        if frame[12:14] == LLDP:
            if frame is not self._lldp[0] and frame != self._lldp[0]:
                self._lldp = (frame, _read_lldp(frame))
            return station.hear_neighbour(frame, self._lldp[1], now)
        if frame and frame[0] & 1 and not self._concerns(station, frame, now):
            return False
        return station.budget.passes(frame, now) or station.passed_over("connect-flood")

    def _concerns(self, station: ProfinetDevice, frame: bytes, now: int) -> bool:
        """Whether a group-addressed frame can concern this station."""
        if frame[12:14] == ARP:
            own = station.own_ip
            if own and own in {frame[28:32], frame[38:42]}:
                return True
            return station.passed_over("arp-for-another")
        if frame[12:16] == DCP_HELLO:
            return station.passed_over("hello")
        if frame[12:16] == DCP_IDENTIFY:
            pdu, name = self._identify_of(frame), self._identify[2]
            self._look(frame, now)
            if pdu is not None and (
                station.dcp.name != name if name is not None else not identify_matches(pdu, station.dcp)
            ):
                return station.passed_over("identify-for-another")
        return True

    def _identify_of(self, frame: bytes) -> DcpPdu | None:
        """The PDU of an Identify request; all drives get the same one in turn."""
        if frame is not self._identify[0] and frame != self._identify[0]:
            self._identify = (frame, *_read_identify(frame))
        return self._identify[1]

    def audience(self, frame: bytes, now: int, besides: Collection[int] = ()) -> list[int] | None:
        found: list[int] = []
        if frame[12:16] == DCP_HELLO:
            reason = "hello"
        elif frame[12:14] == ARP and len(frame) >= 42:
            reason = "arp-for-another"
            found = sorted({port for ip in (frame[28:32], frame[38:42]) for port in self._index.get(ip, ())})
        elif frame[12:16] == DCP_IDENTIFY:
            pdu = self._identify_of(frame)
            if pdu is None or (pdu.blocks and all(isinstance(block, AllSelectorBlock) for block in pdu.blocks)):
                return None
            self._look(frame, now)
            reason, found = "identify-for-another", self._identified(pdu)
        else:
            return None
        self._passed_over[reason] += 1
        for port in {*found, *besides}:
            self._heard.setdefault(port, Counter())[reason] += 1
        return found

    def _look(self, frame: bytes, now: int) -> None:
        """A controller searches a name of station that no device has."""
        name = self._identify[2]
        if name and name not in self._index:
            self.absent.note(name, Caller(mac=frame[6:12]), now)

    def _identified(self, pdu: DcpPdu) -> list[int]:
        """Ports of the stations that an Identify request asks for."""
        candidates: Collection[int] = self._by_port
        for block in pdu.blocks:
            match block:
                case NameBlock(name=name):
                    listed = self._index.get(name, [])
                case AliasBlock(alias=alias):
                    listed = self._index.get(("alias", alias), [])
                case DeviceInstanceBlock(high=high, low=low):
                    listed = self._index.get((high, low), [])
                case _:
                    continue
            if len(listed) < len(candidates):
                candidates = listed
        return sorted(port for port in candidates if identify_matches(pdu, self._by_port[port].dcp))

    def _unheard(self, port: int) -> Mapping[str, int]:
        """Frames that the station at this port did not get because they were for others, by reason."""
        heard: Mapping[str, int] = self._heard.get(port, {})
        return {reason: count - heard.get(reason, 0) for reason, count in self._passed_over.items()}

    def settled(self, port: int) -> None:
        station, before = self._by_port[port], self._listed[port]
        dcp = station.dcp
        if (
            before.aliases is dcp.aliases
            and before.name == dcp.name
            and before.ip == station.own_ip
            and before.instance == dcp.identity.instance
        ):
            return
        now = self._listed[port] = _Asked(station.own_ip, dcp.name, dcp.aliases, dcp.identity.instance)
        for key in before.wanted_by():
            self._index[key].remove(port)
            if not self._index[key]:
                del self._index[key]
        for key in now.wanted_by():
            self._index[key].append(port)


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
