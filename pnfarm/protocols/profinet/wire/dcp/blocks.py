"""Blocks of the discovery and basic configuration protocol (IEC 61158-6-10, DCP blocks and their coding).

A block is an option, a suboption and a value.  Between the length and the value may stand a BlockInfo or a
BlockQualifier; whether it does depends on the service and is known to the PDU's codec.
"""

from collections.abc import Mapping
from contextlib import suppress
from enum import IntEnum
from typing import Annotated, Any, ClassVar, NamedTuple

from pnfarm.errors import DecodeError
from pnfarm.wire.code import Code
from pnfarm.wire.layout import (
    Codec,
    Count,
    Fixed,
    Ip,
    ListOfRest,
    Mac,
    Outside,
    Rest,
    Structure,
    UInt8,
    UInt16,
)
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "IP_CONFLICT",
    "IP_NOT_SET",
    "IP_SET",
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


class BlockError(Code):
    """Result of one block (coding of the field BlockError)."""

    OK = 0
    OPTION_NOT_SUPPORTED = 1
    SUBOPTION_NOT_SUPPORTED = 2, "suboption not supported, or no data set available"
    SUBOPTION_NOT_SET = 3
    RESOURCE_ERROR = 4
    SET_NOT_POSSIBLE = 5, "set not possible for local reasons"
    IN_OPERATION = 6, "in operation, set not possible"  # an application relation is up


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


class Block(Structure):
    """One block with the value's octets, without length, info and padding; option and suboption name its kind.

    ``info`` is its BlockInfo (responses, Hello) or BlockQualifier (Set), unused in filters.
    """

    ID: ClassVar[OptionId]
    CALLED: ClassVar[str]
    KINDS: ClassVar[dict[OptionId, type["Block"]]] = {}

    def __init_subclass__(cls, *, option: tuple[int, int] | None = None, called: str = "", **more: Any) -> None:
        super().__init_subclass__(**more)
        if option is not None:
            cls.ID, cls.CALLED = OptionId(*option), called
            cls.KINDS[cls.ID] = cls

    @property
    def option_id(self) -> OptionId:
        """Option and suboption."""
        return self.ID

    @property
    def info(self) -> int | None:
        """A field of every kind."""
        raise NotImplementedError


class _Latin1(Codec):
    """It maps every octet to one character: a name that breaks the rules arrives whole and can be refused."""

    def read(self, r: Reader, _values: Mapping[str, Any]) -> str:
        return r.rest().decode("latin-1")

    def write(self, w: Writer, value: str) -> None:
        w.bytes(value.encode("latin-1"))


_Text = Annotated[str, _Latin1()]
_Option = Annotated[OptionId, Fixed("BB", OptionId, tuple)]


class UnknownBlock(Block):
    """Any option, any octets; ``info`` is None when the block has (or had) no room for one."""

    option: Outside[int]
    suboption: Outside[int]
    data: Rest = b""
    info: Outside[int | None] = None

    @property
    def option_id(self) -> OptionId:
        return OptionId(self.option, self.suboption)


class MacBlock(Block, option=(OPTION_IP, 1), called="MAC address"):
    """IP / MAC address."""

    mac: Mac
    info: Outside[int] = 0


class IpParameterBlock(Block, option=(OPTION_IP, 2), called="IP parameter"):
    """IP / IP parameter."""

    address: Ip
    mask: Ip
    gateway: Ip
    info: Outside[int] = 0


class FullIpSuiteBlock(Block, option=(OPTION_IP, 3), called="full IP suite"):
    """IP / full IP suite: with four name servers, 0.0.0.0 for none."""

    address: Ip
    mask: Ip
    gateway: Ip
    dns: Annotated[tuple[Ip, ...], Count(lambda _: 4)]
    info: Outside[int] = 0


class StationTypeBlock(Block, option=(OPTION_DEVICE, 1), called="type of station"):
    """Device properties / manufacturer specific: the type of station in plain text."""

    station_type: _Text
    info: Outside[int] = 0


class NameBlock(Block, option=(OPTION_DEVICE, 2), called="name of station"):
    """Device properties / name of station; empty for no name."""

    name: _Text
    info: Outside[int] = 0


class DeviceIdBlock(Block, option=(OPTION_DEVICE, 3), called="device ID"):
    """Device properties / device ID."""

    vendor_id: UInt16
    device_id: UInt16
    info: Outside[int] = 0


