"""Blocks of the discovery and basic configuration protocol (IEC 61158-6-10, DCP blocks and their coding).

A block is an option, a suboption and a value.  Between the length and the value may stand a BlockInfo or a
BlockQualifier; whether it does depends on the service and is known to the PDU's codec.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from ipaddress import IPv4Address
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from pnfarm.wire.octets import Writer

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = [
    "IP_CONFLICT",
    "IP_NOT_SET",
    "IP_SET",
    "IP_SET_BY_DHCP",
    "PERMANENT",
    "SIGNAL_FLASH_ONCE",
    "AliasBlock",
    "AllSelectorBlock",
    "Block",
    "BlockError",
    "DeviceIdBlock",
    "DeviceInitiativeBlock",
    "DeviceInstanceBlock",
    "DeviceOptionsBlock",
    "DeviceRoleBlock",
    "DhcpBlock",
    "FactoryResetBlock",
    "FullIpSuiteBlock",
    "IpParameterBlock",
    "MacBlock",
    "NameBlock",
    "OemDeviceIdBlock",
    "OptionId",
    "ResetMode",
    "ResetToFactoryBlock",
    "ResponseBlock",
    "RsiPropertiesBlock",
    "SignalBlock",
    "StandardGatewayBlock",
    "StartBlock",
    "StationTypeBlock",
    "StopBlock",
    "UnknownBlock",
    "shape_block",
]

OPTION_IP = 0x01
OPTION_DEVICE = 0x02
OPTION_DHCP = 0x03
OPTION_CONTROL = 0x05
OPTION_INITIATIVE = 0x06
OPTION_ALL = 0xFF

#: BlockQualifier bit 0 of Set: the value outlives a power cycle.
PERMANENT = 0x0001
#: Value of the block Control/Signal.
SIGNAL_FLASH_ONCE = 0x0100

# BlockInfo of the IP blocks (coding of BlockInfo, option IP).
IP_NOT_SET = 0
IP_SET = 1
IP_SET_BY_DHCP = 2
IP_CONFLICT = 0x80


class BlockError(IntEnum):
    """Result of one block (coding of the field BlockError)."""

    OK = 0
    OPTION_NOT_SUPPORTED = 1
    SUBOPTION_NOT_SUPPORTED = 2  # or: no data set available
    SUBOPTION_NOT_SET = 3
    RESOURCE_ERROR = 4
    SET_NOT_POSSIBLE = 5  # for local reasons
    IN_OPERATION = 6  # an application relation is up


class ResetMode(IntEnum):
    """What Control/ResetToFactory resets: bits 1 to 15 of its BlockQualifier."""

    APPLICATION = 1
    COMMUNICATION = 2
    ENGINEERING = 3
    ALL = 4
    DEVICE = 8
    DEVICE_AND_RESTORE = 9


class OptionId(NamedTuple):
    """Option and suboption: the name of a block."""

    option: int
    suboption: int


class Block(ABC):
    """One block; ``info`` is its BlockInfo (responses, Hello) or BlockQualifier (Set), unused in filters."""

    __slots__ = ()
    info: int | None

    @property
    @abstractmethod
    def option_id(self) -> OptionId:
        """Option and suboption."""

    @abstractmethod
    def payload(self) -> bytes:
        """The value's octets, without length, info and padding."""


class _Named(Block):
    """A block whose kind has one option and suboption."""

    __slots__ = ()
    ID: ClassVar[OptionId]

    @property
    def option_id(self) -> OptionId:
        return self.ID


class _Empty(_Named):
    __slots__ = ()

    def payload(self) -> bytes:
        return b""


@dataclass(frozen=True, slots=True)
class UnknownBlock(Block):
    """Any option, any octets; ``info`` is None when the block has (or had) no room for one."""

    option: int
    suboption: int
    data: bytes = b""
    info: int | None = None

    @property
    def option_id(self) -> OptionId:
        return OptionId(self.option, self.suboption)

    def payload(self) -> bytes:
        return self.data


