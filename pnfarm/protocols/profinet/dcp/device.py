"""The server side of DCP for one device (IEC 61158-6-10, DCP; CMINA for allowed names and addresses).

One machine is one device.  A farm parses an Identify once and hands the PDU to all its devices
(:meth:`DcpDevice.receive_pdu`), or asks :func:`identify_matches` first.

* Identify is answered when every filter of the request matches, with every block the device has, after a delay
  that spreads the devices of a large network (:func:`~pnfarm.protocols.profinet.dcp.rules.response_delay_ns`).
  For each station that asked, only the newest answer waits.  When too many wait, the next one goes out at once: the
  delay only protects the network, and no station may miss its response because of earlier requests.
* Get and Set come by unicast.  After one, the device listens to no other client for three seconds (client hold
  time), so that two engineering stations do not configure it at the same time.
* Set accepts or refuses each block on its own and answers with a result for each.  While an application relation is up
(``in_operation``), CMINA rules: another address is refused; another name, no name, or no address is accepted and
ends the relation (:class:`AbortRequired`); what the device has already is accepted and changes nothing.
* Hello is sent at link-up if it is enabled, until a Set arrives or all are sent.
"""

from __future__ import annotations

from collections import Counter
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.dcp.rules import (
    NO_DNS,
    RESET_CLEARS,
    RESET_MODES,
    AbortRequired,
    DcpDeviceEvent,
    DcpIdentity,
    Dns,
    FactoryReset,
    HelloMode,
    HelloSettings,
    IpSet,
    NameSet,
    SignalBegan,
    SignalEnded,
    Stored,
    check_ip_suite,
    response_delay_ns,
    router_of,
)
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.protocols.profinet.wire.dcp.blocks import (
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
    SIGNAL_FLASH_ONCE,
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
    StandardGatewayBlock,
    StartBlock,
    StationTypeBlock,
    StopBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import (
    HELLO_MULTICAST,
    IDENTIFY_MULTICAST,
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
from pnfarm.protocols.profinet.wire.names import check_station_name
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, emit_ethernet

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = [
    "CLIENT_HOLD_NS",
    "SIGNAL_NS",
    "DcpDevice",
    "identify_matches",
]

#: Client hold time (IEC 61158-5-10, 6.3.11.2.2).
CLIENT_HOLD_NS = 3 * 10**9
#: How long the lamp flashes after a signal, at 1 Hz (IEC 61158-5-10, Control/Signal).
SIGNAL_NS = 3 * 10**9
#: Octets of blocks in one frame: 1500 less frame id and DCP header. What does not fit is left out and counted.
MAXIMUM_BODY = 1488
#: Results of one Set that fit in its answer, eight octets each.
MAXIMUM_RESULTS = MAXIMUM_BODY // 8
#: Stations whose answers to Identify wait for their time.
PENDING_LIMIT = 16

#: Where the Xid is in a frame: after addresses, EtherType, frame id, service and its type.
_XID = 18
_NONE = IPv4Address(0)
_OPTIONS = frozenset({OPTION_IP, OPTION_DEVICE, OPTION_DHCP, OPTION_CONTROL, OPTION_INITIATIVE, OPTION_ALL})
_RESET_MODES = frozenset(mode.value for mode in ResetMode)


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
        dns: Dns = NO_DNS,
    ) -> None:
        self.mac = mac
        self.identity = identity
        self.name = name
        self.address = address
        #: None, or the own address, for no gateway.
        self.gateway = gateway
        self.dns = dns
        #: Whether what is set permanently can be kept.
        self.can_keep: Callable[[], bool] = lambda: True
        #: The present name and address outlive a power cycle.
        self.name_permanent = True
        self.ip_permanent = True
        #: Another station uses the address: shown in the BlockInfo of the IP blocks.
        self.ip_conflict = False
        #: The address is in use; False when it was left to another station that had it first.
        self.ip_in_use = True
        #: ``<port>.<station name>`` of the neighbours, as LLDP learned them: what alias filters match.
        self.aliases: frozenset[str] = frozenset()
        #: An application relation is up.
        self.in_operation = False
        #: Blocks that cannot be set for local reasons, such as a name that a switch on the device gives.
        self.locked: frozenset[OptionId] = frozenset()
        #: When to send Hello.
        self.hello_settings = HelloSettings(HelloMode.OFF)
        #: Powered but mute: nothing is answered.
        self.silent = False
        #: What was not answered, by reason.
        self.dropped: Counter[str] = Counter()
        self._client: tuple[bytes, int] | None = None  # the client of the client hold time, and its end
        self._transaction: int | None = None  # qualifier of the open one
        #: Identify requests that were answered so far, and those of them that asked for this station by its name.
        self.identified = 0
        self.sought = 0
        self._pending: dict[bytes, tuple[int, DcpPdu]] = {}  # asking station: when its answer is due, its request
        #: The last answer to Identify, and what it was made of.
        self._last_answer: tuple[tuple[object, ...] | None, bytes] = (None, b"")
        self._signal_end: int | None = None
        self._hello: tuple[int, int] | None = None  # when the next one is due, how many are left
        self._hello_xid = 0
        self._outbox: list[bytes] = []
        self._events: list[DcpDeviceEvent] = []

    @property
    def signalling(self) -> bool:
        """The lamp flashes."""
        return self._signal_end is not None

    @property
    def client(self) -> bytes:
        """The MAC address of who got or set something last, empty before."""
        return b"" if self._client is None else self._client[0]

    # -- the machine -------------------------------------------------------------------------------------------------

    def receive(self, frame: EthernetFrame, now: int) -> None:
        """Take one frame, tagged or not; frames that are not DCP for this device are counted and dropped."""
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

    def link_up(self, now: int) -> None:
        """The device came on the wire: it sends Hello if that is enabled and it has a name and an address (CMINA)."""
        settings = self.hello_settings
        if settings.mode is not HelloMode.OFF and settings.count and self.name and self.address is not None:
            self._hello = (now + settings.first_ns, settings.count)

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
        """When the next delayed answer or Hello is due, or the lamp goes out, nanoseconds."""
        if not self._pending and self._hello is None:
            return self._signal_end
        deadlines = [due for due, _ in self._pending.values()]
        if self._hello is not None:
            deadlines.append(self._hello[0])
        if self._signal_end is not None:
            deadlines.append(self._signal_end)
        return min(deadlines)

    def handle_timeout(self, now: int) -> None:
        """Send the answers and Hellos that are due; switch the lamp off."""
        if self._pending:
            ready = sorted((due, asker) for asker, (due, _) in self._pending.items() if due <= now)
            for _, asker in ready:
                request = self._pending.pop(asker)[1]
                # name or address may be others since the request came
                if identify_matches(request, self):
                    self._outbox.append(self._identified(asker, request))
                else:
                    self.dropped["filter"] += 1
        if self._hello is not None and self._hello[0] <= now:
            left = self._hello[1] - 1
            self._hello = (now + self.hello_settings.interval_ns, left) if left else None
            self._say_hello()
        if self._signal_end is not None and self._signal_end <= now:
            self._signal_end = None
            self._events.append(SignalEnded())

    def _say_hello(self) -> None:
        self._hello_xid = (self._hello_xid + 1) & 0xFFFF_FFFF
        frame_id = frame_id_of(SERVICE_HELLO, TYPE_REQUEST)
        pdu = DcpPdu(frame_id, SERVICE_HELLO, TYPE_REQUEST, self._hello_xid, self._blocks(_HELLO))
        self._outbox.append(self._frame(HELLO_MULTICAST, pdu))

    # -- Identify ----------------------------------------------------------------------------------------------------

    def _receive_identify(self, source_mac: bytes, destination_mac: bytes, pdu: DcpPdu, now: int) -> None:
        if destination_mac not in {IDENTIFY_MULTICAST, self.mac}:
            self.dropped["other-destination"] += 1
            return
        if not identify_matches(pdu, self):
            self.dropped["filter"] += 1
            return
        self.identified += 1
        self.sought += any(isinstance(block, NameBlock) for block in pdu.blocks)
        delay_ns = response_delay_ns(self.mac, pdu.response_delay_factor)
        waits = source_mac in self._pending
        if not delay_ns or (not waits and len(self._pending) >= PENDING_LIMIT):
            self._outbox.append(self._identified(source_mac, pdu))
            return
        if waits:
            self.dropped["superseded"] += 1
        self._pending[source_mac] = (now + delay_ns, pdu)

    def _identified(self, asker: bytes, request: DcpPdu) -> bytes:
        """The answer to an Identify request; a whole network is asked at once, and mostly nothing has changed."""
        alias = next((block for block in request.blocks if isinstance(block, AliasBlock)), None)
        state = (
            self.mac, self.identity, self.name, self._ip_values(), self._ip_info(), self.hello_settings.mode,
            None if alias is None else alias.alias,
        )  # fmt: skip
        if self._last_answer[0] != state:
            blocks = self._blocks(_IDENTIFIED)
            if self.hello_settings.mode is not HelloMode.OFF:
                blocks += (self._initiative(),)
            if alias is not None:
                blocks += (AliasBlock(alias.alias),)
            self._last_answer = state, self._response(asker, request, blocks)
        frame = self._last_answer[1]
        return asker + frame[6:_XID] + request.xid.to_bytes(4, "big") + frame[_XID + 4 :]

    def _blocks(self, wanted: tuple[OptionId, ...]) -> tuple[Block, ...]:
        """Those that the device has."""
        return tuple(block for option_id in wanted if (block := _GETTERS[option_id](self)) is not None)

    # -- Get and Set -------------------------------------------------------------------------------------------------

    def _receive_get_set(self, source_mac: bytes, pdu: DcpPdu, now: int) -> None:
        if pdu.service_id == SERVICE_GET:
            blocks = tuple(self._get(option_id) for option_id in pdu.requested)
        elif pdu.service_id == SERVICE_SET:
            self._hello = None  # a station has found the device
            # a block whose result would not fit in the answer is not set either
            if len(pdu.blocks) > MAXIMUM_RESULTS:
                self.dropped["response-full"] += len(pdu.blocks) - MAXIMUM_RESULTS
            blocks = tuple(
                ResponseBlock(block.option_id, self._set(block, now)) for block in pdu.blocks[:MAXIMUM_RESULTS]
            )
        else:
            self._outbox.append(self._response(source_mac, pdu, (), TYPE_NOT_SUPPORTED))
            return
        self._client = (source_mac, now + CLIENT_HOLD_NS)
        self._outbox.append(self._response(source_mac, pdu, blocks))

    def _get(self, option_id: OptionId) -> Block:
        getter = _GETTERS.get(option_id)
        block = getter(self) if getter else None
        return block or ResponseBlock(option_id, _unsupported(option_id))

    def _set(self, block: Block, now: int) -> BlockError:
        if block.option_id in self.locked:
            return BlockError.SET_NOT_POSSIBLE
        permanent = bool((block.info or 0) & PERMANENT)
        if not self.can_keep() and (permanent or isinstance(block, (FactoryResetBlock, ResetToFactoryBlock))):
            return BlockError.SET_NOT_POSSIBLE
        match block:
            case NameBlock(name=name):
                return self._set_name(name, permanent=permanent)
            case IpParameterBlock(address=address, mask=mask, gateway=gateway):
                return self._set_ip(address, mask, gateway, self.dns, permanent=permanent)
            case FullIpSuiteBlock(address=address, mask=mask, gateway=gateway, dns=dns):
                return self._set_ip(address, mask, gateway, dns, permanent=permanent)
            case StartBlock(info=qualifier):
                self._transaction = qualifier
                return BlockError.OK
            case StopBlock(info=qualifier):
                # some peers end a Set with this block without having opened a transaction: nothing to end then
                opened, self._transaction = self._transaction, None
                return BlockError.OK if opened in {None, qualifier} else BlockError.SUBOPTION_NOT_SET
            case SignalBlock(value=value):
                return self._signal(value, now)
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
        if name != self.name:
            self._end_operation(RtaError.STATION_NAME_CHANGED)
        self._take_name(name, permanent=permanent)
        return BlockError.OK

    def _set_ip(
        self, address: IPv4Address, mask: IPv4Address, gateway: IPv4Address, dns: Dns, *, permanent: bool
    ) -> BlockError:
        if check_ip_suite(address, mask, gateway) is not None:
            return BlockError.SUBOPTION_NOT_SET
        interface = None if address == _NONE else IPv4Interface((address.packed, int(mask).bit_count()))
        router = None if gateway == _NONE else gateway
        if (interface, router_of(interface, router)) != (self.address, router_of(self.address, self.gateway)):
            if self.in_operation and interface is not None:
                return BlockError.IN_OPERATION
            self._end_operation(RtaError.IP_SUITE_CHANGED)
        self._take_ip(interface, router, dns, permanent=permanent)
        return BlockError.OK

    def _signal(self, value: int, now: int) -> BlockError:
        if value != SIGNAL_FLASH_ONCE:
            return BlockError.SUBOPTION_NOT_SET
        if self._signal_end is None:
            self._events.append(SignalBegan())
        self._signal_end = now + SIGNAL_NS
        return BlockError.OK

    def _reset(self, mode: int) -> BlockError:
        if mode not in _RESET_MODES:
            return BlockError.SUBOPTION_NOT_SET
        reset = ResetMode(mode)
        if reset not in RESET_MODES:
            return BlockError.SUBOPTION_NOT_SUPPORTED
        self._end_operation(RtaError.RESET_TO_FACTORY)
        clears = RESET_CLEARS[reset]
        self._events.append(FactoryReset(reset, clears))
        if Stored.COMMUNICATION in clears:
            self._take_name("", permanent=True)
            self._take_ip(None, None, NO_DNS, permanent=True)
        return BlockError.OK

    def _end_operation(self, reason: RtaError) -> None:
        if self.in_operation:
            self.in_operation = False
            self._events.append(AbortRequired(reason))

    def _take_name(self, name: str, *, permanent: bool) -> None:
        if (name, permanent) != (self.name, self.name_permanent):
            self.name, self.name_permanent = name, permanent
            self._events.append(NameSet(name, permanent))

    def _take_ip(
        self, interface: IPv4Interface | None, gateway: IPv4Address | None, dns: Dns, *, permanent: bool
    ) -> None:
        before = (self.address, self.gateway, self.dns, self.ip_permanent)
        if (interface, gateway, dns, permanent) != before:
            self.address, self.gateway, self.dns, self.ip_permanent = interface, gateway, dns, permanent
            self._events.append(IpSet(interface, router_of(interface, gateway), permanent, dns))

    # -- blocks and frames -------------------------------------------------------------------------------------------

    def _ip_values(self) -> tuple[IPv4Address, IPv4Address, IPv4Address]:
        if self.address is None:
            return _NONE, _NONE, _NONE
        return self.address.ip, self.address.netmask, self.gateway or _NONE

    def _ip_info(self) -> int:
        in_use = self.address is not None and self.ip_in_use
        return (IP_SET if in_use else IP_NOT_SET) | IP_CONFLICT * self.ip_conflict

    def _ip_parameter(self) -> IpParameterBlock:
        return IpParameterBlock(*self._ip_values(), info=self._ip_info())

    def _full_ip_suite(self) -> FullIpSuiteBlock:
        return FullIpSuiteBlock(*self._ip_values(), dns=self.dns, info=self._ip_info())

    def _oem_device_id(self) -> OemDeviceIdBlock | None:
        return OemDeviceIdBlock(*self.identity.oem) if self.identity.oem is not None else None

    def _initiative(self) -> DeviceInitiativeBlock:
        return DeviceInitiativeBlock(int(self.hello_settings.mode is not HelloMode.OFF))

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
            info = 0 if block.info is None else 2
            room -= (4 + info + len(block.emit()) + 1) // 2 * 2  # option, length, info, value, padding
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
    StandardGatewayBlock.ID: lambda _device: StandardGatewayBlock(0),
    DeviceInitiativeBlock.ID: DcpDevice._initiative,  # noqa: SLF001  # as above
}
#: What a device says of itself, in the order of DCP-Hello-ReqPDU and of its answer to Identify.
_HELLO = (
    NameBlock.ID, IpParameterBlock.ID, DeviceIdBlock.ID, OemDeviceIdBlock.ID, DeviceOptionsBlock.ID,
    DeviceRoleBlock.ID, DeviceInitiativeBlock.ID,
)  # fmt: skip
_IDENTIFIED = (
    NameBlock.ID, IpParameterBlock.ID, StationTypeBlock.ID, DeviceIdBlock.ID, DeviceRoleBlock.ID,
    DeviceOptionsBlock.ID, DeviceInstanceBlock.ID, OemDeviceIdBlock.ID,
)  # fmt: skip


def _unsupported(option_id: OptionId) -> BlockError:
    known = option_id.option in _OPTIONS
    return BlockError.SUBOPTION_NOT_SUPPORTED if known else BlockError.OPTION_NOT_SUPPORTED


def identify_matches(request: DcpPdu, device: DcpDevice) -> bool:
    """Whether every filter of an Identify request fits the device; a request without any matches no device."""
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
            return set(options) <= set(device._options().options)  # noqa: SLF001  # belongs to the class
        case _:
            # Every other filter is a block that Get would read, with the same value.
            getter = _GETTERS.get(block.option_id)
            own = getter(device) if getter else None
            return own is not None and own.emit() == block.emit()
