"""The items with which a device answers ListIdentity and ListServices (CIP volume 2, tables 2-4.4 and 2-4.3)."""

from ipaddress import IPv4Address
from operator import attrgetter
from typing import Annotated, Final

from pnfarm.protocols.enip.wire.item import Item, ItemType
from pnfarm.wire.layout import Fixed, Octets8, Pad, UInt8, UInt16, UInt32, octets
from pnfarm.wire.octets import Writer

__all__ = ["CIP_OVER_TCP", "CIP_OVER_UDP", "COMMUNICATIONS", "IdentityItem", "ServiceItem"]

#: Capability flags of the service Communications: explicit messages over TCP, class 0 and 1 over UDP.
CIP_OVER_TCP: Final = 0x0020
CIP_OVER_UDP: Final = 0x0100
COMMUNICATIONS: Final = b"Communications\0\0"

#: Parts of a socket address are in network order.
_NETWORK_U16 = Annotated[
    int, Fixed("2s", lambda octets: int.from_bytes(octets, "big"), lambda value: Writer().u16(value).getvalue())
]


class IdentityItem(
    Item,
    types=(ItemType.IDENTITY,),
    wire="version family port address vendor_id device_type product_code revision status serial name state",
):
    """Who a device is: its socket address, and attributes 1 to 8 of its Identity object.

    ``revision`` is major and minor, ``status`` the 16 bits of attribute 5, ``state`` attribute 8 (255: not there).
    ``name`` are octets, at most 255 (ISO 8859-1).
    """

    address: Annotated[IPv4Address, Fixed("4s", IPv4Address, attrgetter("packed"))]
    vendor_id: Annotated[UInt16, Pad(8)]
    device_type: UInt16
    product_code: UInt16
    revision: tuple[UInt8, UInt8]
    status: UInt16
    serial: UInt32
    name: Octets8
    state: UInt8
    port: _NETWORK_U16 = 44818
    version: UInt16 = 1
    family: _NETWORK_U16 = 2


class ServiceItem(Item, types=(ItemType.SERVICES,), wire="version capabilities name"):
    """A service that the device offers over the encapsulation; ``name`` has 16 octets, padded with zeros."""

    capabilities: UInt16 = CIP_OVER_TCP | CIP_OVER_UDP
    version: UInt16 = 1
    name: Annotated[bytes, octets(16)] = COMMUNICATIONS
