"""An item of the common packet format, by its type (CIP volume 2, table 2-6.3)."""

from enum import IntEnum
from typing import Any, ClassVar

from pnfarm.wire.layout import Structure

__all__ = ["Item", "ItemType"]


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


class Item(Structure, little=True):
    """The octets of an item after type and length; ``types``: those that have this layout."""

    TYPES: ClassVar[tuple[int, ...]] = ()
    KINDS: ClassVar[dict[int, type["Item"]]] = {}

    def __init_subclass__(cls, *, types: tuple[int, ...] = (), **more: Any) -> None:
        super().__init_subclass__(**more)
        cls.TYPES = types
        cls.KINDS.update(dict.fromkeys(types, cls))

    @property
    def item_type(self) -> int:
        return self.TYPES[0]