@dataclass(frozen=True, slots=True)
class MacBlock(_Named):
    """IP / MAC address."""

    ID: ClassVar = OptionId(OPTION_IP, 1)
    mac: bytes
    info: int = 0

    def payload(self) -> bytes:
        return self.mac


@dataclass(frozen=True, slots=True)
class IpParameterBlock(_Named):
    """IP / IP parameter."""

    ID: ClassVar = OptionId(OPTION_IP, 2)
    address: IPv4Address
    mask: IPv4Address
    gateway: IPv4Address
    info: int = 0

    def payload(self) -> bytes:
        return self.address.packed + self.mask.packed + self.gateway.packed


@dataclass(frozen=True, slots=True)
class FullIpSuiteBlock(_Named):
    """IP / full IP suite: with four name servers, 0.0.0.0 for none."""

    ID: ClassVar = OptionId(OPTION_IP, 3)
    address: IPv4Address
    mask: IPv4Address
    gateway: IPv4Address
    dns: tuple[IPv4Address, IPv4Address, IPv4Address, IPv4Address]
    info: int = 0

    def payload(self) -> bytes:
        return b"".join(ip.packed for ip in (self.address, self.mask, self.gateway, *self.dns))


@dataclass(frozen=True, slots=True)
class StationTypeBlock(_Named):
    """Device properties / manufacturer specific: the type of station in plain text."""

    ID: ClassVar = OptionId(OPTION_DEVICE, 1)
    station_type: str
    info: int = 0

    def payload(self) -> bytes:
        return _encode(self.station_type)


@dataclass(frozen=True, slots=True)
class NameBlock(_Named):
    """Device properties / name of station; empty for no name."""

    ID: ClassVar = OptionId(OPTION_DEVICE, 2)
    name: str
    info: int = 0

    def payload(self) -> bytes:
        return _encode(self.name)


@dataclass(frozen=True, slots=True)
class DeviceIdBlock(_Named):
    """Device properties / device ID."""

    ID: ClassVar = OptionId(OPTION_DEVICE, 3)
    vendor_id: int
    device_id: int
    info: int = 0

    def payload(self) -> bytes:
        return Writer().u16(self.vendor_id).u16(self.device_id).getvalue()


@dataclass(frozen=True, slots=True)
class DeviceRoleBlock(_Named):
    """Device properties / role, a bit set: 1 IO device, 2 controller, 4 multidevice, 8 supervisor."""

    ID: ClassVar = OptionId(OPTION_DEVICE, 4)
    role: int
    info: int = 0
    reserved: int = 0

    def payload(self) -> bytes:
        return Writer().u8(self.role).u8(self.reserved).getvalue()


@dataclass(frozen=True, slots=True)
class DeviceOptionsBlock(_Named):
    """Device properties / options: the blocks that the device supports."""

    ID: ClassVar = OptionId(OPTION_DEVICE, 5)
    options: tuple[OptionId, ...]
    info: int = 0

    def payload(self) -> bytes:
        return b"".join(bytes(option) for option in self.options)


@dataclass(frozen=True, slots=True)
class AliasBlock(_Named):
    """Device properties / alias name: ``<port>.<station name>`` of a neighbour."""

    ID: ClassVar = OptionId(OPTION_DEVICE, 6)
    alias: str
    info: int = 0

    def payload(self) -> bytes:
        return _encode(self.alias)


@dataclass(frozen=True, slots=True)
class DeviceInstanceBlock(_Named):
    """Device properties / device instance."""

    ID: ClassVar = OptionId(OPTION_DEVICE, 7)
    high: int
    low: int
    info: int = 0

    def payload(self) -> bytes:
        return Writer().u8(self.high).u8(self.low).getvalue()


@dataclass(frozen=True, slots=True)
class OemDeviceIdBlock(_Named):
    """Device properties / OEM device ID."""

    ID: ClassVar = OptionId(OPTION_DEVICE, 8)
    vendor_id: int
    device_id: int
    info: int = 0

    def payload(self) -> bytes:
        return Writer().u16(self.vendor_id).u16(self.device_id).getvalue()


