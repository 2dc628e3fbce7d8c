"""Alarm blocks: AlarmNotification and AlarmAck, the VarPart of a DATA-RTA-PDU (IEC 61158-6-10, RTA-SDU).

An AlarmNotification says what happened on one submodule: alarm type, place, identification, AlarmSpecifier and any
number of items.  An item is a UserStructureIdentifier and octets whose length follows from it; the octets are
not decoded here.  An AlarmAck repeats type, place and specifier and adds a PNIOStatus.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, Self

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import VERSION_1_0, Block, RawBlock
from pnfarm.protocols.profinet.wire.records.diagnosis import Usi
from pnfarm.protocols.profinet.wire.rpc.pdu import OK, PnioStatus
from pnfarm.wire.code import Code, words_of
from pnfarm.wire.layout import Codec, Outside, UInt16, UInt32
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "SEQUENCE_MASK",
    "AlarmAck",
    "AlarmItem",
    "AlarmNotification",
    "AlarmSpecifier",
    "AlarmType",
    "acknowledge",
    "alarm_type_text",
    "describe_alarm",
    "describe_item",
    "describe_place",
    "emit_alarm_items",
    "parse_alarm",
    "parse_alarm_items",
]

# BlockType
ALARM_NOTIFICATION_HIGH = 0x0001
ALARM_NOTIFICATION_LOW = 0x0002
ALARM_ACK_HIGH = 0x8001
ALARM_ACK_LOW = 0x8002


class AlarmType(Code):
    """IEC 61158-6-10, coding of the field AlarmType.

    0x0020 to 0x007F are the manufacturer's, 0x0080 to 0x00FF the profiles'; the rest is reserved.
    """

    DIAGNOSIS = 0x0001, "diagnosis appears"
    PROCESS = 0x0002, "process alarm"
    PULL = 0x0003, "submodule pulled"
    PLUG = 0x0004, "submodule plugged"
    STATUS = 0x0005, "status alarm"
    UPDATE = 0x0006, "update alarm"
    MEDIA_REDUNDANCY = 0x0007, "media redundancy alarm"
    CONTROLLED_BY_SUPERVISOR = 0x0008, "controlled by a supervisor"
    RELEASED = 0x0009, "released by its former owner"
    PLUG_WRONG_SUBMODULE = 0x000A, "wrong submodule plugged"
    RETURN_OF_SUBMODULE = 0x000B, "submodule returns"
    DIAGNOSIS_DISAPPEARS = 0x000C, "diagnosis disappears"
    MULTICAST_COMMUNICATION_MISMATCH = 0x000D, "multicast communication mismatch"
    PORT_DATA_CHANGE = 0x000E, "port data change"
    SYNC_DATA_CHANGED = 0x000F, "sync data changed"
    ISOCHRONOUS_MODE_PROBLEM = 0x0010, "isochronous mode problem"
    NETWORK_COMPONENT_PROBLEM = 0x0011, "network component problem"
    TIME_DATA_CHANGED = 0x0012, "time data changed"
    DYNAMIC_FRAME_PACKING_PROBLEM = 0x0013, "dynamic frame packing problem"
    MRPD_PROBLEM = 0x0014, "media redundancy with planned duplication problem"
    MULTIPLE_INTERFACE_MISMATCH = 0x0016, "multiple interface mismatch"
    UPLOAD_AND_RETRIEVAL = 0x001E, "upload and retrieval"
    PULL_MODULE = 0x001F, "module pulled"


_MANUFACTURER_TYPES = range(0x0020, 0x0080)
_PROFILE_TYPES = range(0x0080, 0x0100)

#: AlarmSpecifier.SequenceNumber, bits 0 to 10.
SEQUENCE_MASK = 0x07FF


class AlarmSpecifier(IntEnum):
    """The bits above the sequence number; bit 14 is reserved."""

    CHANNEL_DIAGNOSIS = 0x0800
    MANUFACTURER_DIAGNOSIS = 0x1000
    SUBMODULE_DIAGNOSIS_STATE = 0x2000
    AR_DIAGNOSIS_STATE = 0x8000


#: Octets of one entry after the identifier; every other item fills the rest of its block.
_ENTRY_SIZE: dict[int, int] = {
    Usi.CHANNEL: 6,
    Usi.EXT_CHANNEL: 12,
    Usi.QUALIFIED_CHANNEL: 16,
    Usi.MAINTENANCE: 12,
}


@dataclass(frozen=True, slots=True)
class AlarmItem:
    """``data`` follows the UserStructureIdentifier."""

    usi: int
    data: bytes


# Items


def parse_alarm_items(data: bytes) -> tuple[AlarmItem, ...]:
    """The items of one block.  Raises :class:`DecodeError` (``short``).

    An item with entries of fixed size holds one entry or, as the last item, all that follow; the wire does not say
    which.  One entry each is assumed where that fits the length.
    """
    one_each = _fits_one_entry_each(data)
    r = Reader(data)
    items = []
    while r.remaining:
        usi = r.u16()
        size = _ENTRY_SIZE.get(usi)
        last = size is None or (not one_each and usi != Usi.MAINTENANCE and r.remaining % size == 0)
        items.append(AlarmItem(usi, r.bytes(r.remaining if size is None or last else size)))
    return tuple(items)


def _fits_one_entry_each(data: bytes) -> bool:
    """Whether ``data`` is a series of items with one entry each, with an item of another kind at most at its end."""
    position = 0
    while position + 2 <= len(data):
        usi = int.from_bytes(data[position : position + 2], "big")
        size = _ENTRY_SIZE.get(usi)
        if size is None:
            return Usi.find(usi) is not None
        position += 2 + size
    return position == len(data)


def emit_alarm_items(items: tuple[AlarmItem, ...]) -> bytes:
    w = Writer()
    for item in items:
        w.u16(item.usi).bytes(item.data)
    return w.getvalue()


class _Items(Codec):
    def read(self, r: Reader, _values: Mapping[str, Any]) -> tuple[AlarmItem, ...]:
        return parse_alarm_items(r.rest())

    def write(self, w: Writer, value: tuple[AlarmItem, ...]) -> None:
        w.bytes(emit_alarm_items(value))


# Blocks


class _Alarm(Block):
    """Either block has a type for each priority, the high one's first."""

    alarm_type: UInt16
    api: UInt32
    slot: UInt16
    subslot: UInt16

    @property
    def sequence_number(self) -> int:
        specifier: int = vars(self)["specifier"]
        return specifier & SEQUENCE_MASK

    @property
    def kind(self) -> int:
        return self.TYPES[not vars(self)["high"]]

    @classmethod
    def read_body(cls, r: Reader, block: RawBlock) -> Self:
        return super(Block, cls).read(r, high=block.block_type == cls.TYPES[0], version=block.version)


