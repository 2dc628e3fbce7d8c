"""Names of CIP's classes, services and attributes (CIP volume 1, chapter 5A and appendix A; volume 2, chapter 5).

Those of a drive's application objects come from its model.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.drives.profiles.cip.part import ATTRIBUTE_SIZES
from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.data_types import BOOL, DWORD, SHORT_STRING, STRING, UDINT, UINT, USINT, WORD, CipType
from pnfarm.protocols.enip.wire.epath import (
    DataSegment,
    ElectronicKey,
    Logical,
    LogicalSegment,
    NetworkSegment,
    PortSegment,
    Segment,
    SymbolSegment,
    parse_epath,
)

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model

__all__ = ["Place", "octets_text", "path_text", "place_of", "place_text", "service_name", "value_text"]

CONNECTION_MANAGER: Final = 0x06
ETHERNET_LINK: Final = 0xF6
PARAMETER: Final = 0x0F
_VALUE: Final = 1
_CLASSES: Final = {
    0x01: "Identity", 0x02: "Message Router", 0x04: "Assembly", 0x05: "Connection", 0x06: "Connection Manager",
    0x0F: "Parameter", 0x10: "Parameter Group", 0x23: "Position Sensor", 0x24: "Position Controller Supervisor",
    0x25: "Position Controller", 0x37: "File", 0x43: "Time Sync", 0x47: "Device Level Ring", 0x48: "QoS",
    0xF4: "Port", 0xF5: "TCP/IP Interface", 0xF6: "Ethernet Link",
}  # fmt: skip
_ATTRIBUTES: Final[dict[tuple[int, int], tuple[str, CipType | None]]] = {
    (0x01, 1): ("Vendor ID", UINT),
    (0x01, 2): ("Device Type", UINT),
    (0x01, 3): ("Product Code", UINT),
    (0x01, 4): ("Revision", None),
    (0x01, 5): ("Status", WORD),
    (0x01, 6): ("Serial Number", UDINT),
    (0x01, 7): ("Product Name", SHORT_STRING),
    (0x01, 8): ("State", USINT),
    (0x02, 1): ("Object List", None),
    (0x02, 2): ("Number Available", UINT),
    (0x02, 3): ("Number Active", UINT),
    (0x04, 3): ("Data", None),
    (0x04, 4): ("Size", UINT),
    (0x0F, 1): ("Parameter Value", None),
    (0x0F, 5): ("Data Type", USINT),
    (0x0F, 6): ("Data Size", USINT),
    (0xF5, 1): ("Status", DWORD),
    (0xF5, 2): ("Configuration Capability", DWORD),
    (0xF5, 3): ("Configuration Control", DWORD),
    (0xF5, 4): ("Physical Link Object", None),
    (0xF5, 5): ("Interface Configuration", None),
    (0xF5, 6): ("Host Name", STRING),
    (0xF5, 8): ("TTL Value", USINT),
    (0xF5, 9): ("Mcast Config", None),
    (0xF5, 10): ("SelectAcd", BOOL),
    (0xF5, 11): ("LastConflictDetected", None),
    (0xF5, 13): ("Encapsulation Inactivity Timeout", UINT),
    (0xF6, 1): ("Interface Speed", UDINT),
    (0xF6, 2): ("Interface Flags", DWORD),
    (0xF6, 3): ("Physical Address", None),
    (0xF6, 4): ("Interface Counters", None),
    (0xF6, 5): ("Media Counters", None),
    (0xF6, 10): ("Interface Label", SHORT_STRING),
}
_CLASS_ATTRIBUTES: Final = {1: "Revision", 2: "Max Instance", 3: "Number of Instances"}
_SERVICES: Final = {int(one): "_".join(word.capitalize() for word in one.name.split("_")) for one in Service}
#: The first service that is each object's own, and the class of the object for those that have a name.
_OWN: Final = 0x4B
_OBJECT_SERVICES: Final = {
    Service.GET_AND_CLEAR: ETHERNET_LINK,
    **dict.fromkeys(
        (
            Service.FORWARD_CLOSE, Service.UNCONNECTED_SEND, Service.FORWARD_OPEN, Service.GET_CONNECTION_DATA,
            Service.SEARCH_CONNECTION_DATA, Service.GET_CONNECTION_OWNER, Service.LARGE_FORWARD_OPEN,
        ),
        CONNECTION_MANAGER,
    ),
}  # fmt: skip
_SHOWN: Final = 16
_KINDS: Final = {Logical.MEMBER: "member", Logical.CONNECTION_POINT: "point", Logical.SERVICE: "service"}


class Place:
    """An object's path: class, instance, attribute as far as they are there; ``rest`` are its other segments."""

    __slots__ = ("attribute", "class_id", "instance", "rest")

    def __init__(self, segments: tuple[Segment, ...]) -> None:
        numbers: dict[int, int] = {}
        self.rest: list[Segment] = []
        for segment in segments:
            if (
                isinstance(segment, LogicalSegment)
                and segment.kind in {Logical.CLASS, Logical.INSTANCE, Logical.ATTRIBUTE}
                and segment.kind not in numbers
            ):
                numbers[segment.kind] = segment.value
            else:
                self.rest.append(segment)
        self.class_id = numbers.get(Logical.CLASS)
        self.instance = numbers.get(Logical.INSTANCE)
        self.attribute = numbers.get(Logical.ATTRIBUTE)


