"""The answering end of DCP for one device (IEC 61158-6-10, DCP; CMINA for what a name or an address may be).

One machine is one device.  A farm parses an Identify once and hands the PDU to all its devices
(:meth:`DcpDevice.receive_pdu`), or asks :func:`identify_matches` first.

* Identify is answered when every filter of the request matches, with every block the device has, after a delay
  that spreads the devices of a large network: (the last two octets of the MAC address mod ResponseDelayFactor)
  times 10 ms.  Factors 0 and above 6400 are reserved and answered at once.
* Get and Set come by unicast.  After one, the device listens to no other client for three seconds (client hold
  time), so that two engineering stations do not configure it at the same time.
* Set takes over each block by itself and says for each what became of it.  Name and address are refused while an
  application relation is up (``in_operation``), unless they are the ones the device has anyway.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.dcp import (
    HELLO_MULTICAST,
    IDENTIFY_MULTICAST,
    MAXIMUM_DELAY_FACTOR,
    SERVICE_GET,
    SERVICE_HELLO,
    SERVICE_IDENTIFY,
    SERVICE_SET,
    TYPE_NOT_SUPPORTED,
    TYPE_REQUEST,
    TYPE_SUCCESS,
    DcpPdu,
    emit_dcp,
    frame_id_of,
    parse_dcp,
)
from pnfarm.protocols.profinet.wire.dcp_blocks import (
    IP_CONFLICT,
    IP_NOT_SET,
    IP_SET,
    OPTION_ALL,
    OPTION_CONTROL,
    OPTION_DEVICE,
    OPTION_DHCP,
    OPTION_INITIATIVE,
    OPTION_IP,
    PERMANENT,
    AliasBlock,
    AllSelectorBlock,
    Block,
    BlockError,
    DeviceIdBlock,
    DeviceInitiativeBlock,
    DeviceInstanceBlock,
    DeviceOptionsBlock,
    DeviceRoleBlock,
    FactoryResetBlock,
    FullIpSuiteBlock,
    IpParameterBlock,
    MacBlock,
    NameBlock,
    OemDeviceIdBlock,
    OptionId,
    ResetMode,
    ResetToFactoryBlock,
    ResponseBlock,
    SignalBlock,
    StartBlock,
    StationTypeBlock,
    StopBlock,
)
from pnfarm.protocols.profinet.wire.names import check_station_name
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, emit_ethernet

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = [
    "CLIENT_HOLD_NS",
    "DELAY_STEP_NS",
    "DcpDevice",
    "DcpDeviceEvent",
    "DcpIdentity",
    "FactoryReset",
    "IpSet",
    "NameSet",
    "SignalRequested",
    "check_ip_suite",
    "identify_matches",
    "response_delay_ns",
]

#: Client hold time (IEC 61158-5-10, 6.3.11.2.2).
CLIENT_HOLD_NS = 3 * 10**9
#: Unit of the response delay (IEC 61158-6-10, 4.3.1.3.5).
DELAY_STEP_NS = 10**7
#: Octets of blocks in one frame: 1500 less frame id and DCP header. What does not fit is left out and counted.
MAXIMUM_BODY = 1488
#: Answers to Identify that wait for their time.
PENDING_LIMIT = 16

_NONE = IPv4Address(0)
_NO_DNS = (_NONE, _NONE, _NONE, _NONE)
_OPTIONS = frozenset({OPTION_IP, OPTION_DEVICE, OPTION_DHCP, OPTION_CONTROL, OPTION_INITIATIVE, OPTION_ALL})
_RESET_MODES = frozenset(mode.value for mode in ResetMode)
_CLEARS_COMMUNICATION = frozenset(
    {
        ResetMode.COMMUNICATION,
        ResetMode.ALL,
        ResetMode.DEVICE,
        ResetMode.DEVICE_AND_RESTORE,
    }
)


@dataclass(frozen=True, slots=True)
class DcpIdentity:
    """What never changes about a device."""

    station_type: str
    vendor_id: int
    device_id: int
    instance: tuple[int, int] = (0, 1)
    role: int = 1
    oem: tuple[int, int] | None = None
    #: The device sends Hello at power-on, and says so.
    sends_hello: bool = False


@dataclass(frozen=True, slots=True)
class NameSet:
    """The station name became ``name`` ("": none); a temporary one also deletes the stored one."""

    name: str
    permanent: bool


@dataclass(frozen=True, slots=True)
class IpSet:
    """The address became ``interface`` (None: none); a temporary one also deletes the stored one."""

    interface: IPv4Interface | None
    gateway: IPv4Address | None
    permanent: bool


@dataclass(frozen=True, slots=True)
class SignalRequested:
    """Somebody wants to see the device's lamp flash."""


