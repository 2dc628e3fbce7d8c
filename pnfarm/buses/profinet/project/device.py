"""A device of a project as a device of a farm file: modules by its GSDML file, signals by the PLC's tags."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import FoundDevice
from pnfarm.buses.profinet.project.files import is_of_version, plain_number
from pnfarm.buses.profinet.project.parts import address_keys, name_of
from pnfarm.buses.profinet.said import said_of
from pnfarm.buses.projects.parts import facts, modules, octets_of, place_of, ranges, type_of
from pnfarm.buses.projects.tags import DataPlace, signals_of
from pnfarm.protocols.profinet.gsdml.station import PlugError, plug_station

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.buses.imports import Said
    from pnfarm.buses.projects.caex import CaexElement
    from pnfarm.buses.projects.description_folders import DescriptionFile
    from pnfarm.buses.projects.tags import IoRange, Tag
    from pnfarm.protocols.profinet.gsdml.document import Dap, Gsdml, ModuleItem
    from pnfarm.protocols.profinet.gsdml.station import PluggedStation, PluggedSubmodule

__all__ = ["project_device"]

#: Slots that a file may fill by itself.
_MOST_PLACES = 4096


def project_device(
    device: CaexElement, head: CaexElement, document: Gsdml, dap: Dap, file: DescriptionFile, tags: Sequence[Tag]
) -> FoundDevice:
    """``tags`` are those of its PLC; what the file does not allow is left out, and said in the notes."""
    notes: list[str] = []
    slots = _Slots(document, dap, notes)
    for slot, module in modules(device, head):
        slots.take(slot, module)
    slots.empty_others()
    plugged = slots.plugged()
    doubts = tuple(notes)
    keys: dict[str, Any] = address_keys(device)
    if len(document.daps) > 1:
        keys["access_point"] = dap.id
    if slots.chosen:
        keys["slots"] = dict(sorted(slots.chosen.items()))
    if plugged is not None:
        signals, remarks = signals_of(tags, _places(plugged, modules(device, head), notes))
        notes += remarks
        if signals:
            keys["signals"] = signals
    said = _said(device, plugged)
    return FoundDevice(name_of(device), file, keys, tuple(notes), tuple(facts(device)), said=said, doubts=doubts)


def _said(device: CaexElement, plugged: PluggedStation | None) -> Said:
    if plugged is None:
        return said_of(name_of(device))
    return said_of(
        name_of(device),
        (plugged.vendor_id, plugged.device_id),
        access_point=plugged.dap.ident,
        slots=(
            (one.slot, one.ident, (sum(sub.input_octets for sub in subs), sum(sub.output_octets for sub in subs)))
            for one in plugged.modules[1:]
            for subs in [one.submodules]
        ),
        order_number=plugged.order_number,
    )


class _Slots:
    """The key ``slots``, in ``chosen``."""

    def __init__(self, document: Gsdml, dap: Dap, notes: list[str]) -> None:
        self.chosen: dict[int, Any] = {}
        self._document = document
        self._dap = dap
        self._notes = notes
        self._known = {module.id: module for module in document.modules}
        #: Slots in which the project has something.
        self._there: set[int] = set()

    def take(self, slot: int, element: CaexElement) -> None:
        kind = type_of(element)
        if not kind.part and not kind.order_number:
            return
        self._there.add(slot)
        if "#" in kind.id:
            # built in: the file fixes it
            return
        fitting = [
            self._known[ref.target] for ref in self._dap.modules if ref.takes(slot) and ref.target in self._known
        ]
        found = (
            next((one.id for one in fitting if one.id == kind.id), None)
            or next((one.id for one in fitting if one.id.lower() == kind.id.lower()), None)
            if kind.id
            else self._ordered(slot, element, fitting, kind.order_number, kind.version)
        )
        if found is None:
            what = kind.id or f"{kind.order_number} {kind.version}".strip()
            self._notes.append(f"slot {slot}: the file has no module {what!r} there, which the project plugs: left out")
            return
        submodules = self._submodules(slot, element, self._known[found])
        self.chosen[slot] = {"module": found, "submodules": submodules} if submodules else found

    def _ordered(
        self, slot: int, element: CaexElement, fitting: Sequence[ModuleItem], number: str, version: str
    ) -> str | None:
        """By order number; of several, by the lengths of its data, and then by its firmware version."""
        wanted = plain_number(number)
        found = [one for one in fitting if plain_number(one.info.order_number) == wanted]
        if len(found) > 1:
            found = [one for one in found if _lengths(one) == octets_of(element)] or found
        if len(found) > 1:
            found = [
                one for one in found if is_of_version(version, one.info.software_release, one.info.name, one.id)
            ] or found
        if len(found) > 1:
            names = ", ".join(one.id for one in found[:8])
            self._notes.append(f"slot {slot}: several modules are {number} {version}, {names}: the last one is taken")
        return found[-1].id if found else None

    def _submodules(self, slot: int, element: CaexElement, module: ModuleItem) -> dict[int, str | None]:
        """Those that the project plugs into a module; if there are any, the file's own choice does not count."""
        plugged: dict[int, str | None] = {}
        for one in element.walk():
            kind, subslot = type_of(one), place_of(one)
            if one is not element and kind.part == "SM" and kind.id and "#" not in kind.id:
                if subslot:
                    plugged[subslot] = kind.id
                else:
                    self._notes.append(f"slot {slot}: submodule {kind.id} has no place in the project: left out")
        fixed = [place for ref in module.useable for place in ref.fixed]
        others = {place for ref in module.useable for place in ref.used} - {*plugged, *fixed}
        return plugged | dict.fromkeys(sorted(others) if plugged else ())

    def empty_others(self) -> None:
        """What the file plugs into a new project, and this one does not have, is not there."""
        if sum(len(ref.used) for ref in self._dap.modules) > _MOST_PLACES:
            # more than any device has: refused as it is
            return
        fixed = {slot for ref in self._dap.modules for slot in ref.fixed}
        used = {slot for ref in self._dap.modules for slot in ref.used}
        self.chosen |= dict.fromkeys(used - fixed - self._there)

    def plugged(self) -> PluggedStation | None:
        """The station of them, without what the file does not allow; None if there is none."""
        while True:
            try:
                return plug_station(
                    self._document,
                    access_point=self._dap.id,
                    modules={
                        slot: one["module"] if isinstance(one, dict) else one for slot, one in self.chosen.items()
                    },
                    submodules={
                        (slot, subslot): wanted
                        for slot, one in self.chosen.items()
                        if isinstance(one, dict)
                        for subslot, wanted in one["submodules"].items()
                    },
                )
            except PlugError as exc:
                self._notes.append(f"left out: {exc}")
                one = self.chosen.get(exc.slot) if exc.slot is not None else None
                if isinstance(one, dict) and exc.subslot in one["submodules"]:
                    del one["submodules"][exc.subslot]
                elif exc.slot in self.chosen:
                    del self.chosen[exc.slot]
                else:
                    return None


