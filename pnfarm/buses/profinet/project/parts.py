"""What a project says of a device: its head, its modules in their slots, and where their data are in the PLC's memory.

TIA Portal gives each part a type identifier: ``GSD:FILE.XML/D`` a device, ``/DAP/ID`` its access point, ``/M/ID`` a
module, ``/SM/ID`` a submodule; ``OrderNumber:6ES7 .../V1.2`` a part of Siemens'.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from ipaddress import AddressValueError, IPv4Address
from typing import TYPE_CHECKING, Any

from pnfarm.buses.tags import IoRange

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.caex import CaexElement, CaexProject

__all__ = [
    "PartType",
    "address_keys",
    "devices",
    "facts",
    "head_of",
    "modules",
    "name_of",
    "plc_of",
    "ranges",
    "type_of",
]

_GSD = re.compile(r"GSD:(?P<file>[^/]+\.xml)/(?P<part>[A-Z]+)(?:/(?P<id>.+))?", re.IGNORECASE)
_ORDERED = re.compile(r"OrderNumber:(?P<number>[^/]+)(?:/(?P<version>.+))?", re.IGNORECASE)
_NONE = IPv4Address(0)
#: Entries of a part's address list.
_MOST_RANGES = 16


@dataclass(frozen=True, slots=True)
class PartType:
    """A type identifier: ``file``, ``part`` (``DAP``, ``M``, ``SM`` ...) and ``id`` of a GSDML file's, else
    ``order_number`` and ``version``."""

    file: str = ""
    part: str = ""
    id: str = ""
    order_number: str = ""
    version: str = ""


def type_of(element: CaexElement) -> PartType:
    """All empty for one without such an identifier."""
    text = element.attributes.get("TypeIdentifier", "")
    if (found := _GSD.fullmatch(text)) is not None:
        return PartType(found["file"], found["part"].upper(), found["id"] or "")
    if (found := _ORDERED.fullmatch(text)) is not None:
        version = found["version"] or element.attributes.get("FirmwareVersion", "")
        return PartType(order_number=found["number"].strip(), version=version.strip())
    return PartType()


def devices(root: CaexElement) -> Iterator[CaexElement]:
    """Elements that are devices; those within a device are its parts."""
    waiting = list(reversed(root.children))
    while waiting:
        one = waiting.pop()
        system = one.attributes.get("TypeIdentifier", "").startswith("System:Device")
        if system or one.has_role("Device") or type_of(one).part == "D":
            yield one
        else:
            waiting += reversed(one.children)


def head_of(device: CaexElement, project: CaexProject) -> CaexElement | None:
    """Its access point; of Siemens' devices the module whose interface is at an IO system."""
    for one in device.walk():
        if type_of(one).part == "DAP" and "#" not in type_of(one).id:
            return one
    linked = {side.partition(":")[0] for link in project.links if _is_of_system(link) for side in link}
    for one in device.walk():
        if one.id and one.id in linked and not any(inner.has_role("IoSystem") for inner in one.walk()):
            # the interface itself may be in a bus adapter
            ordered = [outer for outer in one.around() if type_of(outer).order_number]
            return next((outer for outer in reversed(ordered) if "PositionNumber" in outer.attributes), None)
    return None


def _is_of_system(link: tuple[str, str]) -> bool:
    return any(side.rpartition(":")[2].lower().endswith("iosystem") for side in link)


def plc_of(device: CaexElement, project: CaexProject) -> CaexElement | None:
    """The device whose IO system it is at: the PLC; None where the project does not say."""
    systems = {one.id: one for one in project.root.walk() if one.id and one.has_role("IoSystem")}
    own = {one.id for one in device.walk() if one.id}
    for link in project.links:
        ids = {side.partition(":")[0] for side in link}
        found = next((systems[one] for one in ids if one in systems), None)
        if found is not None and ids & own:
            return next((outer for outer in found.around() if outer.has_role("Device")), None)
    return None


def place_of(element: CaexElement) -> int | None:
    """Its slot or subslot."""
    text = element.attributes.get("PositionNumber", "")
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 5 else None


def modules(device: CaexElement, head: CaexElement) -> Iterator[tuple[int, CaexElement]]:
    """The parts in the slots of a device, those built in among them, without its head."""
    rack = device if head.parent is None else head.parent
    for one in rack.children:
        place = place_of(one)
        if one is not head and place and any(value for value in one.attributes):
            yield place, one


def ranges(element: CaexElement) -> tuple[IoRange, ...]:
    """Its inputs and outputs in the PLC's memory, in the order of the project."""
    found = []
    for number in range(1, _MOST_RANGES):
        begin = f"Address/{number}/"
        start, bits = (element.attributes.get(begin + key, "") for key in ("StartAddress", "Length"))
        kind = element.attributes.get(begin + "IoType", "").lower()
        if not (start.isascii() and start.isdigit() and bits.isascii() and bits.isdigit() and len(start + bits) < 12):
            break
        if kind in {"input", "output"} and int(bits):
            found.append(IoRange("input" if kind == "input" else "output", int(start), (int(bits) + 7) // 8))
    return tuple(found)


# -- name and address --------------------------------------------------------------------------------------------------


def _node(device: CaexElement) -> CaexElement | None:
    """Its first network address; one with a name before one without."""
    nodes = [one for one in device.walk() if "NetworkAddress" in one.attributes]
    return next((one for one in nodes if one.attributes.get("ProfinetDeviceName")), nodes[0] if nodes else None)


def name_of(device: CaexElement) -> str:
    """The station's name, else the device's in the project."""
    node = _node(device)
    return (node.attributes.get("ProfinetDeviceName", "") if node is not None else "") or device.name


def _address(text: str) -> IPv4Address:
    try:
        return IPv4Address(text)
    except AddressValueError:
        return _NONE


def address_keys(device: CaexElement) -> dict[str, Any]:
    """``ip`` and ``gateway`` of a group, as far as the project has them."""
    keys: dict[str, Any] = {}
    node = _node(device)
    if node is not None:
        ip, mask = (_address(node.attributes.get(key, "")) for key in ("NetworkAddress", "SubnetMask"))
        if int(ip) and int(mask):
            keys["ip"] = f"{ip}/{int(mask).bit_count()}"
            router = _address(node.attributes.get("RouterAddress", ""))
            if int(router) and router != ip:
                keys["gateway"] = str(router)
    return keys


def facts(device: CaexElement) -> list[str]:
    """Address and parts, for people."""
    found = []
    node = _node(device)
    if node is not None:
        found.append(f"IP {node.attributes['NetworkAddress']}")
    for one in device.walk():
        identifier = one.attributes.get("TypeIdentifier", "")
        if not identifier or identifier.startswith("System:Rack") or one is device or type_of(one).part == "R":
            continue
        place = one.attributes.get("PositionNumber")
        found.append(f"{'' if place is None else f'slot {place}: '}{one.name or '-'} ({identifier})")
    return found or [device.attributes.get("TypeIdentifier", "no type")]