@dataclass(frozen=True, slots=True)
class FactoryReset:
    """A reset was ordered; name and address are cleared by events of their own where ``mode`` asks for it."""

    mode: ResetMode


DcpDeviceEvent = NameSet | IpSet | SignalRequested | FactoryReset


def response_delay_ns(mac: bytes, factor: int) -> int:
    """How long a device with this MAC address waits before it answers an Identify."""
    if not 0 < factor <= MAXIMUM_DELAY_FACTOR:
        return 0
    return int.from_bytes(mac[4:6], "big") % factor * DELAY_STEP_NS


def check_ip_suite(address: IPv4Address, mask: IPv4Address, gateway: IPv4Address) -> str | None:
    """What is wrong with an IP parameter block, as a sentence, or None (IEC 61158-6-10, 4.3.1.4.21).

    All three 0.0.0.0 is right: no address.  The gateway is 0.0.0.0 or the own address for none.
    """
    host_mask = ~int(mask) & 0xFFFF_FFFF
    if host_mask & (host_mask + 1):
        return f"the mask {mask} has a gap"
    if address == _NONE:
        return None if mask == gateway == _NONE else "mask and gateway need an address"
    if address.packed[0] in {0, 127} or address.packed[0] >= 224:
        return f"{address} is no address for a device"
    if int(address) & host_mask in {0, host_mask}:
        return f"{address} with mask {mask} is a network's or a broadcast address"
    if gateway != _NONE and (int(gateway) ^ int(address)) & int(mask):
        return f"the gateway {gateway} lies outside of the subnet of {address}"
    return None


