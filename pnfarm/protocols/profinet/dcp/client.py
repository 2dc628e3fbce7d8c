"""The client side of DCP, as in a controller or an engineering tool (IEC 61158-6-10, DCP).

Every request gets an Xid and becomes a transaction.  An Identify collects answers for a while, then ends in
:class:`IdentifyFinished`.  A Get or Set is repeated (same Xid) while there is no response and ends in exactly one
:class:`GetFinished` or :class:`SetFinished`.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.deadlines import Deadlines
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    IP_CONFLICT,
    PERMANENT,
    AliasBlock,
    AllSelectorBlock,
    Block,
    DeviceIdBlock,
    DeviceInitiativeBlock,
    DeviceInstanceBlock,
    DeviceOptionsBlock,
    DeviceRoleBlock,
    FullIpSuiteBlock,
    IpParameterBlock,
    MacBlock,
    NameBlock,
    OemDeviceIdBlock,
    OptionId,
    ResetMode,
    ResetToFactoryBlock,
    ResponseBlock,
    RsiPropertiesBlock,
    SignalBlock,
    StandardGatewayBlock,
    StationTypeBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import (
    IDENTIFY_MULTICAST,
    SERVICE_GET,
    SERVICE_HELLO,
    SERVICE_IDENTIFY,
    SERVICE_SET,
    TYPE_REQUEST,
    TYPE_SUCCESS,
    DcpPdu,
    emit_dcp,
    frame_id_of,
    parse_dcp,
)
from pnfarm.protocols.profinet.wire.dcp.texts import describe_block_error, describe_option
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, emit_ethernet

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "COLLECT_MARGIN_NS",
    "READABLE",
    "RETRIES",
    "TIMEOUT_NS",
    "DcpClient",
    "DcpClientEvent",
    "GetFinished",
    "HelloReceived",
    "IdentifyAnswered",
    "IdentifyFinished",
    "SetFinished",
    "StationInfo",
    "station_info",
]

#: How long a Get or Set waits for its answer, and how often it is repeated then.
TIMEOUT_NS = 10**9
RETRIES = 2
#: How long an Identify waits beyond the slowest answer that its delay factor allows.
COLLECT_MARGIN_NS = 400_000_000
#: How long late answers may keep an Identify from its end.
LONGEST_DELAY_NS = 10_000_000_000
_DELAY_STEP_NS = 10**7

_NONE = IPv4Address(0)
#: Every block that Get can request from a device.
READABLE: tuple[OptionId, ...] = (
    MacBlock.ID,
    IpParameterBlock.ID,
    FullIpSuiteBlock.ID,
    StationTypeBlock.ID,
    NameBlock.ID,
    DeviceIdBlock.ID,
    DeviceRoleBlock.ID,
    DeviceOptionsBlock.ID,
    DeviceInstanceBlock.ID,
    OemDeviceIdBlock.ID,
    StandardGatewayBlock.ID,
    RsiPropertiesBlock.ID,
    DeviceInitiativeBlock.ID,
)


@dataclass(frozen=True, slots=True)
class StationInfo:
    """A device as its blocks describe it; None for what no block gave."""

    name: str | None = None
    station_type: str | None = None
    vendor_id: int | None = None
    device_id: int | None = None
    role: int | None = None
    instance: tuple[int, int] | None = None
    oem: tuple[int, int] | None = None
    alias: str | None = None
    ip: IPv4Address | None = None
    mask: IPv4Address | None = None
    gateway: IPv4Address | None = None
    ip_info: int | None = None
    options: tuple[OptionId, ...] = ()
    mac: bytes | None = None
    dns: tuple[IPv4Address, ...] = ()

    @property
    def ip_conflict(self) -> bool:
        """Another station uses the same address, as far as the device knows."""
        return bool((self.ip_info or 0) & IP_CONFLICT)


@dataclass(frozen=True, slots=True)
class IdentifyAnswered:
    """One device answered; each MAC address once for each Identify."""

    xid: int
    mac: bytes
    info: StationInfo
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class IdentifyFinished:
    """The time for answers is over, or as many came as were expected."""

    xid: int
    answers: int


@dataclass(frozen=True, slots=True)
class GetFinished:
    """A Get ended; ``error`` is a message if there was no response or the device refused.

    ``blocks`` holds what was read also when some of it was refused.
    """

    xid: int
    mac: bytes
    blocks: tuple[Block, ...]
    error: str | None


@dataclass(frozen=True, slots=True)
class SetFinished:
    """A Set ended; ``results`` hold each block's error, ``error`` is a sentence when it failed."""

    xid: int
    mac: bytes
    results: tuple[ResponseBlock, ...]
    error: str | None


