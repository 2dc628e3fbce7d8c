"""The PROFIBUS stations of an engineering project: drives and devices by their GSD files, and what is neither.

The project names a module by its number in the GSD file (its Module_Reference; where the file has none, its place among
the file's modules, from 1, which is assumed), and has the module's name besides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import FoundDevice, FoundDrive, FoundStation, drives_first
from pnfarm.buses.profibus.config.drive import HIGHEST_ADDRESS
from pnfarm.buses.profibus.decode.names import model_by_ident
from pnfarm.buses.profibus.described.station import SUBSLOT
from pnfarm.buses.profibus.found import LINE, said_of
from pnfarm.buses.profibus.gsd_file import read_gsd
from pnfarm.buses.projects.parts import (
    devices,
    facts,
    head_of_file,
    is_on_profibus,
    modules,
    nodes,
    octets_of,
    ranges,
    type_of,
)
from pnfarm.buses.projects.tags import DataPlace, signals_of
from pnfarm.buses.projects.view import ProjectView
from pnfarm.errors import ConfigError
from pnfarm.protocols.profibus.gsd.statements import LONGEST
from pnfarm.protocols.profibus.gsd.station import plug_slave
from pnfarm.protocols.profibus.gsd.values import PlugError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pnfarm.buses.imports import Found
    from pnfarm.buses.projects.caex import CaexElement, CaexProject
    from pnfarm.buses.projects.description_folders import DescriptionFolders
    from pnfarm.protocols.profibus.gsd.document import Gsd, ModuleItem
    from pnfarm.protocols.profibus.gsd.station import PluggedSlave

__all__ = ["address_in", "of_project", "plugged_modules", "slots_of"]


def of_project(project: CaexProject, folders: DescriptionFolders, base: Path) -> Iterator[Found]:
    """Drives first, then devices, then stations that become neither.

    GSD files are searched in ``folders``; a farm file that names one is in ``base``.
    """
    view = ProjectView(project)
    stations = [device for device in devices(project.root) if is_on_profibus(device)]
    return drives_first(_station(device, view, folders, base) for device in stations)


def _station(device: CaexElement, project: ProjectView, folders: DescriptionFolders, base: Path) -> Found:
    head = head_of_file(device)
    own = tuple(facts(device))
    keys: dict[str, Any] = {}
    if (address := address_in(device)) is not None:
        keys["address"] = address
    said = said_of(device.name)
    if head is None:
        return FoundStation(device.name, own, LINE, keys=keys, said=said)
    name = type_of(head).file
    file = folders.named(name)
    if file is None:
        return FoundStation(device.name, (f"{name} was not found", *own), LINE, name, keys, said)
    try:
        gsd = read_gsd(file.octets(LONGEST), file.name)
    except ConfigError as exc:
        return FoundStation(device.name, (str(exc), *own), LINE, name, keys, said)
    notes: list[str] = []
    if (known := model_by_ident(gsd.ident)) is not None:
        notes += [f"module {one.name} in slot {slot}" for slot, one in modules(device, head)]
        said = said_of(device.name, gsd.ident)
        return FoundDrive(device.name, known.name, keys, tuple(notes), own, LINE, said=said)
    keys["slots"] = slots_of(device, head, gsd, notes)
    plugged = plugged_modules(gsd, keys["slots"], notes)
    doubts = tuple(notes)
    if not keys["slots"]:
        del keys["slots"]
    if plugged is not None:
        places = _places(plugged, modules(device, head), notes)
        signals, remarks = signals_of(project.tags(device), places)
        notes += remarks
        if signals:
            keys["signals"] = signals
    said = said_of(device.name, gsd.ident, None if plugged is None else plugged.identifiers)
    written = file.for_farm("gsd", base, LONGEST)
    return FoundDevice(device.name, written, keys, tuple(notes), own, LINE, said, doubts=doubts)


def address_in(element: CaexElement) -> int | None:
    """The station address of a device, or of a master's interface."""
    text = next((one.attributes["NetworkAddress"] for one in nodes(element)), "")
    known = text.isascii() and text.isdigit() and len(text) < 4 and int(text) <= HIGHEST_ADDRESS
    return int(text) if known else None


def slots_of(device: CaexElement, head: CaexElement, gsd: Gsd, notes: list[str]) -> dict[int, Any]:
    """The key ``slots``: the project counts modules from the head on; what is left out is in the notes."""
    found: dict[int, Any] = {}
    for slot, element in modules(device, head):
        kind = type_of(element)
        if kind.part != "M":
            continue
        item = _module(gsd, kind.id, element.attributes.get("TypeName", ""))
        if item is None:
            notes.append(f"slot {slot}: the file has no module {kind.id!r}, which the project plugs: left out")
        else:
            found[slot] = item.name if item.number is None else item.number
    return found


def _module(gsd: Gsd, number: str, name: str) -> ModuleItem | None:
    numbered = [one for one in gsd.modules if str(one.number) == number]
    named = [one for one in numbered or gsd.modules if one.name.strip() == name.strip()]
    if len(found := named or numbered) == 1:
        return found[0]
    numbers = any(one.number is not None for one in gsd.modules)
    place = int(number) if number.isascii() and number.isdigit() and len(number) < 5 and not numbers else 0
    return gsd.modules[place - 1] if 0 < place <= len(gsd.modules) else None


def plugged_modules(gsd: Gsd, slots: dict[int, Any], notes: list[str]) -> PluggedSlave | None:
    """The slave of them, without what the file does not allow; None if there is none."""
    while True:
        try:
            return plug_slave(gsd, slots)
        except PlugError as exc:
            notes.append(f"left out: {exc}")
            if exc.slot not in slots:
                return None
            del slots[exc.slot]


def _places(plugged: PluggedSlave, parts: Iterator[tuple[int, CaexElement]], notes: list[str]) -> Iterator[DataPlace]:
    """Where the project's addresses are in the slave."""
    known = {module.slot: module for module in plugged.modules}
    for slot, element in parts:
        module = known.get(slot)
        if module is None:
            continue
        lengths = octets_of(element)
        if lengths != (module.inputs, module.outputs):
            if any(lengths):
                what = f"{lengths[0]} octets of inputs and {lengths[1]} of outputs"
                notes.append(
                    f"slot {slot}: {what}, by the file {module.inputs} and {module.outputs}: no signals of its tags"
                )
            continue
        past = {"input": 0, "output": 0}
        for area in (area for one in element.walk() for area in ranges(one)):
            # areas of one direction are one after the other
            yield DataPlace(area, slot, SUBSLOT, bool(module.inputs), past[area.direction])
            past[area.direction] += area.octets
