"""Alarm blocks: AlarmNotification and AlarmAck, the VarPart of a DATA-RTA-PDU (IEC 61158-6-10, RTA-SDU).

An AlarmNotification says what happened on one submodule: alarm type, place, identification, AlarmSpecifier and any
number of items.  An item is a UserStructureIdentifier and octets whose length follows from it; the octets are
not decoded here.  An AlarmAck repeats type, place and specifier and adds a PNIOStatus.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import VERSION_1_0, RawBlock, check_type, emit_raw_block, parse_raw_block
from pnfarm.protocols.profinet.wire.rpc.pdu import OK, PnioStatus
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = [
    "ALARM_ACK_HIGH",
    "ALARM_ACK_LOW",
    "ALARM_NOTIFICATION_HIGH",
    "ALARM_NOTIFICATION_LOW",
    "SEQUENCE_MASK",
    "AlarmAck",
    "AlarmItem",
    "AlarmNotification",
    "AlarmSpecifier",
    "AlarmType",
    "Usi",
    "acknowledge",
    "alarm_type_text",
    "describe_alarm",
    "describe_item",
    "describe_place",
    "emit_alarm",
    "emit_alarm_ack",
    "emit_alarm_items",
    "emit_alarm_notification",
    "parse_alarm",
    "parse_alarm_ack",
    "parse_alarm_items",
    "parse_alarm_notification",
]

# BlockType
ALARM_NOTIFICATION_HIGH = 0x0001
ALARM_NOTIFICATION_LOW = 0x0002
ALARM_ACK_HIGH = 0x8001
ALARM_ACK_LOW = 0x8002


class AlarmType(IntEnum):
    """IEC 61158-6-10, coding of the field AlarmType.

    0x0020 to 0x007F are the manufacturer's, 0x0080 to 0x00FF the profiles'; the rest is reserved.
    """

    DIAGNOSIS = 0x0001
    PROCESS = 0x0002
    PULL = 0x0003
    PLUG = 0x0004
    STATUS = 0x0005
    UPDATE = 0x0006
    MEDIA_REDUNDANCY = 0x0007
    CONTROLLED_BY_SUPERVISOR = 0x0008
    RELEASED = 0x0009
    PLUG_WRONG_SUBMODULE = 0x000A
    RETURN_OF_SUBMODULE = 0x000B
    DIAGNOSIS_DISAPPEARS = 0x000C
    MULTICAST_COMMUNICATION_MISMATCH = 0x000D
    PORT_DATA_CHANGE = 0x000E
    SYNC_DATA_CHANGED = 0x000F
    ISOCHRONOUS_MODE_PROBLEM = 0x0010
    NETWORK_COMPONENT_PROBLEM = 0x0011
    TIME_DATA_CHANGED = 0x0012
    DYNAMIC_FRAME_PACKING_PROBLEM = 0x0013
    MRPD_PROBLEM = 0x0014
    MULTIPLE_INTERFACE_MISMATCH = 0x0016
    UPLOAD_AND_RETRIEVAL = 0x001E
    PULL_MODULE = 0x001F


_TYPE_TEXTS: dict[int, str] = {
    AlarmType.DIAGNOSIS: "diagnosis appears",
    AlarmType.PROCESS: "process alarm",
    AlarmType.PULL: "submodule pulled",
    AlarmType.PLUG: "submodule plugged",
    AlarmType.STATUS: "status alarm",
    AlarmType.UPDATE: "update alarm",
    AlarmType.MEDIA_REDUNDANCY: "media redundancy alarm",
    AlarmType.CONTROLLED_BY_SUPERVISOR: "controlled by a supervisor",
    AlarmType.RELEASED: "released by its former owner",
    AlarmType.PLUG_WRONG_SUBMODULE: "wrong submodule plugged",
    AlarmType.RETURN_OF_SUBMODULE: "submodule returns",
    AlarmType.DIAGNOSIS_DISAPPEARS: "diagnosis disappears",
    AlarmType.MULTICAST_COMMUNICATION_MISMATCH: "multicast communication mismatch",
    AlarmType.PORT_DATA_CHANGE: "port data change",
    AlarmType.SYNC_DATA_CHANGED: "sync data changed",
    AlarmType.ISOCHRONOUS_MODE_PROBLEM: "isochronous mode problem",
    AlarmType.NETWORK_COMPONENT_PROBLEM: "network component problem",
    AlarmType.TIME_DATA_CHANGED: "time data changed",
    AlarmType.DYNAMIC_FRAME_PACKING_PROBLEM: "dynamic frame packing problem",
    AlarmType.MRPD_PROBLEM: "media redundancy with planned duplication problem",
    AlarmType.MULTIPLE_INTERFACE_MISMATCH: "multiple interface mismatch",
    AlarmType.UPLOAD_AND_RETRIEVAL: "upload and retrieval",
    AlarmType.PULL_MODULE: "module pulled",
}
_MANUFACTURER_TYPES = range(0x0020, 0x0080)
_PROFILE_TYPES = range(0x0080, 0x0100)

#: AlarmSpecifier.SequenceNumber, bits 0 to 10.
SEQUENCE_MASK = 0x07FF


class AlarmSpecifier(IntFlag):
    """The bits above the sequence number; bit 14 is reserved."""

    CHANNEL_DIAGNOSIS = 0x0800
    MANUFACTURER_DIAGNOSIS = 0x1000
    SUBMODULE_DIAGNOSIS_STATE = 0x2000
    AR_DIAGNOSIS_STATE = 0x8000


class Usi(IntEnum):
    """UserStructureIdentifier; up to 0x7FFF they are the manufacturer's."""

    CHANNEL_DIAGNOSIS = 0x8000
    MULTIPLE = 0x8001
    EXT_CHANNEL_DIAGNOSIS = 0x8002
    QUALIFIED_CHANNEL_DIAGNOSIS = 0x8003
    MAINTENANCE = 0x8100
    UPLOAD_AND_RETRIEVAL = 0x8200
    I_PARAMETER = 0x8201
    RS_LOW_WATERMARK = 0x8300
    RS_TIMEOUT = 0x8301
    RS_OVERFLOW = 0x8302
    RS_EVENT = 0x8303
    ENERGY_SAVING_STATUS = 0x8310
    PROCESS_ALARM_REASON = 0x8320


