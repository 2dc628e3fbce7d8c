"""The modules that a project plugs into a device, as its GSDML file names them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.project.files import is_of_version, plain_number
from pnfarm.buses.projects.parts import modules, octets_of, place_of, type_of
from pnfarm.protocols.profinet.gsdml.station import PlugError, plug_station

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.projects.caex import CaexElement
    from pnfarm.protocols.profinet.gsdml.document import Dap, Gsdml, ModuleItem
    from pnfarm.protocols.profinet.gsdml.station import PluggedStation

__all__ = ["ProjectSlots", "fixed_module"]

#: Slots that a file may fill by itself.
_MOST_PLACES = 4096


def fixed_module(dap: Dap, slot: int) -> str:
    """The ID of the module that the file fixes in a slot, which the project calls built in; empty for none."""
    return next((ref.target for ref in dap.modules if slot in ref.fixed), "")


class ProjectSlots:
    """``chosen``: the key ``slots`` of a device, with what the project plugs into ``device`` beside its ``head``.

    ``left_out``: what the file does not allow; ``notes``: what is not sure.
    """

    def __init__(self, document: Gsdml, dap: Dap, device: CaexElement, head: CaexElement) -> None:
        self.chosen: dict[int, Any] = {}
        self.left_out: list[str] = []
        self.notes: list[str] = []
        self._document = document
        self._dap = dap
        self._known = {module.id: module for module in document.modules}
        #: Slots in which the project has something.
        self._there: set[int] = set()
        for slot, module in modules(device, head):
            self._take(slot, module)
        self._empty_others()

    def _take(self, slot: int, element: CaexElement) -> None:
        kind = type_of(element)
        if not kind.part and not kind.order_number:
            return
        self._there.add(slot)
        if "#" in kind.id:
            # built in: the file fixes it, and the project may plug submodules into it
            fixed = fixed_module(self._dap, slot)
            if fixed in self._known and (submodules := self._submodules(slot, element, self._known[fixed])):
                self.chosen[slot] = {"module": fixed, "submodules": submodules}
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
            why = f"the file has no module {what!r} there, which the project plugs: left out"
            self.left_out.append(f"slot {slot}: {why}")
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
            self.notes.append(f"slot {slot}: several modules are {number} {version}, {names}: the last one is taken")
        return found[-1].id if found else None

    def _submodules(self, slot: int, element: CaexElement, module: ModuleItem) -> dict[int, str | None]:
        """Those that the project plugs into a module; if there are any, the file's own choice does not count."""
        plugged: dict[int, str | None] = {}
        for one in element.walk():
            kind, place = type_of(one), place_of(one)
            if one is not element and kind.part == "SM" and kind.id and "#" not in kind.id:
                if place is not None:
                    # the project counts from 0
                    plugged[place + 1] = kind.id
                else:
                    self.left_out.append(f"slot {slot}: submodule {kind.id} has no place in the project: left out")
        fixed = [place for ref in module.useable for place in ref.fixed]
        others = {place for ref in module.useable for place in ref.used} - {*plugged, *fixed}
        return plugged | dict.fromkeys(sorted(others) if plugged else ())

    def _empty_others(self) -> None:
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
                self.left_out.append(f"left out: {exc}")
                one = self.chosen.get(exc.slot) if exc.slot is not None else None
                if isinstance(one, dict) and exc.subslot in one["submodules"]:
                    del one["submodules"][exc.subslot]
                elif exc.slot in self.chosen:
                    del self.chosen[exc.slot]
                else:
                    return None


def _lengths(module: ModuleItem) -> tuple[int, int]:
    return sum(one.input_octets for one in module.submodules), sum(one.output_octets for one in module.submodules)
