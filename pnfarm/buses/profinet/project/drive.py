"""A device of a project as a drive of a farm file: by its GSDML file, or by its maker's name, that of a drive model."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import FoundDrive
from pnfarm.buses.profinet.decode.identity import numbers_of
from pnfarm.buses.profinet.maker_identity import identity_of
from pnfarm.buses.profinet.project.parts import address_keys, name_of
from pnfarm.buses.profinet.project.slots import fixed_module
from pnfarm.buses.profinet.said import said_of
from pnfarm.buses.projects.parts import facts, modules, type_of
from pnfarm.buses.telegram_names import numbers_in
from pnfarm.drives.catalogue import model, models, models_on

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Iterator, Mapping

    from pnfarm.buses.imports import Said
    from pnfarm.buses.projects.caex import CaexElement
    from pnfarm.buses.projects.description_folders import DescriptionFile
    from pnfarm.buses.projects.parts import PartType
    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.profinet.gsdml.document import Dap, Gsdml

__all__ = ["drive_by_file", "drive_by_name", "profile_drive"]

#: The model that is the PROFIdrive profile alone, and the profile's API.
_PROFILE, _API = "profidrive", 0x3A00


def drive_by_file(device: CaexElement, head: PartType, document: Gsdml, file: DescriptionFile) -> FoundDrive | None:
    """By vendor and device number, else by the vendor."""
    notes: list[str] = []
    drive_model = _model_of(document, notes)
    if drive_model is None:
        return None
    keys = address_keys(device)
    own: dict[str, Any] = {"gsdml": file.name}
    ident = _ident(document, head.id)
    keys["identity"] = own if ident is None else {**own, "dap": ident}
    number = _telegram(device, document, drive_model, ident, head.file, notes)
    if number is not None:
        keys["telegram"] = number
    own_file = None if file.octets is None else file
    return FoundDrive(
        name_of(device),
        drive_model.name,
        keys,
        tuple(notes),
        tuple(facts(device)),
        file=own_file,
        said=_said(device, document, [] if number is None else [number]),
        doubts=tuple(notes) if number is None else (),
    )


def _said(device: CaexElement, document: Gsdml, telegrams: Iterable[int]) -> Said:
    numbers = document.vendor_id, document.device_id
    return said_of(name_of(device), numbers, telegrams=dict(enumerate(telegrams)))


def drive_by_name(device: CaexElement, file: str) -> FoundDrive | None:
    """By the maker's name in that of a file that was not found: ``GSDML-V2.3-MAKER-family-date.xml``."""
    words = re.split(r"[^a-z0-9]+", file.lower())
    for entry in models().values():
        if entry.bus == "profinet" and entry.maker.split()[0].lower() in words:
            notes = [f"chosen by its maker's name: {file} was not found, so that the idents are the model's own"]
            keys = address_keys(device)
            number = _telegram_by_name(device, model(entry.name), notes)
            if number is not None:
                keys["telegram"] = number
            said = said_of(name_of(device), telegrams=None if number is None else {1: number})
            own = tuple(facts(device))
            doubts = (notes[0],)
            return FoundDrive(name_of(device), entry.name, keys, tuple(notes), own, said=said, doubts=doubts)
    return None


