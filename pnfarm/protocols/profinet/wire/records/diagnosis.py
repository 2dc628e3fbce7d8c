"""Diagnosis on the wire: the items that alarms and records share, and the DiagnosisData block
(IEC 61158-6-10, coding of ChannelProperties, UserStructureIdentifier and DiagnosisData).

An item begins with its UserStructureIdentifier (USI) in an alarm; in DiagnosisData the USI stands once, before all
items of its kind.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.block import (
    VERSION_1_0,
    VERSION_1_1,
    BlockType,
    RawBlock,
    check_type,
    emit_raw_block,
    parse_raw_block,
)
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "WHOLE_SUBMODULE",
    "ChannelDiagnosis",
    "ChannelProperties",
    "ChannelSpecifier",
    "DiagnosisData",
    "DiagnosisItem",
    "Direction",
    "ExtChannelDiagnosis",
    "Maintenance",
    "MaintenanceItem",
    "MaintenanceStatus",
    "QualifiedChannelDiagnosis",
    "Qualifier",
    "UserItem",
    "Usi",
    "emit_diagnosis_data",
    "emit_items",
    "parse_diagnosis_data",
    "parse_items",
]

#: ChannelNumber: the submodule as such, not one of its channels 0 to 0x7FFF.
WHOLE_SUBMODULE = 0x8000


class Usi(IntEnum):
    """UserStructureIdentifier; 0 to 0x7FFF are the manufacturer's."""

    MANUFACTURER_LAST = 0x7FFF
    CHANNEL = 0x8000
    MULTIPLE = 0x8001
    EXT_CHANNEL = 0x8002
    QUALIFIED_CHANNEL = 0x8003
    MAINTENANCE = 0x8100


class Maintenance(IntEnum):
    """ChannelProperties.Maintenance, bits 9 and 10: the severity; a qualified item has it in its qualifier."""

    FAULT = 0
    REQUIRED = 1
    DEMANDED = 2
    QUALIFIED = 3


class ChannelSpecifier(IntEnum):
    """ChannelProperties.Specifier, bits 11 and 12."""

    ALL_DISAPPEAR = 0
    APPEARS = 1
    DISAPPEARS = 2
    DISAPPEARS_OTHERS_REMAIN = 3


class Direction(IntEnum):
    """ChannelProperties.Direction, bits 13 to 15."""

    MANUFACTURER_SPECIFIC = 0
    INPUT = 1
    OUTPUT = 2
    INPUT_OUTPUT = 3


class Qualifier:
    """Bits of QualifiedChannelQualifier, by severity; bits 0 to 2 are reserved."""

    ADVICE = 0x0000_0078
    REQUIRED = 0x0001_FF80
    DEMANDED = 0x07FE_0000
    FAULT = 0xF800_0000


class MaintenanceStatus:
    """Bits of the field MaintenanceStatus; the others are the bits of :class:`Qualifier`."""

    REQUIRED = 1 << 0
    DEMANDED = 1 << 1


@dataclass(frozen=True, slots=True)
class ChannelProperties:
    """The bit field ChannelProperties.  ``type`` is the channel's width: 0 unspecified, 1 to 7 for 1 to 64 bit."""

    type: int = 0
    accumulative: bool = False
    maintenance: int = Maintenance.FAULT
    specifier: int = ChannelSpecifier.APPEARS
    direction: int = Direction.MANUFACTURER_SPECIFIC

    @classmethod
    def from_int(cls, value: int) -> ChannelProperties:
        return cls(value & 0xFF, bool(value >> 8 & 1), value >> 9 & 3, value >> 11 & 3, value >> 13 & 7)

    def __int__(self) -> int:
        return (
            self.type & 0xFF
            | self.accumulative << 8
            | (self.maintenance & 3) << 9
            | (self.specifier & 3) << 11
            | (self.direction & 7) << 13
        )


@dataclass(frozen=True, slots=True)
class ChannelDiagnosis:
    """USI 0x8000."""

    channel: int
    properties: ChannelProperties
    error_type: int

    @property
    def usi(self) -> int:
        return Usi.CHANNEL


@dataclass(frozen=True, slots=True)
class ExtChannelDiagnosis:
    """USI 0x8002."""

    channel: int
    properties: ChannelProperties
    error_type: int
    ext_error_type: int
    ext_add_value: int

    @property
    def usi(self) -> int:
        return Usi.EXT_CHANNEL


@dataclass(frozen=True, slots=True)
class QualifiedChannelDiagnosis:
    """USI 0x8003; ``qualifier`` holds bits of :class:`Qualifier`."""

    channel: int
    properties: ChannelProperties
    error_type: int
    ext_error_type: int
    ext_add_value: int
    qualifier: int

    @property
    def usi(self) -> int:
        return Usi.QUALIFIED_CHANNEL