_KNOWN_USI = frozenset(int(usi) for usi in Usi)

#: Octets of one entry behind the identifier; every other item fills the rest of its block.
_ENTRY_SIZE: dict[int, int] = {
    Usi.CHANNEL_DIAGNOSIS: 6,
    Usi.EXT_CHANNEL_DIAGNOSIS: 12,
    Usi.QUALIFIED_CHANNEL_DIAGNOSIS: 16,
    Usi.MAINTENANCE: 12,
}


@dataclass(frozen=True, slots=True)
class AlarmItem:
    """``data`` follows the UserStructureIdentifier."""

    usi: int
    data: bytes


@dataclass(frozen=True, slots=True)
class AlarmNotification:
    """BlockType 0x0001 (``high``) or 0x0002.  ``specifier`` is the AlarmSpecifier with its sequence number."""

    alarm_type: int
    api: int
    slot: int
    subslot: int
    module_ident: int = 0
    submodule_ident: int = 0
    specifier: int = 0
    items: tuple[AlarmItem, ...] = ()
    high: bool = False
    version: int = VERSION_1_0

    @property
    def sequence_number(self) -> int:
        return self.specifier & SEQUENCE_MASK

    @property
    def flags(self) -> AlarmSpecifier:
        """The named bits of the specifier."""
        return AlarmSpecifier(self.specifier & 0xB800)


@dataclass(frozen=True, slots=True)
class AlarmAck:
    """BlockType 0x8001 (``high``) or 0x8002."""

    alarm_type: int
    api: int
    slot: int
    subslot: int
    specifier: int = 0
    status: PnioStatus = OK
    high: bool = False
    version: int = VERSION_1_0

    @property
    def sequence_number(self) -> int:
        return self.specifier & SEQUENCE_MASK

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
            return usi in _KNOWN_USI
        position += 2 + size
    return position == len(data)