class AlarmNotification(_Alarm, types=(ALARM_NOTIFICATION_HIGH, ALARM_NOTIFICATION_LOW), inner=True):
    """BlockType 0x0001 (``high``) or 0x0002.  ``specifier`` is the AlarmSpecifier with its sequence number."""

    module_ident: UInt32 = 0
    submodule_ident: UInt32 = 0
    specifier: UInt16 = 0
    items: Annotated[tuple[AlarmItem, ...], _Items()] = ()
    high: Outside[bool] = False
    version: Outside[int] = VERSION_1_0


class AlarmAck(_Alarm, types=(ALARM_ACK_HIGH, ALARM_ACK_LOW), inner=True):
    """BlockType 0x8001 (``high``) or 0x8002."""

    specifier: UInt16 = 0
    status: PnioStatus = OK
    high: Outside[bool] = False
    version: Outside[int] = VERSION_1_0

    def answers(self, alarm: AlarmNotification) -> bool:
        """It repeats the alarm's type, place and sequence number."""
        return (
            self.alarm_type == alarm.alarm_type
            and (self.api, self.slot, self.subslot) == (alarm.api, alarm.slot, alarm.subslot)
            and self.sequence_number == alarm.sequence_number
        )


def acknowledge(alarm: AlarmNotification, status: PnioStatus = OK) -> AlarmAck:
    """The AlarmAck that answers ``alarm``."""
    return AlarmAck(alarm.alarm_type, alarm.api, alarm.slot, alarm.subslot, alarm.specifier, status, alarm.high)


def parse_alarm(data: bytes) -> AlarmNotification | AlarmAck:
    """The VarPart of a DATA-RTA-PDU: one block.  Raises :class:`DecodeError`, ``bad-type`` for every other block."""
    r = Reader(data)
    block = RawBlock.read(r)
    r.expect_end()
    if block.block_type in AlarmNotification.TYPES:
        return AlarmNotification.of(block)
    if block.block_type in AlarmAck.TYPES:
        return AlarmAck.of(block)
    raise DecodeError("bad-type", f"block 0x{block.block_type:04X} is not an alarm")


# Texts


def alarm_type_text(alarm_type: int) -> str:
    """E.g. ``diagnosis appears``; unknown ones by their number."""
    if known := AlarmType.text_of(alarm_type):
        return known
    if alarm_type in _MANUFACTURER_TYPES:
        return f"manufacturer's alarm 0x{alarm_type:04X}"
    if alarm_type in _PROFILE_TYPES:
        return f"profile's alarm 0x{alarm_type:04X}"
    return f"alarm of reserved type 0x{alarm_type:04X}"


def describe_item(item: AlarmItem) -> str:
    """E.g. ``ext channel diagnosis 0004 2801 0001 0000 0000 0000``."""
    octets = item.data.hex(" ", 2).upper()
    return f"{words_of(Usi, item.usi, f'USI 0x{item.usi:04X}')} {octets}".rstrip()


def describe_place(alarm: AlarmNotification | AlarmAck) -> str:
    """What happened and where, e.g. ``diagnosis appears on slot 1 subslot 0x0002`` or ``module pulled on slot 1``."""
    # a receiver that does not support the alarm for whole modules gets a submodule's, for subslot 0
    if not alarm.subslot and alarm.alarm_type in {AlarmType.PULL, AlarmType.PULL_MODULE}:
        return f"{alarm_type_text(AlarmType.PULL_MODULE)} on slot {alarm.slot}"
    return f"{alarm_type_text(alarm.alarm_type)} on slot {alarm.slot} subslot 0x{alarm.subslot:04X}"


def describe_alarm(alarm: AlarmNotification, item_text: Callable[[AlarmItem], str] = describe_item) -> str:
    """One line, e.g. ``diagnosis appears on slot 1 subslot 0x0002: channel diagnosis 8000 0800 0010``.

    ``item_text`` gives the text of an item.
    """
    return describe_place(alarm) + (": " + "; ".join(item_text(item) for item in alarm.items) if alarm.items else "")