def place_of(path: bytes) -> Place | None:
    """None for a path that cannot be read."""
    try:
        return Place(parse_epath(path))
    except DecodeError:
        return None


def service_name(service: int, place: Place | None) -> str:
    """The service's name; numbers from 0x4B on are each object's own."""
    class_id = None if place is None else place.class_id
    if service in _SERVICES and (service < _OWN or _OBJECT_SERVICES[Service(service)] == class_id):
        return _SERVICES[service]
    return f"service 0x{service:02X}"


def place_text(place: Place | None, path: bytes, model: Model | None, attribute: int | None = None) -> str:
    """``Parameter 0x0F/25 DRV.DEC, Parameter Value``; octets where the path cannot be read.

    ``attribute`` is one that the path does not name: of a list.
    """
    if place is None:
        return f"path {octets_text(path)}"
    words = []
    if place.class_id is not None:
        numbers = [f"0x{place.class_id:02X}", *(str(n) for n in (place.instance,) if n is not None)]
        known = _CLASSES.get(place.class_id)
        words.append(f"{known} {'/'.join(numbers)}" if known else f"class {'/'.join(numbers)}")
    row = (
        model.cip.instances.get(place.instance)
        if model is not None and place.class_id == PARAMETER and place.instance is not None
        else None
    )
    if row is not None:
        words.append(row.name)
    text = " ".join(words)
    number = place.attribute if attribute is None else attribute
    if number is not None:
        text = f"{text}, {attribute_name(place, number, model)}".removeprefix(", ")
    rest = ", ".join(_segment(segment) for segment in place.rest)
    return ", ".join(part for part in (text, rest) if part) or "no path"


def attribute_name(place: Place, number: int, model: Model | None) -> str:
    """``7 Product Name``."""
    name = ""
    if place.instance == 0:
        name = _CLASS_ATTRIBUTES.get(number, "")
    elif place.class_id is not None:
        row = model.cip.attributes.get((place.class_id, number)) if model is not None else None
        name = row.name if row is not None else _ATTRIBUTES.get((place.class_id, number), ("", None))[0]
    return f"attribute {number} {name}".rstrip()


def value_text(data: bytes, place: Place | None, number: int | None, model: Model | None) -> str:
    """An attribute's value as its type has it, or its octets."""
    if place is None or number is None or place.class_id is None:
        return octets_text(data)
    if place.instance == 0:
        return str(int.from_bytes(data, "little")) if len(data) == 2 else octets_text(data)
    integer = _integer(place, number, model)
    if integer is not None and len(data) == integer[0]:
        return str(int.from_bytes(data, "little", signed=integer[1]))
    kind = _ATTRIBUTES.get((place.class_id, number), ("", None))[1]
    if kind is None:
        return octets_text(data)
    try:
        value = kind.parse(data)
    except DecodeError:
        return octets_text(data)
    if isinstance(value, bytes):
        return repr(value.decode("latin-1"))
    return f"0x{value:0{2 * (kind.size or 1)}X}" if kind in {WORD, DWORD} and isinstance(value, int) else str(value)


def _integer(place: Place, number: int, model: Model | None) -> tuple[int, bool] | None:
    """Octets and sign of an attribute of the drive's objects."""
    if model is None or place.class_id is None:
        return None
    if place.class_id == PARAMETER and number == _VALUE:
        row = model.cip.instances.get(place.instance or 0)
        return (row.size, row.signed) if row is not None else None
    attribute = model.cip.attributes.get((place.class_id, number))
    if attribute is None or attribute.type not in ATTRIBUTE_SIZES:
        return None
    return attribute.size, attribute.signed


def octets_text(data: bytes) -> str:
    """The first octets in hexadecimal, and how many there are."""
    if not data:
        return "no octets"
    more = f" ... ({len(data)} octets)" if len(data) > _SHOWN else ""
    return data[:_SHOWN].hex(" ") + more


def path_text(path: bytes, model: Model | None = None) -> str:
    """A path's segments in words."""
    return place_text(place_of(path), path, model)


def _segment(segment: Segment) -> str:
    match segment:
        case ElectronicKey():
            numbers = f"{segment.vendor_id}/{segment.device_type}/{segment.product_code}"
            compatible = " or compatible" if segment.compatible else ""
            return f"key {numbers} {segment.major_revision}.{segment.minor_revision}{compatible}"
        case LogicalSegment(kind, value):
            return f"{_KINDS.get(Logical(kind), Logical(kind).name.lower())} {value}"
        case PortSegment(port, address):
            return f"port {port} address {address[0] if len(address) == 1 else repr(address.decode('latin-1'))}"
        case NetworkSegment(3, data) if len(data) == 1:
            return f"production inhibit time {data[0]} ms"
        case NetworkSegment(subtype, data):
            return f"network segment {subtype} {data.hex()}"
        case SymbolSegment(name):
            return f"symbol {name.decode('latin-1')!r}"
        case DataSegment(data):
            return f"data {octets_text(data)}"