class DcpDevice:
    """DCP responder of one device.

    Public attributes are the device's state; the owner may change them at any time.
    """

    def __init__(
        self,
        mac: bytes,
        identity: DcpIdentity,
        *,
        name: str = "",
        address: IPv4Interface | None = None,
        gateway: IPv4Address | None = None,
    ) -> None:
        self.mac = mac
        self.identity = identity
        self.name = name
        self.address = address
        #: None, or the own address, for no gateway.
        self.gateway = gateway
        self.dns: tuple[IPv4Address, IPv4Address, IPv4Address, IPv4Address] = _NO_DNS
        #: The present name and address outlive a power cycle.
        self.name_permanent = True
        self.ip_permanent = True
        #: Another station uses the address: shown in the BlockInfo of the IP blocks.
        self.ip_conflict = False
        #: ``<port>.<station name>`` of the neighbours, as LLDP learned them: what alias filters match.
        self.aliases: frozenset[str] = frozenset()
        #: An application relation is up: name and address stay as they are.
        self.in_operation = False
        #: Powered but mute: nothing is answered.
        self.silent = False
        #: What was not answered, by reason.
        self.dropped: Counter[str] = Counter()
        self._client: tuple[bytes, int] | None = None  # who is being listened to, until when
        self._transaction: int | None = None  # qualifier of the open one
        self._pending: list[tuple[int, bytes]] = []  # due time, frame; sorted
        self._outbox: list[bytes] = []
        self._events: list[DcpDeviceEvent] = []
        self._hello_xid = 0

    # -- the machine -------------------------------------------------------------------------------------------------

    def receive(self, frame: EthernetFrame, now: int) -> None:
        """Take one frame, tagged or not; what is no DCP for this device is counted and dropped."""
        if frame.ethertype != ETHERTYPE_PROFINET:
            self.dropped["other-protocol"] += 1
            return
        try:
            pdu = parse_dcp(frame.payload)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return
        self.receive_pdu(frame.source, frame.destination, pdu, now)

    def receive_pdu(self, source_mac: bytes, destination_mac: bytes, pdu: DcpPdu, now: int) -> None:
        """Take one parsed PDU, the same for many devices perhaps."""
        if self.silent:
            self.dropped["silent"] += 1
        elif pdu.service_type != TYPE_REQUEST:
            self.dropped["not-a-request"] += 1
        elif pdu.service_id == SERVICE_HELLO:
            self.dropped["hello"] += 1
        elif pdu.frame_id != frame_id_of(pdu.service_id, TYPE_REQUEST):
            self.dropped["wrong-frame-id"] += 1
        elif pdu.service_id == SERVICE_IDENTIFY:
            self._receive_identify(source_mac, destination_mac, pdu, now)
        elif destination_mac != self.mac:
            self.dropped["other-destination"] += 1
        elif self._client is not None and self._client[0] != source_mac and now < self._client[1]:
            self.dropped["held-by-other-client"] += 1
        else:
            self._receive_get_set(source_mac, pdu, now)

    def hello(self) -> None:
        """Announce the device to everybody, as at power-on."""
        blocks: list[Block] = [
            NameBlock(self.name),
            self._ip_parameter(),
            DeviceIdBlock(self.identity.vendor_id, self.identity.device_id),
            self._options(),
            DeviceRoleBlock(self.identity.role),
            DeviceInitiativeBlock(int(self.identity.sends_hello)),
        ]
        self._hello_xid = (self._hello_xid + 1) & 0xFFFF_FFFF
        frame_id = frame_id_of(SERVICE_HELLO, TYPE_REQUEST)
        pdu = DcpPdu(frame_id, SERVICE_HELLO, TYPE_REQUEST, self._hello_xid, tuple(blocks))
        self._outbox.append(self._frame(HELLO_MULTICAST, pdu))

    def to_send(self, now: int) -> list[bytes]:
        """Whole frames that must go out now, untagged."""
        self.handle_timeout(now)
        frames, self._outbox = self._outbox, []
        if self.silent:
            self.dropped["silent"] += len(frames)
            return []
        return frames

    def events(self) -> list[DcpDeviceEvent]:
        """Events since the last call."""
        events, self._events = self._events, []
        return events

    def next_deadline(self) -> int | None:
        """When the next delayed answer is due, nanoseconds."""
        return self._pending[0][0] if self._pending else None

    def handle_timeout(self, now: int) -> None:
        """Release the answers whose time has come."""
        while self._pending and self._pending[0][0] <= now:
            self._outbox.append(self._pending.pop(0)[1])

    # -- Identify ----------------------------------------------------------------------------------------------------

    def _receive_identify(self, source_mac: bytes, destination_mac: bytes, pdu: DcpPdu, now: int) -> None:
        if destination_mac not in {IDENTIFY_MULTICAST, self.mac}:
            self.dropped["other-destination"] += 1
            return
        if not identify_matches(pdu, self):
            self.dropped["filter"] += 1
            return
        if len(self._pending) >= PENDING_LIMIT:
            self.dropped["queue-full"] += 1
            return
        blocks = self._identify_blocks()
        blocks += [AliasBlock(block.alias) for block in pdu.blocks if isinstance(block, AliasBlock)][:1]
        due = now + response_delay_ns(self.mac, pdu.response_delay_factor)
        self._pending.append((due, self._response(source_mac, pdu, tuple(blocks))))
        self._pending.sort(key=lambda item: item[0])

    def _identify_blocks(self) -> list[Block]:
        identity = self.identity
        blocks: list[Block] = [
            NameBlock(self.name),
            self._ip_parameter(),
            StationTypeBlock(identity.station_type),
            DeviceIdBlock(identity.vendor_id, identity.device_id),
            DeviceRoleBlock(identity.role),
            self._options(),
            DeviceInstanceBlock(*identity.instance),
        ]
        if identity.oem is not None:
            blocks.append(OemDeviceIdBlock(*identity.oem))
        if identity.sends_hello:
            blocks.append(DeviceInitiativeBlock(1))
        return blocks

    # -- Get and Set -------------------------------------------------------------------------------------------------

    def _receive_get_set(self, source_mac: bytes, pdu: DcpPdu, now: int) -> None:
        if pdu.service_id == SERVICE_GET:
            blocks = tuple(self._get(option_id) for option_id in pdu.requested)
        elif pdu.service_id == SERVICE_SET:
            blocks = tuple(ResponseBlock(block.option_id, self._set(block)) for block in pdu.blocks)
        else:
            self._outbox.append(self._response(source_mac, pdu, (), TYPE_NOT_SUPPORTED))
            return
        self._client = (source_mac, now + CLIENT_HOLD_NS)
        self._outbox.append(self._response(source_mac, pdu, blocks))

    def _get(self, option_id: OptionId) -> Block:
        getter = _GETTERS.get(option_id)
        block = getter(self) if getter else None
        return block or ResponseBlock(option_id, _unsupported(option_id))

    def _set(self, block: Block) -> BlockError:
        permanent = bool((block.info or 0) & PERMANENT)
        match block:
            case NameBlock(name=name):
                return self._set_name(name, permanent=permanent)
            case IpParameterBlock(address=address, mask=mask, gateway=gateway):
                return self._set_ip(address, mask, gateway, permanent=permanent)
            case FullIpSuiteBlock(address=address, mask=mask, gateway=gateway):
                error = self._set_ip(address, mask, gateway, permanent=permanent)
                if error is BlockError.OK:
                    self.dns = block.dns
                return error
            case StartBlock(info=qualifier):
                self._transaction = qualifier
                return BlockError.OK
            case StopBlock(info=qualifier):
                opened, self._transaction = self._transaction, None
                return BlockError.OK if opened == qualifier else BlockError.SUBOPTION_NOT_SET
            case SignalBlock():
                self._events.append(SignalRequested())
                return BlockError.OK
            case FactoryResetBlock():
                return self._reset(ResetMode.ALL)
            case ResetToFactoryBlock(mode=mode):
                return self._reset(mode)
            case _ if block.option_id in _SETTABLE:
                return BlockError.SUBOPTION_NOT_SET  # known, but the value has another shape
            case _:
                return _unsupported(block.option_id)

    def _set_name(self, name: str, *, permanent: bool) -> BlockError:
        if name and check_station_name(name) is not None:
            return BlockError.SUBOPTION_NOT_SET
        if name != self.name and self.in_operation:
            return BlockError.IN_OPERATION
        self._take_name(name, permanent=permanent)
        return BlockError.OK

    def _set_ip(self, address: IPv4Address, mask: IPv4Address, gateway: IPv4Address, *, permanent: bool) -> BlockError:
        if check_ip_suite(address, mask, gateway) is not None:
            return BlockError.SUBOPTION_NOT_SET
        interface = None if address == _NONE else IPv4Interface((address.packed, int(mask).bit_count()))
        router = None if gateway == _NONE else gateway
        if (interface, router) != (self.address, self.gateway) and self.in_operation:
            return BlockError.IN_OPERATION
        self._take_ip(interface, router, permanent=permanent)
        return BlockError.OK

    def _reset(self, mode: int) -> BlockError:
        if mode not in _RESET_MODES:
            return BlockError.SUBOPTION_NOT_SET
        self._events.append(FactoryReset(ResetMode(mode)))
        if mode in _CLEARS_COMMUNICATION:
            self.dns = _NO_DNS
            self._take_name("", permanent=True)
            self._take_ip(None, None, permanent=True)
        return BlockError.OK

    def _take_name(self, name: str, *, permanent: bool) -> None:
        if (name, permanent) != (self.name, self.name_permanent):
            self.name, self.name_permanent = name, permanent
            self._events.append(NameSet(name, permanent))

    def _take_ip(self, interface: IPv4Interface | None, gateway: IPv4Address | None, *, permanent: bool) -> None:
        if (interface, gateway, permanent) != (self.address, self.gateway, self.ip_permanent):
            self.address, self.gateway, self.ip_permanent = interface, gateway, permanent
            router = None if interface is not None and gateway == interface.ip else gateway
            self._events.append(IpSet(interface, router, permanent))

    # -- blocks and frames -------------------------------------------------------------------------------------------

    def _ip_values(self) -> tuple[IPv4Address, IPv4Address, IPv4Address]:
        if self.address is None:
            return _NONE, _NONE, _NONE
        return self.address.ip, self.address.netmask, self.gateway or _NONE

    def _ip_info(self) -> int:
        return (IP_NOT_SET if self.address is None else IP_SET) | IP_CONFLICT * self.ip_conflict

    def _ip_parameter(self) -> IpParameterBlock:
        return IpParameterBlock(*self._ip_values(), info=self._ip_info())

    def _full_ip_suite(self) -> FullIpSuiteBlock:
        return FullIpSuiteBlock(*self._ip_values(), dns=self.dns, info=self._ip_info())

    def _oem_device_id(self) -> OemDeviceIdBlock | None:
        return OemDeviceIdBlock(*self.identity.oem) if self.identity.oem is not None else None

    def _options(self) -> DeviceOptionsBlock:
        known = [option_id for option_id in _GETTERS if option_id != OemDeviceIdBlock.ID or self.identity.oem]
        return DeviceOptionsBlock((*known, AliasBlock.ID, *_CONTROLS, AllSelectorBlock.ID))

    def _response(
        self, destination: bytes, request: DcpPdu, blocks: tuple[Block, ...], service_type: int = TYPE_SUCCESS
    ) -> bytes:
        frame_id = frame_id_of(request.service_id, service_type)
        room = MAXIMUM_BODY
        fitting: list[Block] = []
        for block in blocks:
            room -= (6 + len(block.payload()) + 1) // 2 * 2  # option, length, info, padding
            if room < 0:
                self.dropped["response-full"] += 1
            else:
                fitting.append(block)
        return self._frame(destination, DcpPdu(frame_id, request.service_id, service_type, request.xid, tuple(fitting)))

    def _frame(self, destination: bytes, pdu: DcpPdu) -> bytes:
        return emit_ethernet(EthernetFrame(destination, self.mac, ETHERTYPE_PROFINET, emit_dcp(pdu)))