def profile_drive(
    device: CaexElement, head: CaexElement, document: Gsdml, dap: Dap, file: DescriptionFile
) -> FoundDrive | None:
    """By the PROFIdrive profile, where the project plugs telegrams of it; each of several slots has an axis."""
    identity = identity_of(document, model(_PROFILE), dap.id).overrides
    known = {one.id.lower(): one.ident for one in document.modules}
    pluggable = {one.id.lower(): one.ident for one in document.submodules}
    axes: list[dict[str, Any]] = []
    for slot, element in modules(device, head):
        kind = type_of(element)
        module = known.get((fixed_module(dap, slot) if "#" in kind.id else kind.id).lower())
        inside = {pluggable.get(type_of(one).id.lower()) for one in element.walk()}
        number = _plugged(identity.get("telegrams", {}), module, inside)
        if number is not None:
            axis = {"name": f"axis-{slot}", "slot": slot, "telegram": number}
            supplements = identity.get("supplements", {}).items()
            beside = next((one for one, entry in supplements if entry["submodule"] in inside), None)
            axes.append(axis if beside is None else {**axis, "supplementary": beside})
    if not axes:
        return None
    keys: dict[str, Any] = {"gsdml": file.name, **address_keys(device)}
    if len(document.daps) > 1:
        keys["access_point"] = dap.id
    keys |= {"axes": axes} if len(axes) > 1 else {key: axes[0][key] for key in axes[0] if key not in {"name", "slot"}}
    notes = "chosen by its telegrams: it behaves as the PROFIdrive profile; `behaviour: {set: ...}` as a maker's"
    own = None if file.octets is None else file
    said = _said(device, document, [axis["telegram"] for axis in axes])
    return FoundDrive(name_of(device), _PROFILE, keys, (notes,), tuple(facts(device)), file=own, said=said)


def _plugged(
    telegrams: Mapping[int, Mapping[str, Any]], module: int | None, inside: Container[int | None]
) -> int | None:
    """The profile's telegram in this module: by a submodule in it, or the only one of the module."""
    entries = [
        (number, one) for number, entry in telegrams.items() for one in (entry, *entry.get("others", {}).values())
    ]
    there = [(number, one) for number, one in entries if one.get("module") == module and one.get("api") == _API]
    found = there if len(there) == 1 else [(number, one) for number, one in there if one.get("submodule") in inside]
    return found[0][0] if found else None


def _ident(document: Gsdml, dap_id: str) -> int | None:
    """The ident of one of several access points."""
    if len(document.daps) < 2:
        return None
    return next((dap.ident for dap in document.daps if dap.id.lower() == dap_id.lower()), None)


def _modules(device: CaexElement) -> Iterator[tuple[CaexElement, str]]:
    """The modules of a device, with their ids in its description file."""
    for one in device.walk():
        found = type_of(one)
        if found.part == "M" and found.id:
            yield one, found.id


def _telegram(
    device: CaexElement, document: Gsdml, drive_model: Model, dap_ident: int | None, file: str, notes: list[str]
) -> int | None:
    """The first telegram among the project's modules, as the drive's identity matches them."""
    idents = {module.id.lower(): module.ident for module in document.modules}
    numbers: dict[int, int] = {}
    for number, own in identity_of(document, drive_model, dap_ident).overrides.get("telegrams", {}).items():
        for ident in (own, *own.get("others", {}).values()):
            if "module" in ident:
                numbers.setdefault(ident["module"], number)
    first: int | None = None
    for module, module_id in _modules(device):
        ident = idents.get(module_id.lower())
        if ident is None:
            notes.append(f"{file} has no module {module_id!r}, which the project plugs")
        elif ident not in numbers:
            notes.append(f"module {module.name or module_id} (0x{ident:X}) is not a known telegram")
        else:
            notes.append(f"telegram {numbers[ident]}: {module.name or module_id}")
            first = numbers[ident] if first is None else first
    return first


def _telegram_by_name(device: CaexElement, drive_model: Model, notes: list[str]) -> int | None:
    """The same where the description file was not found: by a number in a module's name."""
    for module, _ in _modules(device):
        known = [number for number in numbers_in(module.name) if number in drive_model.profidrive.telegrams]
        if len(known) == 1:
            notes.append(f"telegram {known[0]} by the name of its module, {module.name}")
            return known[0]
    return None


def _model_of(document: Gsdml, notes: list[str]) -> Model | None:
    known, ids = models_on("profinet"), (document.vendor_id, document.device_id)
    same = [one for one in known if numbers_of(one) == ids]
    if same:
        return same[0]
    of_vendor = [one for one in known if numbers_of(one)[0] == ids[0]]
    if of_vendor:
        notes.append(f"chosen by its vendor: no model has device number 0x{ids[1]:04X}")
    return of_vendor[0] if of_vendor else None