def emit_alarm_items(items: tuple[AlarmItem, ...]) -> bytes:
    w = Writer()
    for item in items:
        w.u16(item.usi).bytes(item.data)
    return w.getvalue()


# Blocks


def parse_alarm_notification(block: RawBlock) -> AlarmNotification:
    r = check_type(block, ALARM_NOTIFICATION_HIGH, ALARM_NOTIFICATION_LOW)
    return AlarmNotification(
        r.u16(),
        r.u32(),
        r.u16(),
        r.u16(),
        r.u32(),
        r.u32(),
        r.u16(),
        parse_alarm_items(r.rest()),
        block.block_type == ALARM_NOTIFICATION_HIGH,
        block.version,
    )


def emit_alarm_notification(value: AlarmNotification) -> bytes:
    w = Writer().u16(value.alarm_type).u32(value.api).u16(value.slot).u16(value.subslot)
    w.u32(value.module_ident).u32(value.submodule_ident).u16(value.specifier).bytes(emit_alarm_items(value.items))
    block_type = ALARM_NOTIFICATION_HIGH if value.high else ALARM_NOTIFICATION_LOW
    return emit_raw_block(RawBlock(block_type, w.getvalue(), value.version))


def parse_alarm_ack(block: RawBlock) -> AlarmAck:
    r = check_type(block, ALARM_ACK_HIGH, ALARM_ACK_LOW)
    value = AlarmAck(
        r.u16(),
        r.u32(),
        r.u16(),
        r.u16(),
        r.u16(),
        PnioStatus.from_int(r.u32()),
        block.block_type == ALARM_ACK_HIGH,
        block.version,
    )
    r.expect_end()
    return value


def emit_alarm_ack(value: AlarmAck) -> bytes:
    w = Writer().u16(value.alarm_type).u32(value.api).u16(value.slot).u16(value.subslot).u16(value.specifier)
    w.u32(int(value.status))
    return emit_raw_block(RawBlock(ALARM_ACK_HIGH if value.high else ALARM_ACK_LOW, w.getvalue(), value.version))


def parse_alarm(data: bytes) -> AlarmNotification | AlarmAck:
    """The VarPart of a DATA-RTA-PDU: one block.  Raises :class:`DecodeError`, ``bad-type`` for every other block."""
    r = Reader(data)
    block = parse_raw_block(r)
    r.expect_end()
    if block.block_type in {ALARM_NOTIFICATION_HIGH, ALARM_NOTIFICATION_LOW}:
        return parse_alarm_notification(block)
    if block.block_type in {ALARM_ACK_HIGH, ALARM_ACK_LOW}:
        return parse_alarm_ack(block)
    raise DecodeError("bad-type", f"block 0x{block.block_type:04X} is not an alarm")


def emit_alarm(value: AlarmNotification | AlarmAck) -> bytes:
    """The VarPart of a DATA-RTA-PDU."""
    return emit_alarm_ack(value) if isinstance(value, AlarmAck) else emit_alarm_notification(value)


# Texts


def alarm_type_text(alarm_type: int) -> str:
    """E.g. ``diagnosis appears``; unknown ones by their number."""
    known = _TYPE_TEXTS.get(alarm_type)
    if known is not None:
        return known
    if alarm_type in _MANUFACTURER_TYPES:
        return f"manufacturer's alarm 0x{alarm_type:04X}"
    if alarm_type in _PROFILE_TYPES:
        return f"profile's alarm 0x{alarm_type:04X}"
    return f"alarm of reserved type 0x{alarm_type:04X}"


def describe_item(item: AlarmItem) -> str:
    """E.g. ``ext channel diagnosis 0004 2801 0001 0000 0000 0000``."""
    octets = item.data.hex(" ", 2).upper()
    if item.usi in _KNOWN_USI:
        return f"{Usi(item.usi).name.lower().replace('_', ' ')} {octets}".rstrip()
    return f"USI 0x{item.usi:04X} {octets}".rstrip()


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
