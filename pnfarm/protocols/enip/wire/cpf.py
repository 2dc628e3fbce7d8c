"""Common packet format: typed items in one list (CIP volume 2, chapter 2-6).

``ItemCount u16``, then for each item ``TypeId u16, Length u16`` and so many octets.  SendRRData and SendUnitData put an
interface handle and a timeout before the list; a datagram of a class 1 connection is the list alone.
"""

from collections.abc import Mapping
from ipaddress import IPv4Address
from typing import Annotated, Any, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.wire.identity import IdentityItem, ServiceItem
from pnfarm.protocols.enip.wire.item import Item, ItemType
from pnfarm.wire.layout import Codec, Ip, Outside, Rest, Structure, UInt16, UInt32, octets
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "AF_INET",
    "CommonPacket",
    "ConnectedAddress",
    "ConnectedData",
    "IdentityItem",
    "Item",
    "ItemType",
    "NullAddress",
    "SequencedAddress",
    "ServiceItem",
    "SocketAddress",
    "UnconnectedData",
    "UnknownItem",
    "emit_items",
    "parse_items",
]

AF_INET: Final = 2
ANY_ADDRESS: Final = IPv4Address(0)


class NullAddress(Item, types=(ItemType.NULL_ADDRESS,)):
    """No address: an unconnected message."""


class ConnectedAddress(Item, types=(ItemType.CONNECTED_ADDRESS,)):
    """The connection of a class 3 message, by the id that its receiver knows."""

    connection_id: UInt32


class SequencedAddress(Item, types=(ItemType.SEQUENCED_ADDRESS,)):
    """The connection of a class 0 or 1 datagram, and the datagram's number, 32 bits."""

    connection_id: UInt32
    sequence: UInt32


class ConnectedData(Item, types=(ItemType.CONNECTED_DATA,)):
    data: Rest


class UnconnectedData(Item, types=(ItemType.UNCONNECTED_DATA,)):
    data: Rest


class SocketAddress(
    Item,
    types=(ItemType.SOCKET_ADDRESS_T_TO_O, ItemType.SOCKET_ADDRESS_O_TO_T),
    little=False,
    wire="family port address zero",
):
    """``sockaddr_in`` in network order (table 2-6.10); ``o_to_t`` says which direction's data it is for."""

    o_to_t: Outside[bool]
    port: UInt16
    address: Ip = ANY_ADDRESS
    family: UInt16 = AF_INET
    zero: Annotated[bytes, octets(8)] = bytes(8)

    @property
    def item_type(self) -> int:
        return self.TYPES[self.o_to_t]


class UnknownItem(Item):
    """An item of another type; it may also build wrong items of known types."""

    type_id: Outside[int]
    data: Rest = b""

    @property
    def item_type(self) -> int:
        return self.type_id


def _parse_item(type_id: int, data: bytes) -> Item:
    kind = Item.KINDS.get(type_id, UnknownItem)
    if kind is SocketAddress:
        if len(data) != 16:
            raise DecodeError("bad-length", f"a socket address has 16 octets, not {len(data)}")
        return kind.parse(data, o_to_t=type_id == ItemType.SOCKET_ADDRESS_O_TO_T)
    return kind.parse(data) if kind is not UnknownItem else UnknownItem(type_id, data)


class _Items(Codec):
    """The list."""

    def read(self, r: Reader, _values: Mapping[str, Any]) -> tuple[Item, ...]:
        return tuple(_parse_item(r.u16(), r.bytes(r.u16())) for _ in range(r.u16()))

    def write(self, w: Writer, value: tuple[Item, ...]) -> None:
        w.u16(len(value))
        for item in value:
            data = item.emit()
            w.u16(item.item_type).u16(len(data)).bytes(data)


class _ItemList(Structure, little=True):
    items: Annotated[tuple[Item, ...], _Items()]


def parse_items(data: bytes) -> tuple[Item, ...]:
    """A list of items.  Raises ``short``, ``bad-length``, ``trailing``."""
    return _ItemList.parse(data).items


def emit_items(items: tuple[Item, ...]) -> bytes:
    return _ItemList(items).emit()


class CommonPacket(Structure, little=True, wire="interface timeout items"):
    """The data of SendRRData and SendUnitData; ``timeout`` in seconds, 0 in SendUnitData."""

    items: Annotated[tuple[Item, ...], _Items()] = ()
    interface: UInt32 = 0
    timeout: UInt16 = 0