@dataclass(frozen=True, slots=True)
class StandardGatewayBlock(_Named):
    """Device properties / standard gateway: how "no gateway" is written; 0: as the device's own address."""

    ID: ClassVar = OptionId(OPTION_DEVICE, 9)
    value: int
    info: int = 0

    def payload(self) -> bytes:
        return Writer().u16(self.value).getvalue()


@dataclass(frozen=True, slots=True)
class RsiPropertiesBlock(_Named):
    """Device properties / RSI properties: a bit set; a device that is reached over RPC alone has no such block."""

    ID: ClassVar = OptionId(OPTION_DEVICE, 10)
    properties: int
    info: int = 0

    def payload(self) -> bytes:
        return Writer().u16(self.properties).getvalue()


@dataclass(frozen=True, slots=True)
class DhcpBlock(Block):
    """DHCP: the suboption is the DHCP option's code, the value its octets."""

    suboption: int
    data: bytes
    info: int = 0

    @property
    def option_id(self) -> OptionId:
        return OptionId(OPTION_DHCP, self.suboption)

    def payload(self) -> bytes:
        return self.data


@dataclass(frozen=True, slots=True)
class StartBlock(_Empty):
    """Control / start of a transaction; the qualifier is the transaction's."""

    ID: ClassVar = OptionId(OPTION_CONTROL, 1)
    info: int = 0


@dataclass(frozen=True, slots=True)
class StopBlock(_Empty):
    """Control / end of a transaction, with the qualifier of its start."""

    ID: ClassVar = OptionId(OPTION_CONTROL, 2)
    info: int = 0


@dataclass(frozen=True, slots=True)
class SignalBlock(_Named):
    """Control / signal: flash a lamp, three seconds at 1 Hz."""

    ID: ClassVar = OptionId(OPTION_CONTROL, 3)
    value: int = SIGNAL_FLASH_ONCE
    info: int = 0

    def payload(self) -> bytes:
        return Writer().u16(self.value).getvalue()


@dataclass(frozen=True, slots=True)
class ResponseBlock(_Named):
    """Control / response: the result of one block of the request. It has no block info."""

    ID: ClassVar = OptionId(OPTION_CONTROL, 4)
    subject: OptionId
    error: int = BlockError.OK
    info: None = None

    def payload(self) -> bytes:
        return Writer().bytes(bytes(self.subject)).u8(self.error).getvalue()


@dataclass(frozen=True, slots=True)
class FactoryResetBlock(_Empty):
    """Control / reset of factory settings, the old service without modes."""

    ID: ClassVar = OptionId(OPTION_CONTROL, 5)
    info: int = 0


@dataclass(frozen=True, slots=True)
class ResetToFactoryBlock(_Empty):
    """Control / reset to factory; the mode is in bits 1 to 15 of the qualifier, see :class:`ResetMode`."""

    ID: ClassVar = OptionId(OPTION_CONTROL, 6)
    info: int = ResetMode.COMMUNICATION << 1

    @property
    def mode(self) -> int:
        """Number of the mode, also one that :class:`ResetMode` does not name."""
        return self.info >> 1


@dataclass(frozen=True, slots=True)
class DeviceInitiativeBlock(_Named):
    """Device initiative: 1 when the device sends Hello at power-on."""

    ID: ClassVar = OptionId(OPTION_INITIATIVE, 1)
    value: int
    info: int = 0

    def payload(self) -> bytes:
        return Writer().u16(self.value).getvalue()


@dataclass(frozen=True, slots=True)
class AllSelectorBlock(_Named):
    """All selector: every device answers. Some peers send two octets with it."""

    ID: ClassVar = OptionId(OPTION_ALL, 0xFF)
    data: bytes = b""
    info: int = 0

    def payload(self) -> bytes:
        return self.data