@dataclass(frozen=True, slots=True)
class HelloReceived:
    """A device announced itself."""

    mac: bytes
    info: StationInfo


DcpClientEvent = IdentifyAnswered | IdentifyFinished | GetFinished | SetFinished | HelloReceived


@dataclass(slots=True)
class _Collection:
    expected: int | None
    deadline: int
    latest: int
    quiet_ns: int = 0
    answered: set[bytes] = field(default_factory=set)


@dataclass(slots=True)
class _Transaction:
    mac: bytes
    service_id: int
    frame: bytes
    retries: int


def station_info(blocks: Iterable[Block]) -> StationInfo:
    """The contents of an answer's blocks, by name."""
    found: dict[str, object] = {}
    for block in blocks:
        match block:
            case NameBlock(name=name):
                found["name"] = name
            case StationTypeBlock(station_type=station_type):
                found["station_type"] = station_type
            case DeviceIdBlock(vendor_id=vendor_id, device_id=device_id):
                found |= {"vendor_id": vendor_id, "device_id": device_id}
            case DeviceRoleBlock(role=role):
                found["role"] = role
            case DeviceInstanceBlock(high=high, low=low):
                found["instance"] = (high, low)
            case OemDeviceIdBlock(vendor_id=vendor_id, device_id=device_id):
                found["oem"] = (vendor_id, device_id)
            case AliasBlock(alias=alias):
                found["alias"] = alias
            case IpParameterBlock(address=ip, mask=mask, gateway=gateway, info=info):
                found |= {"ip": ip, "mask": mask, "gateway": gateway, "ip_info": info}
            case FullIpSuiteBlock(address=ip, mask=mask, gateway=gateway, dns=dns, info=info):
                found |= {"ip": ip, "mask": mask, "gateway": gateway, "ip_info": info}
                found["dns"] = tuple(server for server in dns if server != _NONE)
            case MacBlock(mac=mac):
                found["mac"] = mac
            case DeviceOptionsBlock(options=options):
                found["options"] = options
            case _:
                pass  # blocks that say nothing about the station
    return StationInfo(**found)  # type: ignore[arg-type]  # each key was filled by its own block's field


def _error_text(block: ResponseBlock) -> str:
    return f"{describe_option(block.subject)}: {describe_block_error(block.error)}"