class DeviceRoleBlock(Block, option=(OPTION_DEVICE, 4), called="device role"):
    """Device properties / role, a bit set: 1 IO device, 2 controller, 4 multidevice, 8 supervisor."""

    role: UInt8
    info: Outside[int] = 0
    reserved: UInt8 = 0


class DeviceOptionsBlock(Block, option=(OPTION_DEVICE, 5), called="device options"):
    """Device properties / options: the blocks that the device supports."""

    options: ListOfRest[_Option]
    info: Outside[int] = 0


class AliasBlock(Block, option=(OPTION_DEVICE, 6), called="alias name"):
    """Device properties / alias name: ``<port>.<station name>`` of a neighbour."""

    alias: _Text
    info: Outside[int] = 0


class DeviceInstanceBlock(Block, option=(OPTION_DEVICE, 7), called="device instance"):
    """Device properties / device instance."""

    high: UInt8
    low: UInt8
    info: Outside[int] = 0


class OemDeviceIdBlock(Block, option=(OPTION_DEVICE, 8), called="OEM device ID"):
    """Device properties / OEM device ID."""

    vendor_id: UInt16
    device_id: UInt16
    info: Outside[int] = 0


class StandardGatewayBlock(Block, option=(OPTION_DEVICE, 9), called="standard gateway"):
    """Device properties / standard gateway: how "no gateway" is written; 0: as the device's own address."""

    value: UInt16
    info: Outside[int] = 0


class RsiPropertiesBlock(Block, option=(OPTION_DEVICE, 10), called="RSI properties"):
    """Device properties / RSI properties: a bit set; a device that is reached over RPC alone has no such block."""

    properties: UInt16
    info: Outside[int] = 0


class DhcpBlock(Block):
    """DHCP: the suboption is the DHCP option's code, the value its octets."""

    suboption: Outside[int]
    data: Rest
    info: Outside[int] = 0

    @property
    def option_id(self) -> OptionId:
        return OptionId(OPTION_DHCP, self.suboption)


class StartBlock(Block, option=(OPTION_CONTROL, 1), called="start transaction"):
    """Control / start of a transaction; the qualifier is the transaction's."""

    info: Outside[int] = 0


class StopBlock(Block, option=(OPTION_CONTROL, 2), called="end transaction"):
    """Control / end of a transaction, with the qualifier of its start."""

    info: Outside[int] = 0


class SignalBlock(Block, option=(OPTION_CONTROL, 3), called="signal"):
    """Control / signal: flash a lamp, three seconds at 1 Hz."""

    value: UInt16 = SIGNAL_FLASH_ONCE
    info: Outside[int] = 0


class ResponseBlock(Block, option=(OPTION_CONTROL, 4), called="response"):
    """Control / response: the result of one block of the request. It has no block info."""

    subject: _Option
    error: UInt8 = BlockError.OK
    info: Outside[None] = None


class FactoryResetBlock(Block, option=(OPTION_CONTROL, 5), called="reset of factory settings"):
    """Control / reset of factory settings, the old service without modes."""

    info: Outside[int] = 0


class ResetToFactoryBlock(Block, option=(OPTION_CONTROL, 6), called="reset to factory"):
    """Control / reset to factory; the mode is in bits 1 to 15 of the qualifier, see :class:`ResetMode`."""

    info: Outside[int] = ResetMode.COMMUNICATION << 1

    @property
    def mode(self) -> int:
        """Number of the mode, also one that :class:`ResetMode` does not name."""
        return self.info >> 1


class DeviceInitiativeBlock(Block, option=(OPTION_INITIATIVE, 1), called="device initiative"):
    """Device initiative: 1 when the device sends Hello at power-on."""

    value: UInt16
    info: Outside[int] = 0


class AllSelectorBlock(Block, option=(OPTION_ALL, 0xFF), called="all selector"):
    """All selector: every device answers. Some peers send two octets with it."""

    data: Rest = b""
    info: Outside[int] = 0


def shape_block(option_id: OptionId, data: bytes, info: int | None) -> Block:
    """A block of its own kind when the value has that kind's shape, an :class:`UnknownBlock` otherwise."""
    if option_id.option == OPTION_DHCP:
        return DhcpBlock(option_id.suboption, data, info or 0)
    kind = Block.KINDS.get(option_id)
    if kind is not None and kind is not ResponseBlock:
        with suppress(DecodeError):
            return kind.parse(data, info=info or 0)
    return UnknownBlock(*option_id, data, info)