def _encode(text: str) -> bytes:
    # Latin-1 maps every octet to one character: a name that breaks the rules arrives whole and can be refused.
    return text.encode("latin-1")


def _decode(data: bytes) -> str:
    return data.decode("latin-1")


def _ips(data: bytes) -> list[IPv4Address]:
    return [IPv4Address(data[i : i + 4]) for i in range(0, len(data), 4)]


def _u16(data: bytes, index: int = 0) -> int:
    return int.from_bytes(data[2 * index : 2 * index + 2], "big")


def _ip_parameter(data: bytes, info: int) -> Block | None:
    if len(data) != 12:
        return None
    address, mask, gateway = _ips(data)
    return IpParameterBlock(address, mask, gateway, info)


def _full_suite(data: bytes, info: int) -> Block | None:
    if len(data) != 28:
        return None
    address, mask, gateway, *dns = _ips(data)
    return FullIpSuiteBlock(address, mask, gateway, (dns[0], dns[1], dns[2], dns[3]), info)


def _options(data: bytes, info: int) -> Block | None:
    if len(data) % 2:
        return None
    pairs = zip(data[::2], data[1::2], strict=True)
    return DeviceOptionsBlock(tuple(OptionId(*pair) for pair in pairs), info)


# Parsers of each option's value; a function returns None for a value of another shape.
_SHAPES: dict[OptionId, Callable[[bytes, int], Block | None]] = {
    MacBlock.ID: lambda data, info: MacBlock(data, info) if len(data) == 6 else None,
    IpParameterBlock.ID: _ip_parameter,
    FullIpSuiteBlock.ID: _full_suite,
    StationTypeBlock.ID: lambda data, info: StationTypeBlock(_decode(data), info),
    NameBlock.ID: lambda data, info: NameBlock(_decode(data), info),
    DeviceIdBlock.ID: lambda data, info: DeviceIdBlock(_u16(data), _u16(data, 1), info) if len(data) == 4 else None,
    DeviceRoleBlock.ID: lambda data, info: DeviceRoleBlock(data[0], info, data[1]) if len(data) == 2 else None,
    DeviceOptionsBlock.ID: _options,
    AliasBlock.ID: lambda data, info: AliasBlock(_decode(data), info),
    DeviceInstanceBlock.ID: lambda data, info: DeviceInstanceBlock(data[0], data[1], info) if len(data) == 2 else None,
    OemDeviceIdBlock.ID: lambda data, info: (
        OemDeviceIdBlock(_u16(data), _u16(data, 1), info) if len(data) == 4 else None
    ),
    StandardGatewayBlock.ID: lambda data, info: StandardGatewayBlock(_u16(data), info) if len(data) == 2 else None,
    RsiPropertiesBlock.ID: lambda data, info: RsiPropertiesBlock(_u16(data), info) if len(data) == 2 else None,
    StartBlock.ID: lambda data, info: None if data else StartBlock(info),
    StopBlock.ID: lambda data, info: None if data else StopBlock(info),
    SignalBlock.ID: lambda data, info: SignalBlock(_u16(data), info) if len(data) == 2 else None,
    FactoryResetBlock.ID: lambda data, info: None if data else FactoryResetBlock(info),
    ResetToFactoryBlock.ID: lambda data, info: None if data else ResetToFactoryBlock(info),
    DeviceInitiativeBlock.ID: lambda data, info: DeviceInitiativeBlock(_u16(data), info) if len(data) == 2 else None,
    AllSelectorBlock.ID: AllSelectorBlock,
}


def shape_block(option_id: OptionId, data: bytes, info: int | None) -> Block:
    """A block of its own kind when the value has that kind's shape, an :class:`UnknownBlock` otherwise."""
    if option_id.option == OPTION_DHCP:
        return DhcpBlock(option_id.suboption, data, info or 0)
    shape = _SHAPES.get(option_id)
    block = shape(data, info or 0) if shape else None
    return block or UnknownBlock(*option_id, data, info)