@dataclass(frozen=True, slots=True)
class MaintenanceItem:
    """USI 0x8100: block 0x0F00 with the submodule's MaintenanceStatus; precedes the items of an alarm."""

    status: int
    version: int = VERSION_1_0

    @property
    def usi(self) -> int:
        return Usi.MAINTENANCE


@dataclass(frozen=True, slots=True)
class UserItem:
    """An item of a manufacturer's USI, or of one without a codec here: octets up to the end."""

    usi: int
    data: bytes


DiagnosisItem = ChannelDiagnosis | ExtChannelDiagnosis | QualifiedChannelDiagnosis | MaintenanceItem | UserItem


def _read_channel(r: Reader) -> tuple[int, ChannelProperties, int]:
    return r.u16(), ChannelProperties.from_int(r.u16()), r.u16()


def _read_maintenance(r: Reader) -> MaintenanceItem:
    block = parse_raw_block(r)
    body = check_type(block, BlockType.MAINTENANCE_ITEM)
    body.skip(2)
    value = MaintenanceItem(body.u32(), block.version)
    body.expect_end()
    return value


def _read_item(r: Reader, usi: int) -> DiagnosisItem:
    match usi:
        case Usi.CHANNEL:
            return ChannelDiagnosis(*_read_channel(r))
        case Usi.EXT_CHANNEL:
            return ExtChannelDiagnosis(*_read_channel(r), r.u16(), r.u32())
        case Usi.QUALIFIED_CHANNEL:
            return QualifiedChannelDiagnosis(*_read_channel(r), r.u16(), r.u32(), r.u32())
        case Usi.MAINTENANCE:
            return _read_maintenance(r)
        case _:
            return UserItem(usi, r.rest())


def parse_items(data: bytes, usi: int = Usi.CHANNEL) -> tuple[DiagnosisItem, ...]:
    """All items of one USI; at least one.  Raises :class:`DecodeError` where the last one is cut off."""
    r = Reader(data)
    items = [_read_item(r, usi)]
    while r.remaining:
        items.append(_read_item(r, usi))
    return tuple(items)


def _emit_item(item: DiagnosisItem) -> bytes:
    if isinstance(item, UserItem):
        return item.data
    w = Writer()
    if isinstance(item, MaintenanceItem):
        body = w.zeros(2).u32(item.status).getvalue()
        return emit_raw_block(RawBlock(BlockType.MAINTENANCE_ITEM, body, item.version))
    w.u16(item.channel).u16(int(item.properties)).u16(item.error_type)
    if not isinstance(item, ChannelDiagnosis):
        w.u16(item.ext_error_type).u32(item.ext_add_value)
    if isinstance(item, QualifiedChannelDiagnosis):
        w.u32(item.qualifier)
    return w.getvalue()


def emit_items(items: Iterable[DiagnosisItem]) -> list[tuple[int, bytes]]:
    """Each item as an alarm carries it: its USI and what follows the USI."""
    return [(item.usi, _emit_item(item)) for item in items]


@dataclass(frozen=True, slots=True)
class DiagnosisData:
    """0x0010: items of one submodule and of one USI.  Version 1.0 names no API, which is then 0.

    ``channel`` and ``properties`` sum up channel-coded items (the whole submodule); for a manufacturer's item, which
    names no channel of its own, they say where it is.
    """

    api: int
    slot: int
    subslot: int
    channel: int
    properties: ChannelProperties
    usi: int
    items: tuple[DiagnosisItem, ...]
    version: int = VERSION_1_1


def _names_api(version: int) -> bool:
    return version & 0xFF != VERSION_1_0 & 0xFF


def parse_diagnosis_data(block: RawBlock) -> DiagnosisData:
    r = check_type(block, BlockType.DIAGNOSIS_DATA)
    api = r.u32() if _names_api(block.version) else 0
    slot, subslot, channel, properties, usi = r.u16(), r.u16(), r.u16(), ChannelProperties.from_int(r.u16()), r.u16()
    return DiagnosisData(api, slot, subslot, channel, properties, usi, parse_items(r.rest(), usi), block.version)


def emit_diagnosis_data(value: DiagnosisData) -> bytes:
    """Raises :class:`ValueError` for version 1.0 with another API than 0, and for items of another USI."""
    w = Writer()
    if _names_api(value.version):
        w.u32(value.api)
    elif value.api:
        raise ValueError("version 1.0 of DiagnosisData is for API 0")
    w.u16(value.slot).u16(value.subslot).u16(value.channel).u16(int(value.properties)).u16(value.usi)
    for usi, data in emit_items(value.items):
        if usi != value.usi:
            raise ValueError(f"an item of USI 0x{usi:04X} in a block of USI 0x{value.usi:04X}")
        w.bytes(data)
    return emit_raw_block(RawBlock(BlockType.DIAGNOSIS_DATA, w.getvalue(), value.version))
