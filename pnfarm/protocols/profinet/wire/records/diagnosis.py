"""Diagnosis on the wire: the items that alarms and records share, and the DiagnosisData block
(IEC 61158-6-10, coding of ChannelProperties, UserStructureIdentifier and DiagnosisData).

An item begins with its UserStructureIdentifier (USI) in an alarm; in DiagnosisData the USI stands once, before all
items of its kind.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, ClassVar

from pnfarm.protocols.profinet.wire.block import VERSION_1_0, VERSION_1_1, Block, BlockType
from pnfarm.wire.code import Code
from pnfarm.wire.layout import Codec, Fixed, Outside, Pad, Rest, Structure, UInt16, UInt32, When
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "CHANNEL_USIS",
    "MANUFACTURER_LAST",
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
    "emit_items",
    "parse_items",
]

#: ChannelNumber: the submodule as such, not one of its channels 0 to 0x7FFF.
WHOLE_SUBMODULE = 0x8000


class Usi(Code):
    """UserStructureIdentifier; up to :data:`MANUFACTURER_LAST` they are the manufacturer's."""

    CHANNEL = 0x8000, "channel diagnosis"
    MULTIPLE = 0x8001
    EXT_CHANNEL = 0x8002, "ext channel diagnosis"
    QUALIFIED_CHANNEL = 0x8003, "qualified channel diagnosis"
    MAINTENANCE = 0x8100
    UPLOAD_AND_RETRIEVAL = 0x8200
    I_PARAMETER = 0x8201
    RS_LOW_WATERMARK = 0x8300
    RS_TIMEOUT = 0x8301
    RS_OVERFLOW = 0x8302
    RS_EVENT = 0x8303
    ENERGY_SAVING_STATUS = 0x8310
    PROCESS_ALARM_REASON = 0x8320


MANUFACTURER_LAST = 0x7FFF
#: The codings of channels.
CHANNEL_USIS = frozenset({Usi.CHANNEL, Usi.EXT_CHANNEL, Usi.QUALIFIED_CHANNEL})


class Maintenance(Code):
    """ChannelProperties.Maintenance, bits 9 and 10: the severity; a qualified item has it in its qualifier."""

    FAULT = 0
    REQUIRED = 1, "maintenance required"
    DEMANDED = 2, "maintenance demanded"
    QUALIFIED = 3


class ChannelSpecifier(Code):
    """ChannelProperties.Specifier, bits 11 and 12."""

    ALL_DISAPPEAR = 0, "all gone"
    APPEARS = 1
    DISAPPEARS = 2
    DISAPPEARS_OTHERS_REMAIN = 3, "disappears, others remain"


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
    def from_int(cls, value: int) -> "ChannelProperties":
        return cls(value & 0xFF, bool(value >> 8 & 1), value >> 9 & 3, value >> 11 & 3, value >> 13 & 7)

    def __int__(self) -> int:
        return (
            self.type & 0xFF
            | self.accumulative << 8
            | (self.maintenance & 3) << 9
            | (self.specifier & 3) << 11
            | (self.direction & 7) << 13
        )


_Properties = Annotated[ChannelProperties, Fixed("H", ChannelProperties.from_int, int)]


class ChannelDiagnosis(Structure):
    """USI 0x8000."""

    usi: ClassVar[int] = Usi.CHANNEL
    channel: UInt16
    properties: _Properties
    error_type: UInt16


class ExtChannelDiagnosis(Structure):
    """USI 0x8002."""

    usi: ClassVar[int] = Usi.EXT_CHANNEL
    channel: UInt16
    properties: _Properties
    error_type: UInt16
    ext_error_type: UInt16
    ext_add_value: UInt32


class QualifiedChannelDiagnosis(Structure):
    """USI 0x8003; ``qualifier`` holds bits of :class:`Qualifier`."""

    usi: ClassVar[int] = Usi.QUALIFIED_CHANNEL
    channel: UInt16
    properties: _Properties
    error_type: UInt16
    ext_error_type: UInt16
    ext_add_value: UInt32
    qualifier: UInt32


class MaintenanceItem(Block, types=BlockType.MAINTENANCE_ITEM, inner=True):
    """USI 0x8100: block 0x0F00 with the submodule's MaintenanceStatus; precedes the items of an alarm."""

    usi: ClassVar[int] = Usi.MAINTENANCE
    status: Annotated[UInt32, Pad(2)]
    version: Outside[int] = VERSION_1_0


class UserItem(Structure):
    """An item of a manufacturer's USI, or of one without a codec here: octets up to the end."""

    usi: Outside[int]
    data: Rest


DiagnosisItem = ChannelDiagnosis | ExtChannelDiagnosis | QualifiedChannelDiagnosis | MaintenanceItem | UserItem
_KINDS: dict[int, type[DiagnosisItem]] = {
    kind.usi: kind for kind in (ChannelDiagnosis, ExtChannelDiagnosis, QualifiedChannelDiagnosis, MaintenanceItem)
}


def _read_item(r: Reader, usi: int) -> DiagnosisItem:
    return _KINDS[usi].read(r) if usi in _KINDS else UserItem(usi, r.rest())


def parse_items(data: bytes, usi: int = Usi.CHANNEL) -> tuple[DiagnosisItem, ...]:
    """All items of one USI; at least one.  Raises :class:`DecodeError` where the last one is cut off."""
    r = Reader(data)
    items = [_read_item(r, usi)]
    while r.remaining:
        items.append(_read_item(r, usi))
    return tuple(items)


def emit_items(items: Iterable[DiagnosisItem]) -> list[tuple[int, bytes]]:
    """Each item as an alarm carries it: its USI and what follows the USI."""
    return [(item.usi, item.emit()) for item in items]


class _Items(Codec):
    def read(self, r: Reader, values: Mapping[str, Any]) -> tuple[DiagnosisItem, ...]:
        return parse_items(r.rest(), values["usi"])

    def write(self, w: Writer, value: Iterable[DiagnosisItem]) -> None:
        for item in value:
            item.write(w)


class DiagnosisData(Block, types=BlockType.DIAGNOSIS_DATA):
    """0x0010: items of one submodule and of one USI.  Version 1.0 names no API, which is then 0.

    ``channel`` and ``properties`` sum up channel-coded items (the whole submodule); for a manufacturer's item, which
    names no channel of its own, they say where it is.
    """

    api: Annotated[UInt32, When(lambda block: block["version"] & 0xFF != VERSION_1_0 & 0xFF, 0)]
    slot: UInt16
    subslot: UInt16
    channel: UInt16
    properties: _Properties
    usi: UInt16
    items: Annotated[tuple[DiagnosisItem, ...], _Items()]
    version: Outside[int] = VERSION_1_1

    def write_body(self, w: Writer) -> None:
        """Raises :class:`ValueError` for version 1.0 with another API than 0, and for items of another USI."""
        if self.api and self.version & 0xFF == VERSION_1_0 & 0xFF:
            raise ValueError("version 1.0 of DiagnosisData is for API 0")
        for item in self.items:
            if item.usi != self.usi:
                raise ValueError(f"an item of USI 0x{item.usi:04X} in a block of USI 0x{self.usi:04X}")
        super().write_body(w)
