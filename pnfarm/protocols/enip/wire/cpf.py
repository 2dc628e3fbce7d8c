"""Common packet format: typed items in one list (CIP volume 2, chapter 2-6).

``ItemCount u16``, then for each item ``TypeId u16, Length u16`` and so many octets.  SendRRData and SendUnitData put an
interface handle and a timeout before the list; a datagram of a class 1 connection is the list alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from ipaddress import IPv4Address
from typing import Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.wire.identity import IdentityItem, ServiceItem
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "AF_INET",
    "ANY_ADDRESS",
    "CommonPacket",
    "ConnectedAddress",
    "ConnectedData",
    "Item",
    "ItemType",
    "NullAddress",
    "SequencedAddress",
    "SocketAddress",
    "UnconnectedData",
    "UnknownItem",
    "emit_common_packet",
    "emit_items",
    "emit_socket_address",
    "parse_common_packet",
    "parse_items",
    "parse_socket_address",
]


class ItemType(IntEnum):
    """Table 2-6.3."""

    NULL_ADDRESS = 0x0000
    IDENTITY = 0x000C
    CONNECTED_ADDRESS = 0x00A1
    CONNECTED_DATA = 0x00B1
    UNCONNECTED_DATA = 0x00B2
    SERVICES = 0x0100
    SOCKET_ADDRESS_O_TO_T = 0x8000
    SOCKET_ADDRESS_T_TO_O = 0x8001
    SEQUENCED_ADDRESS = 0x8002


AF_INET: Final = 2
ANY_ADDRESS: Final = IPv4Address(0)


@dataclass(frozen=True, slots=True)
class NullAddress:
    """No address: an unconnected message."""


@dataclass(frozen=True, slots=True)
class ConnectedAddress:
    """The connection of a class 3 message, by the id that its receiver knows."""

    connection_id: int


@dataclass(frozen=True, slots=True)
class SequencedAddress:
    """The connection of a class 0 or 1 datagram, and the datagram's number, 32 bits."""

    connection_id: int
    sequence: int


@dataclass(frozen=True, slots=True)
class ConnectedData:
    data: bytes


@dataclass(frozen=True, slots=True)
class UnconnectedData:
    data: bytes


@dataclass(frozen=True, slots=True)
class SocketAddress:
    """``sockaddr_in`` in network order (table 2-6.10); ``o_to_t`` says which direction's data it is for."""

    o_to_t: bool
    port: int
    address: IPv4Address = ANY_ADDRESS
    family: int = AF_INET
    zero: bytes = bytes(8)


@dataclass(frozen=True, slots=True)
class UnknownItem:
    """An item of another type; it may also build wrong items of known types."""

    type_id: int
    data: bytes = b""


Item = (
    NullAddress
    | ConnectedAddress
    | SequencedAddress
    | ConnectedData
    | UnconnectedData
    | SocketAddress
    | IdentityItem
    | ServiceItem
    | UnknownItem
)


@dataclass(frozen=True, slots=True)
class CommonPacket:
    """The data of SendRRData and SendUnitData; ``timeout`` in seconds, 0 in SendUnitData."""

    items: tuple[Item, ...] = field(default=())
    interface: int = 0
    timeout: int = 0


# Items


def parse_socket_address(data: bytes, o_to_t: bool = False) -> SocketAddress:
    """An item's octets.  Raises ``bad-length``."""
    if len(data) != 16:
        raise DecodeError("bad-length", f"a socket address has 16 octets, not {len(data)}")
    r = Reader(data)
    family, port, address, zero = r.u16(), r.u16(), IPv4Address(r.u32()), r.bytes(8)
    return SocketAddress(o_to_t, port, address, family, zero)


def emit_socket_address(value: SocketAddress) -> bytes:
    return Writer().u16(value.family).u16(value.port).u32(int(value.address)).bytes(value.zero).getvalue()


def _parse_item(type_id: int, data: bytes) -> Item:
    r = Reader(data)
    item: Item
    match type_id:
        case ItemType.NULL_ADDRESS:
            item = NullAddress()
        case ItemType.CONNECTED_ADDRESS:
            item = ConnectedAddress(r.u32le())
        case ItemType.SEQUENCED_ADDRESS:
            item = SequencedAddress(r.u32le(), r.u32le())
        case ItemType.CONNECTED_DATA:
            return ConnectedData(data)
        case ItemType.UNCONNECTED_DATA:
            return UnconnectedData(data)
        case ItemType.SOCKET_ADDRESS_O_TO_T | ItemType.SOCKET_ADDRESS_T_TO_O:
            return parse_socket_address(data, type_id == ItemType.SOCKET_ADDRESS_O_TO_T)
        case ItemType.IDENTITY:
            item = IdentityItem.parse(r)
        case ItemType.SERVICES:
            item = ServiceItem.parse(r)
        case _:
            return UnknownItem(type_id, data)
    r.expect_end()
    return item


def _emit_item(item: Item) -> tuple[int, bytes]:
    match item:
        case NullAddress():
            return ItemType.NULL_ADDRESS, b""
        case ConnectedAddress(connection_id):
            return ItemType.CONNECTED_ADDRESS, Writer().u32le(connection_id).getvalue()
        case SequencedAddress(connection_id, sequence):
            return ItemType.SEQUENCED_ADDRESS, Writer().u32le(connection_id).u32le(sequence).getvalue()
        case ConnectedData(data):
            return ItemType.CONNECTED_DATA, data
        case UnconnectedData(data):
            return ItemType.UNCONNECTED_DATA, data
        case SocketAddress(o_to_t=o_to_t):
            kind = ItemType.SOCKET_ADDRESS_O_TO_T if o_to_t else ItemType.SOCKET_ADDRESS_T_TO_O
            return kind, emit_socket_address(item)
        case IdentityItem():
            return ItemType.IDENTITY, item.emit()
        case ServiceItem():
            return ItemType.SERVICES, item.emit()
        case UnknownItem(type_id, data):
            return type_id, data


def parse_items(data: bytes) -> tuple[Item, ...]:
    """A list of items.  Raises ``short``, ``bad-length``, ``trailing``."""
    r = Reader(data)
    items = []
    for _ in range(r.u16le()):
        type_id = r.u16le()
        items.append(_parse_item(type_id, r.bytes(r.u16le())))
    r.expect_end()
    return tuple(items)


def emit_items(items: tuple[Item, ...]) -> bytes:
    w = Writer().u16le(len(items))
    for item in items:
        type_id, data = _emit_item(item)
        w.u16le(type_id).u16le(len(data)).bytes(data)
    return w.getvalue()


# SendRRData, SendUnitData


def parse_common_packet(data: bytes) -> CommonPacket:
    """Raises ``short``, ``bad-length``, ``trailing``."""
    r = Reader(data)
    interface, timeout = r.u32le(), r.u16le()
    return CommonPacket(parse_items(r.rest()), interface, timeout)


def emit_common_packet(value: CommonPacket) -> bytes:
    return Writer().u32le(value.interface).u16le(value.timeout).bytes(emit_items(value.items)).getvalue()
