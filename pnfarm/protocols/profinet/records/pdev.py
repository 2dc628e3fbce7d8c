"""The physical device: the records of the interface and of its ports (IEC 61158-6-10, coding of the field Index).

Which records there are follows the DAP's submodules: subslots 0x8000, 0x8100 ... are interfaces, those after them
are their ports.  Real data are computed when they are read, from the interface's and the ports' facts and from
the neighbours that LLDP knows; what a controller writes is checked, kept, and read back octet for octet.

======  ==========================  =========  ====  =====  =================================================
index   record                      submodule  read  write  effect
======  ==========================  =========  ====  =====  =================================================
0x802A  PDPortDataReal              port       yes   no
0x802B  PDPortDataCheck             port       yes   yes    :meth:`PhysicalDevice.evaluate`
0x802F  PDPortDataAdjust            port       yes   yes    PeerToPeerBoundary bit 0 stops LLDP; nothing else
0x8051  PDInterfaceMrpDataCheck     interface  yes   yes    none
0x8052  PDInterfaceMrpDataAdjust    interface  yes   yes    none
0x8053  PDPortMrpDataAdjust         port       yes   yes    none
0x8070  PDNCDataCheck               interface  yes   yes    none
0x8071  PDInterfaceAdjust           interface  yes   yes    NameOfDevice: how LLDP names us
0x8072  PDPortStatistic             both       yes   no
0x8080  PDInterfaceDataReal         interface  yes   no
0x8090  PDInterfaceFSUDataAdjust    interface  yes   yes    none
0xB050  control of external PLL     interface  yes   yes    none (Siemens, see :mod:`directory`)
0xB060  trace unit                  port       yes   yes    none (Siemens)
0xF841  PDRealData                  device     yes   no
0xF842  PDExpectedData              device     yes   no
======  ==========================  =========  ====  =====  =================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.records.directory import Index
from pnfarm.protocols.profinet.records.pdev_checks import (
    ChannelErrorType,
    CheckFailed,
    CheckPassed,
    Finding,
    PortCounters,
    RemoteMismatch,
    compare,
    media_type_of,
)
from pnfarm.protocols.profinet.wire.block import VERSION_1_0, VERSION_1_1, split_blocks
from pnfarm.protocols.profinet.wire.lldp.pdu import NameMode
from pnfarm.protocols.profinet.wire.records.pdev import (
    InterfaceAdjust,
    InterfaceDataReal,
    MultipleBlock,
    PeerReal,
    PortDataAdjust,
    PortDataCheck,
    PortDataReal,
    PortStatistic,
)
from pnfarm.protocols.profinet.wire.records.pdev_port import (
    AdjustPeerToPeerBoundary,
    LinkStateLink,
    LinkStatePort,
    PdevBlockType,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from ipaddress import IPv4Interface

    from pnfarm.protocols.profinet.cm.ar import Ar
    from pnfarm.protocols.profinet.description import SubmoduleDescription
    from pnfarm.protocols.profinet.lldp.agent import Neighbour
    from pnfarm.protocols.profinet.records.pdev_checks import PortFacts
    from pnfarm.protocols.profinet.wire.block import RawBlock

__all__ = ["MOST_OCTETS", "InterfaceFacts", "PhysicalDevice", "is_pdev_subslot"]

#: Octets of the longest record that is kept: PDExpectedData has those of a submodule in one block (assumed: the
#: standard leaves the limit to the device).
MOST_OCTETS = 4096
#: A neighbour that keeps PROFINET's interval has sent by then; until then its absence is not an error (assumed).
_PEER_GRACE_NS = 5_000_000_000
_NO_ADDRESS = IPv4Address(0)
_EVERY_COUNTER_INVALID = 0x3F
_NO_PEER = (ChannelErrorType.REMOTE_MISMATCH, RemoteMismatch.NO_PEER_DETECTED)


#: Records that a controller may write, with the block that each must be.
_PORT_WRITABLE = {
    Index.PORT_DATA_CHECK: PdevBlockType.PORT_DATA_CHECK,
    Index.PORT_DATA_ADJUST: PdevBlockType.PORT_DATA_ADJUST,
    Index.PORT_MRP_DATA_ADJUST: PdevBlockType.PORT_MRP_DATA_ADJUST,
    Index.TRACE_UNIT: PdevBlockType.TRACE_UNIT,
}
_INTERFACE_WRITABLE = {
    Index.INTERFACE_MRP_DATA_CHECK: PdevBlockType.INTERFACE_MRP_DATA_CHECK,
    Index.INTERFACE_MRP_DATA_ADJUST: PdevBlockType.INTERFACE_MRP_DATA_ADJUST,
    Index.NC_DATA_CHECK: PdevBlockType.NC_DATA_CHECK,
    Index.INTERFACE_ADJUST: PdevBlockType.INTERFACE_ADJUST,
    Index.INTERFACE_FSU_DATA_ADJUST: PdevBlockType.INTERFACE_FSU_DATA_ADJUST,
    Index.PLL_CONTROL: PdevBlockType.PLL_CONTROL,
}
#: Written and read back, but not part of PDExpectedData.
_NOT_EXPECTED = frozenset({Index.PLL_CONTROL, Index.TRACE_UNIT})
_PORT_READABLE = frozenset({*_PORT_WRITABLE, Index.PORT_DATA_REAL, Index.PORT_STATISTIC})
_INTERFACE_READABLE = frozenset({*_INTERFACE_WRITABLE, Index.INTERFACE_DATA_REAL, Index.PORT_STATISTIC})
_DEVICE_READABLE = frozenset({Index.PD_REAL_DATA, Index.PD_EXPECTED_DATA})
#: PDPortDataCheck and -Adjust have a header that names their submodule.
_ADDRESSED = frozenset({Index.PORT_DATA_CHECK, Index.PORT_DATA_ADJUST})
_FIRST_SUBSLOT = 0x8000
_LAST_SUBSLOT = 0x8FFF


@dataclass(frozen=True, slots=True)
class InterfaceFacts:
    """The interface as it is now."""

    name: str
    mac: bytes
    address: IPv4Interface | None = None
    gateway: IPv4Address | None = None


class PhysicalDevice:
    """The handler of the PDev records, and the check of ports.

    ``submodules``: the DAP's, all of them; ``interface()`` and ``port(subslot)`` give facts, ``neighbours(subslot)``
    those that the port's LLDP agent knows.
    """

    def __init__(
        self,
        submodules: Iterable[SubmoduleDescription],
        interface: Callable[[], InterfaceFacts],
        port: Callable[[int], PortFacts],
        neighbours: Callable[[int], Sequence[Neighbour]],
    ) -> None:
        self._submodules = {(s.slot, s.subslot): s for s in submodules if is_pdev_subslot(s.subslot)}
        self._interface = interface
        self._port = port
        self._neighbours = neighbours
        #: What controllers wrote, by (slot, subslot, index).
        self.written: dict[tuple[int, int, int], bytes] = {}
        self._checks: dict[tuple[int, int], PortDataCheck] = {}
        self._grace_until: dict[tuple[int, int], int] = {}
        self._findings: dict[tuple[int, int], dict[tuple[int, int], Finding]] = {}
        self._events: list[CheckFailed | CheckPassed] = []
        #: Written by the controller: how LLDP names the device, and the ports that send no LLDP.
        self.name_mode = NameMode.PORT
        self.mute_ports: frozenset[int] = frozenset()

    @property
    def ports(self) -> tuple[int, ...]:
        """Subslots of the ports, ascending."""
        return tuple(sorted(subslot for _, subslot in self._submodules if not is_interface(subslot)))

    @staticmethod
    def handles(subslot: int, index: int) -> bool:
        """Whether a record is the physical device's: by its index, and by its submodule where it has one."""
        if index in _DEVICE_READABLE:
            return True
        return is_pdev_subslot(subslot) and index in _PORT_READABLE | _INTERFACE_READABLE

    # -- records -----------------------------------------------------------------------------------------------------

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        """The record's octets, empty for one that was never written; or the error."""
        del ar, now
        match index:
            case Index.PD_REAL_DATA:
                answer = b"".join(self._real(place) for place in sorted(self._submodules))
            case Index.PD_EXPECTED_DATA:
                answer = b"".join(self._expected(place) for place in sorted(self._submodules))
            case _:
                place = (slot, subslot)
                found = self._submodules.get(place)
                if found is None or found.api != api:
                    return RecordError(AccessError.INVALID_SLOT_SUBSLOT)
                if index not in (_INTERFACE_READABLE if is_interface(subslot) else _PORT_READABLE):
                    return RecordError(AccessError.INVALID_INDEX)
                answer = self._read(place, index)
        return answer if len(answer) <= max_length else RecordError(AccessError.INVALID_RANGE)

    def _read(self, place: tuple[int, int], index: int) -> bytes:
        match index:
            case Index.PORT_DATA_REAL:
                return self._port_data_real(*place).emit()
            case Index.INTERFACE_DATA_REAL:
                return self._interface_data_real().emit()
            case Index.PORT_STATISTIC:
                return self._statistic(place).emit()
        return self.written.get((*place, index), b"")

    def write(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, data: bytes, now: int
    ) -> RecordError | None:
        """None when the record was accepted, else the error."""
        del ar
        place = (slot, subslot)
        found = self._submodules.get(place)
        if index in _DEVICE_READABLE:
            return RecordError(AccessError.ACCESS_DENIED)
        if found is None or found.api != api:
            return RecordError(AccessError.INVALID_SLOT_SUBSLOT)
        writable = _INTERFACE_WRITABLE if is_interface(subslot) else _PORT_WRITABLE
        if index not in writable:
            readable = _INTERFACE_READABLE if is_interface(subslot) else _PORT_READABLE
            return RecordError(AccessError.ACCESS_DENIED if index in readable else AccessError.INVALID_INDEX)
        if len(data) > MOST_OCTETS:
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        try:
            (block,) = split_blocks(data)
            refused = self._take(place, index, writable[index], block, now)
        except (DecodeError, ValueError):  # of another shape; no block or several
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        if refused is None:
            self.written[*place, index] = data
        return refused

    def _take(self, place: tuple[int, int], index: int, wanted: int, block: RawBlock, now: int) -> RecordError | None:
        """Check one record and apply it.  Raises :class:`DecodeError` for one of another shape."""
        if block.block_type != wanted or block.version_high != VERSION_1_0 >> 8:
            return RecordError(AccessError.INVALID_PARAMETER)
        if index == Index.INTERFACE_ADJUST:
            self.name_mode = NameMode(InterfaceAdjust.of(block).multiple_interface_mode & 1)
        elif index in _ADDRESSED:
            checked = wanted == PdevBlockType.PORT_DATA_CHECK
            value = PortDataCheck.of(block) if checked else PortDataAdjust.of(block)
            if (value.slot, value.subslot) != place:
                return RecordError(AccessError.INVALID_PARAMETER)
            if isinstance(value, PortDataCheck):
                self._check(place, value, now)
            else:
                self._adjust(place[1], value)
        return None

    def _adjust(self, subslot: int, value: PortDataAdjust) -> None:
        mute = any(isinstance(sub, AdjustPeerToPeerBoundary) and sub.boundary & 1 for sub in value.blocks)
        self.mute_ports = self.mute_ports | {subslot} if mute else self.mute_ports - {subslot}

    def restore(self, written: Mapping[tuple[int, int, int], bytes], now: int) -> list[str]:
        """Restore what was kept over a power cycle.

        Returns a sentence for each record that does not fit the device; it is left out.
        """
        left_out = []
        for (slot, subslot, index), data in written.items():
            found = self._submodules.get((slot, subslot))
            if found is None or self.write(None, found.api, slot, subslot, index, data, now) is not None:
                left_out.append(f"kept record 0x{index:04X} of slot {slot} subslot 0x{subslot:04X} does not fit")
        return left_out

    def forget(self, now: int) -> None:
        """Reset to factory settings: no check or adjustment of a port remains."""
        self.written.clear()
        self.name_mode, self.mute_ports = NameMode.PORT, frozenset()
        self._checks = {place: PortDataCheck(*place, ()) for place in self._checks}
        self.evaluate(now)
        self._checks.clear()

    # -- real data ---------------------------------------------------------------------------------------------------

    def _port_data_real(self, slot: int, subslot: int) -> PortDataReal:
        facts = self._port(subslot)
        peers = tuple(
            PeerReal(n.port_name.encode()[:255], n.station_name.encode()[:255], 0, n.mac)
            for n in (self._neighbours(subslot) if facts.link_up else ())
        )
        return PortDataReal(
            slot,
            subslot,
            port_name(subslot).encode(),
            peers,
            facts.mau_type,
            link_state_port=LinkStatePort.UNKNOWN,
            link_state_link=LinkStateLink.UP if facts.link_up else LinkStateLink.DOWN,
            media_type=media_type_of(facts.mau_type),
        )

    def _interface_data_real(self) -> InterfaceDataReal:
        facts = self._interface()
        address = facts.address
        return InterfaceDataReal(
            facts.name.encode()[:255],
            facts.mac,
            address.ip if address else _NO_ADDRESS,
            address.netmask if address else _NO_ADDRESS,
            facts.gateway or _NO_ADDRESS,
        )

    def _statistic(self, place: tuple[int, int]) -> PortStatistic:
        """An interface has the sum of its ports; counters that the link does not keep are zero and marked invalid."""
        subslots = _ports_of(place[1], self.ports) if is_interface(place[1]) else (place[1],)
        counted = [c for s in subslots if (c := self._port(s).counters) is not None]
        if not counted:
            return PortStatistic(status=_EVERY_COUNTER_INVALID, version=VERSION_1_1)
        total = PortCounters(
            *(
                sum(getattr(counters, field) for counters in counted) & 0xFFFF_FFFF
                for field in PortCounters.__dataclass_fields__
            )
        )
        return PortStatistic(
            total.in_octets,
            total.out_octets,
            total.in_discards,
            total.out_discards,
            total.in_errors,
            total.out_errors,
        )

    def _real(self, place: tuple[int, int]) -> bytes:
        kind = Index.INTERFACE_DATA_REAL if is_interface(place[1]) else Index.PORT_DATA_REAL
        return self._multiple(place, (self._read(place, kind), self._read(place, Index.PORT_STATISTIC)))

    def _expected(self, place: tuple[int, int]) -> bytes:
        return self._multiple(
            place,
            [data for key, data in sorted(self.written.items()) if key[:2] == place and key[2] not in _NOT_EXPECTED],
        )

    def _multiple(self, place: tuple[int, int], records: Iterable[bytes]) -> bytes:
        blocks = tuple(block for data in records for block in split_blocks(data))
        if not blocks:
            return b""
        return MultipleBlock(self._submodules[place].api, *place, blocks).emit()

    # -- checks ------------------------------------------------------------------------------------------------------

    def _check(self, place: tuple[int, int], value: PortDataCheck, now: int) -> None:
        self._checks[place] = value
        self._grace_until[place] = now + _PEER_GRACE_NS
        self.evaluate(now)

    def evaluate(self, now: int) -> None:
        """Compare every port with what is expected; call it when a neighbour or a link changed, and at the deadline."""
        self._grace_until = {place: until for place, until in self._grace_until.items() if until > now}
        for place, check in self._checks.items():
            before = self._findings.get(place, {})
            # a check that is written again does not hide that the neighbour is missing
            known = place not in self._grace_until or _NO_PEER in before
            found = compare(check.blocks, self._port(place[1]), self._neighbours(place[1]), peers_known=known)
            after = {finding.key: finding for finding in found}
            self._events += [CheckPassed(*place, *key) for key in before if key not in after]
            self._events += [CheckFailed(*place, *key, f.detail) for key, f in after.items() if key not in before]
            self._findings[place] = after

    def events(self) -> list[CheckFailed | CheckPassed]:
        events, self._events = self._events, []
        return events

    @property
    def findings(self) -> dict[tuple[int, int], tuple[Finding, ...]]:
        """The checks that fail now, by (slot, subslot)."""
        return {place: tuple(found.values()) for place, found in self._findings.items() if found}

    def next_deadline(self) -> int | None:
        """When a neighbour that was never heard counts as missing."""
        return min(self._grace_until.values()) if self._grace_until else None

    def handle_timeout(self, now: int) -> None:
        self.evaluate(now)


def is_pdev_subslot(subslot: int) -> bool:
    return _FIRST_SUBSLOT <= subslot <= _LAST_SUBSLOT


def is_interface(subslot: int) -> bool:
    """0x8000, 0x8100 ... 0x8F00; the rest are ports."""
    return subslot & 0xFF == 0


def port_name(subslot: int) -> str:
    """``port-001`` for subslot 0x8001."""
    return f"port-{subslot & 0xFF:03}"


def _ports_of(interface: int, ports: Sequence[int]) -> tuple[int, ...]:
    return tuple(port for port in ports if port & 0xFF00 == interface)
