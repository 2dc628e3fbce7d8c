"""What a project says of a device on any bus: its parts with their types, its slots, its data in the PLC's memory.

TIA Portal gives each part a type identifier: ``GSD:FILE/D`` a device, ``/DAP/ID`` its head, ``/M/ID`` a module,
``/SM/ID`` a submodule, of a GSDML or GSD file; ``OrderNumber:6ES7 .../V1.2`` a part of Siemens'.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.buses.projects.tags import IoRange
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.buses.projects.caex import CaexElement

__all__ = [
    "WATCHDOG_FACTOR", "PartType", "devices", "facts", "head_of_file", "is_on_profibus", "modules", "nodes",
    "octets_of", "only_system", "place_of", "ranges", "type_of",
]  # fmt: skip

#: The attribute of a station's interface that has its watchdog factor.
WATCHDOG_FACTOR = "PnWatchdogFactor"
_GSD = re.compile(r"GSD:(?P<file>[^/]+\.(?:xml|gs[a-z]))/(?P<part>[A-Z]+)(?:/(?P<id>.+))?", re.IGNORECASE)
_ORDERED = re.compile(r"OrderNumber:(?P<number>[^/]+)(?:/(?P<version>.+))?", re.IGNORECASE)
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


def head_of_file(device: CaexElement) -> CaexElement | None:
    """The part that a description file calls the device's head."""
    return next((one for one in device.walk() if type_of(one).part == "DAP" and "#" not in type_of(one).id), None)


def nodes(device: CaexElement) -> list[CaexElement]:
    """Its network addresses; those with a name before others."""
    found = [one for one in device.walk() if "NetworkAddress" in one.attributes]
    return sorted(found, key=lambda one: not one.attributes.get("ProfinetDeviceName"))


def is_on_profibus(device: CaexElement) -> bool:
    """Whether it is a station of a line: by its GSD file, else by its only network."""
    head = head_of_file(device)
    if head is not None:
        return not type_of(head).file.lower().endswith(".xml")
    return {one.attributes.get("Type", "").lower() for one in nodes(device)} == {"profibus"}


def only_system(systems: Sequence[CaexElement], network: str) -> CaexElement | None:
    """The interface of a PLC's only IO system on such a network; None where it has none there.

    Raises :class:`ConfigError` where it has several.
    """
    found = [
        (one, interface)
        for one in systems
        if (interface := one.parent) is not None
        and any(node.attributes.get("Type", "Ethernet").lower() == network.lower() for node in nodes(interface))
    ]
    if len(found) > 1:
        known = ", ".join(repr(one.name) for one, _ in found)
        raise ConfigError(f"the PLC has several IO systems there: name one with --plc: {known}")
    return found[0][1] if found else None


def place_of(element: CaexElement) -> int | None:
    """Its slot or subslot."""
    text = element.attributes.get("PositionNumber", "")
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 5 else None


def modules(device: CaexElement, head: CaexElement) -> Iterator[tuple[int, CaexElement]]:
    """The parts in the slots of a device, those built in among them, without its head."""
    rack = device if head.parent is None else head.parent
    for one in rack.children:
        place = place_of(one)
        if one is not head and place:
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


def octets_of(element: CaexElement) -> tuple[int, int]:
    """Of its inputs and of its outputs, with all in it."""
    areas = [area for one in element.walk() for area in ranges(one)]
    inputs, outputs = (sum(area.octets for area in areas if area.direction == way) for way in ("input", "output"))
    return inputs, outputs


def facts(device: CaexElement) -> list[str]:
    """Address and parts, for people."""
    found = []
    for node in nodes(device)[:1]:
        kind = "IP" if node.attributes.get("Type", "Ethernet") == "Ethernet" else "address"
        found.append(f"{kind} {node.attributes['NetworkAddress']}")
    for one in device.walk():
        identifier = one.attributes.get("TypeIdentifier", "")
        if not identifier or identifier.startswith("System:Rack") or one is device or type_of(one).part == "R":
            continue
        place = one.attributes.get("PositionNumber")
        found.append(f"{'' if place is None else f'slot {place}: '}{one.name or '-'} ({identifier})")
    return found or [device.attributes.get("TypeIdentifier", "no type")]