_CONTROLS = (StartBlock.ID, StopBlock.ID, SignalBlock.ID, FactoryResetBlock.ID, ResetToFactoryBlock.ID)
_SETTABLE = frozenset({NameBlock.ID, IpParameterBlock.ID, FullIpSuiteBlock.ID, *_CONTROLS})

# What Get reads. None from a function means: this device has no such data.
_GETTERS: dict[OptionId, Callable[[DcpDevice], Block | None]] = {
    MacBlock.ID: lambda device: MacBlock(device.mac),
    IpParameterBlock.ID: DcpDevice._ip_parameter,  # noqa: SLF001  # the table belongs to the class
    FullIpSuiteBlock.ID: DcpDevice._full_ip_suite,  # noqa: SLF001  # as above
    StationTypeBlock.ID: lambda device: StationTypeBlock(device.identity.station_type),
    NameBlock.ID: lambda device: NameBlock(device.name),
    DeviceIdBlock.ID: lambda device: DeviceIdBlock(device.identity.vendor_id, device.identity.device_id),
    DeviceRoleBlock.ID: lambda device: DeviceRoleBlock(device.identity.role),
    DeviceOptionsBlock.ID: DcpDevice._options,  # noqa: SLF001  # as above
    DeviceInstanceBlock.ID: lambda device: DeviceInstanceBlock(*device.identity.instance),
    OemDeviceIdBlock.ID: DcpDevice._oem_device_id,  # noqa: SLF001  # as above
    DeviceInitiativeBlock.ID: lambda device: DeviceInitiativeBlock(int(device.identity.sends_hello)),
}


def _unsupported(option_id: OptionId) -> BlockError:
    known = option_id.option in _OPTIONS
    return BlockError.SUBOPTION_NOT_SUPPORTED if known else BlockError.OPTION_NOT_SUPPORTED


def identify_matches(request: DcpPdu, device: DcpDevice) -> bool:
    """Whether every filter of an Identify request fits the device; a request without any fits nobody."""
    return bool(request.blocks) and all(_filter_matches(block, device) for block in request.blocks)


def _filter_matches(block: Block, device: DcpDevice) -> bool:
    match block:
        case AllSelectorBlock():
            return True
        case AliasBlock(alias=alias):
            return alias in device.aliases
        case DeviceRoleBlock(role=role):
            return role == device.identity.role
        case DeviceOptionsBlock(options=options):
            return set(options) <= set(device._options().options)  # noqa: SLF001  # a friend of the class
        case _:
            # Every other filter is a block that Get would read, with the same value.
            getter = _GETTERS.get(block.option_id)
            own = getter(device) if getter else None
            return own is not None and own.payload() == block.payload()