def _lengths(module: ModuleItem) -> tuple[int, int]:
    """Octets of its inputs and outputs."""
    return sum(one.input_octets for one in module.submodules), sum(one.output_octets for one in module.submodules)


def _octets(submodule: PluggedSubmodule, direction: str) -> int:
    return submodule.input_octets if direction == "input" else submodule.output_octets


def _places(plugged: PluggedStation, parts: Iterator[tuple[int, CaexElement]], notes: list[str]) -> Iterator[DataPlace]:
    """Where the project's addresses are in the device: a part's areas are its submodules' data, in their order."""
    for slot, element in parts:
        module = plugged.module(slot)
        if module is None:
            continue
        areas: dict[str, list[IoRange]] = {"input": [], "output": []}
        for one in element.walk():
            for area in ranges(one):
                areas[area.direction].append(area)
        for direction, found in areas.items():
            able = [one for one in module.submodules if _octets(one, direction)]
            if [area.octets for area in found] != [_octets(one, direction) for one in able]:
                if found:
                    told = f"{sum(area.octets for area in found)} octets in {len(found)} parts"
                    own = f"{sum(_octets(one, direction) for one in able)} in {len(able)}"
                    notes.append(f"slot {slot}: {direction}s are {told}, by the file {own}: no signals of its tags")
                continue
            for area, submodule in zip(found, able, strict=True):
                yield DataPlace(area, slot, submodule.subslot, bool(submodule.input_octets))