class DcpClient:
    """DCP initiator of one interface."""

    def __init__(self, mac: bytes, *, first_xid: int = 1) -> None:
        self.mac = mac
        #: What was received and not used, by reason.
        self.dropped: Counter[str] = Counter()
        self._xid = first_xid - 1
        self._collections: dict[int, _Collection] = {}
        self._transactions: dict[int, _Transaction] = {}
        #: Deadlines of both, by Xid: a start asks a thousand drives at once.
        self._deadlines = Deadlines()
        self._outbox: list[bytes] = []
        self._events: list[DcpClientEvent] = []

    # -- requests ----------------------------------------------------------------------------------------------------

    def identify(
        self,
        filters: Iterable[Block] = (),
        *,
        now: int,
        delay_factor: int = 1,
        window_ns: int | None = None,
        expected: int | None = None,
        quiet_ns: int = 0,
        destination: bytes = IDENTIFY_MULTICAST,
    ) -> int:
        """Identify all devices, or those that match every filter. Returns the Xid.

        ``delay_factor`` spreads the answers over (factor - 1) times 10 ms; ``window_ns`` is how long answers are
        collected (left out: until the slowest is due, and 0.4 s); ``expected`` answers end it early.
        It does not end within ``quiet_ns`` after an answer: where stations have no time, theirs come late.  After
        10 s more it ends whatever comes.
        """
        xid = self._next_xid()
        frame_id = frame_id_of(SERVICE_IDENTIFY, TYPE_REQUEST)
        blocks = tuple(filters) or (AllSelectorBlock(),)
        pdu = DcpPdu(frame_id, SERVICE_IDENTIFY, TYPE_REQUEST, xid, blocks=blocks, response_delay_factor=delay_factor)
        window = delay_factor * _DELAY_STEP_NS + COLLECT_MARGIN_NS if window_ns is None else window_ns
        self._collections[xid] = _Collection(expected, now + window, now + window + LONGEST_DELAY_NS, quiet_ns)
        self._deadlines.set(xid, now + window)
        self._outbox.append(self._frame(destination, pdu))
        return xid

    def get(self, mac: bytes, options: Iterable[OptionId], *, now: int) -> int:
        """Read blocks of one device. Returns the Xid."""
        return self._request(mac, SERVICE_GET, now, requested=tuple(options))

    def read(self, mac: bytes, *, now: int) -> int:
        """Read everything that a device can have; missing blocks are refused one by one. Returns the Xid."""
        return self.get(mac, READABLE, now=now)

    def set_blocks(self, mac: bytes, blocks: Iterable[Block], *, now: int) -> int:
        """Write blocks, each with its qualifier in ``info``. Returns the Xid."""
        return self._request(mac, SERVICE_SET, now, blocks=tuple(blocks))

    def set_name(self, mac: bytes, name: str, *, permanent: bool = True, now: int) -> int:
        """Give a device a station name ("" removes it). Returns the Xid."""
        return self.set_blocks(mac, [NameBlock(name, PERMANENT * permanent)], now=now)

    def set_ip(
        self,
        mac: bytes,
        interface: IPv4Interface | None,
        gateway: IPv4Address | None = None,
        *,
        permanent: bool = True,
        now: int,
    ) -> int:
        """Give a device an address (None removes it); without ``gateway`` its own address is sent."""
        address = mask = router = _NONE
        if interface is not None:
            address, mask, router = interface.ip, interface.netmask, gateway or interface.ip
        return self.set_blocks(mac, [IpParameterBlock(address, mask, router, PERMANENT * permanent)], now=now)

    def signal(self, mac: bytes, *, now: int) -> int:
        """Make a device's lamp flash. Returns the Xid."""
        return self.set_blocks(mac, [SignalBlock()], now=now)

    def reset_to_factory(self, mac: bytes, mode: int = ResetMode.COMMUNICATION, *, now: int) -> int:
        """Reset what ``mode`` says. Returns the Xid."""
        return self.set_blocks(mac, [ResetToFactoryBlock(mode << 1)], now=now)

    # -- the machine -------------------------------------------------------------------------------------------------

    def receive(self, frame: EthernetFrame, now: int) -> None:
        """Take one frame, tagged or not; answers to nothing are counted and dropped."""
        if frame.ethertype != ETHERTYPE_PROFINET:
            self.dropped["other-protocol"] += 1
            return
        try:
            pdu = parse_dcp(frame.payload)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return
        if pdu.service_id == SERVICE_HELLO and pdu.service_type == TYPE_REQUEST:
            self._events.append(HelloReceived(frame.source, station_info(pdu.blocks)))
        elif frame.destination != self.mac:
            self.dropped["other-destination"] += 1
        elif pdu.service_type == TYPE_REQUEST:
            self.dropped["request"] += 1
        elif pdu.service_id == SERVICE_IDENTIFY:
            self._receive_identified(frame.source, pdu, now)
        else:
            # it counts whenever it comes while its transaction is open
            self._receive_answer(frame.source, pdu)

    def to_send(self, now: int) -> list[bytes]:
        """Whole frames that must go out now, untagged."""
        self.handle_timeout(now)
        frames, self._outbox = self._outbox, []
        return frames

    def events(self) -> list[DcpClientEvent]:
        """Events since the last call."""
        events, self._events = self._events, []
        return events

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` has something to do, nanoseconds."""
        return self._deadlines.first()

    def handle_timeout(self, now: int) -> None:
        """End collections, repeat or give up requests."""
        for xid in self._deadlines.take(now):
            if xid in self._collections:
                self._finish_collection(xid)
                continue
            transaction = self._transactions[xid]
            if transaction.retries:
                transaction.retries -= 1
                self._deadlines.set(xid, now + TIMEOUT_NS)
                self._outbox.append(transaction.frame)
            else:
                self._finish(xid, transaction, (), f"no answer from {transaction.mac.hex(':')}")

    # -- inside ------------------------------------------------------------------------------------------------------

    def _receive_identified(self, source: bytes, pdu: DcpPdu, now: int) -> None:
        collection = self._collections.get(pdu.xid)
        if collection is None:
            self.dropped["unknown-xid"] += 1
        elif source in collection.answered:
            self.dropped["duplicate"] += 1
        else:
            collection.answered.add(source)
            quiet = min(now + collection.quiet_ns, collection.latest)
            if quiet > collection.deadline:
                collection.deadline = quiet
                self._deadlines.set(pdu.xid, collection.deadline)
            self._events.append(IdentifyAnswered(pdu.xid, source, station_info(pdu.blocks), pdu.blocks))
            if collection.expected is not None and len(collection.answered) >= collection.expected:
                self._finish_collection(pdu.xid)

    def _receive_answer(self, source: bytes, pdu: DcpPdu) -> None:
        transaction = self._transactions.get(pdu.xid)
        if transaction is None or transaction.mac != source or transaction.service_id != pdu.service_id:
            self.dropped["unknown-xid"] += 1
            return
        error = None if pdu.service_type == TYPE_SUCCESS else "the device does not support the service"
        refused = [block for block in pdu.blocks if isinstance(block, ResponseBlock) and block.error]
        if error is None and refused:
            error = "; ".join(_error_text(block) for block in refused)
        self._finish(pdu.xid, transaction, pdu.blocks, error)

    def _finish(self, xid: int, transaction: _Transaction, blocks: tuple[Block, ...], error: str | None) -> None:
        del self._transactions[xid]
        self._deadlines.set(xid, None)
        if transaction.service_id == SERVICE_GET:
            self._events.append(GetFinished(xid, transaction.mac, blocks, error))
        else:
            results = tuple(block for block in blocks if isinstance(block, ResponseBlock))
            self._events.append(SetFinished(xid, transaction.mac, results, error))

    def _finish_collection(self, xid: int) -> None:
        collection = self._collections.pop(xid)
        self._deadlines.set(xid, None)
        self._events.append(IdentifyFinished(xid, len(collection.answered)))

    def _request(
        self,
        mac: bytes,
        service_id: int,
        now: int,
        *,
        blocks: tuple[Block, ...] = (),
        requested: tuple[OptionId, ...] = (),
    ) -> int:
        xid = self._next_xid()
        frame_id = frame_id_of(service_id, TYPE_REQUEST)
        frame = self._frame(mac, DcpPdu(frame_id, service_id, TYPE_REQUEST, xid, blocks, requested))
        self._transactions[xid] = _Transaction(mac, service_id, frame, retries=RETRIES)
        self._deadlines.set(xid, now + TIMEOUT_NS)
        self._outbox.append(frame)
        return xid

    def _next_xid(self) -> int:
        self._xid = (self._xid + 1) & 0xFFFF_FFFF
        return self._xid

    def _frame(self, destination: bytes, pdu: DcpPdu) -> bytes:
        return emit_ethernet(EthernetFrame(destination, self.mac, ETHERTYPE_PROFINET, emit_dcp(pdu)))
