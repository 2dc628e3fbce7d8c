"""Devices of an engineering project as drives of a farm file: by the GSDML file that the project names for each.

TIA Portal gives each part a type identifier: ``GSD:FILE.XML/D`` a device, ``/DAP/ID`` its access point, ``/M/ID`` a
module.  Where the file is at hand, it tells vendor and device, and the drive takes its identity from it.
"""

from __future__ import annotations

import re
from ipaddress import AddressValueError, IPv4Address
from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import Found, FoundDrive, FoundStation, drives_first
from pnfarm.buses.profinet.decode.identity import numbers_of
from pnfarm.buses.profinet.gsdml_file import load_gsdml
from pnfarm.buses.profinet.maker_identity import identity_of
from pnfarm.buses.profinet.telegram_names import numbers_in
from pnfarm.drives.catalogue import model, models, models_on
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from pnfarm.buses.caex import CaexElement
    from pnfarm.drives.description.model import Model

__all__ = ["of_project"]

_TYPE = re.compile(r"GSD:(?P<file>[^/]+\.xml)/(?P<part>[A-Z]+)(?:/(?P<id>.+))?", re.IGNORECASE)
_NONE = IPv4Address(0)


def of_project(root: CaexElement, folders: Sequence[Path], base: Path) -> Iterator[Found]:
    """Drives first, then stations that no model stands for.

    GSDML files are looked for in ``folders``; a farm file that names one is in ``base``.
    """
    files = _files(folders)
    return drives_first(_station(device, files, base) for device in _devices(root))


def _station(device: CaexElement, files: dict[str, Path], base: Path) -> FoundDrive | FoundStation:
    head = next((one for one in device.walk() if _part(one) == "DAP"), None)
    found = None if head is None else _drive(device, head, files, base)
    return found or FoundStation(_name(device), tuple(_facts(device)))


def _files(folders: Sequence[Path]) -> dict[str, Path]:
    """Description files by their names without case."""
    found: dict[str, Path] = {}
    for folder in folders:
        try:
            for file in sorted(folder.iterdir()):
                if file.suffix.lower() == ".xml":
                    found.setdefault(file.name.lower(), file)
        except OSError as exc:
            raise ConfigError(f"the folder {folder} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    return found


def _devices(root: CaexElement) -> Iterator[CaexElement]:
    """Elements that are devices; those within a device are its parts."""
    waiting = list(reversed(root.children))
    while waiting:
        one = waiting.pop()
        system = one.attributes.get("TypeIdentifier", "").startswith("System:Device")
        if system or one.has_role("Device") or _part(one) == "D":
            yield one
        else:
            waiting += reversed(one.children)


def _part(element: CaexElement) -> str:
    found = _TYPE.fullmatch(element.attributes.get("TypeIdentifier", ""))
    return "" if found is None else found["part"].upper()


def _node(device: CaexElement) -> CaexElement | None:
    """Its first network address; one with a name before one without."""
    nodes = [one for one in device.walk() if "NetworkAddress" in one.attributes]
    return next((one for one in nodes if one.attributes.get("ProfinetDeviceName")), nodes[0] if nodes else None)


def _name(device: CaexElement) -> str:
    node = _node(device)
    return (node.attributes.get("ProfinetDeviceName", "") if node is not None else "") or device.name


def _address(text: str) -> IPv4Address:
    try:
        return IPv4Address(text)
    except AddressValueError:
        return _NONE


def _drive(
    device: CaexElement, head: CaexElement, files: dict[str, Path], base: Path
) -> FoundDrive | FoundStation | None:
    typed = _TYPE.fullmatch(head.attributes["TypeIdentifier"])
    if typed is None:
        return None
    notes: list[str] = []
    keys: dict[str, Any] = {}
    file = files.get(typed["file"].lower())
    drive_model = _by_file(file, notes) if file is not None else _by_name(typed["file"], notes)
    if drive_model is None:
        return FoundStation(_name(device), (*notes, *_facts(device)))
    node = _node(device)
    if node is not None:
        ip, mask = (_address(node.attributes.get(key, "")) for key in ("NetworkAddress", "SubnetMask"))
        if int(ip) and int(mask):
            keys["ip"] = f"{ip}/{int(mask).bit_count()}"
            router = _address(node.attributes.get("RouterAddress", ""))
            if int(router) and router != ip:
                keys["gateway"] = str(router)
    if file is not None:
        own: dict[str, Any] = {"gsdml": str(file.relative_to(base) if file.is_relative_to(base) else file.resolve())}
        ident = _ident(file, typed["id"] or "")
        keys["identity"] = own if ident is None else {**own, "dap": ident}
        number = _telegram(device, file, drive_model, ident, notes)
    else:
        number = _telegram_by_name(device, drive_model, notes)
    if number is not None:
        keys["telegram"] = number
    return FoundDrive(_name(device), drive_model.name, keys, (*notes, *_facts(device)))


def _ident(file: Path, dap_id: str) -> int | None:
    """The ident of one of several access points."""
    document = load_gsdml(file)
    if len(document.daps) < 2:
        return None
    return next((dap.ident for dap in document.daps if dap.id.lower() == dap_id.lower()), None)


def _modules(device: CaexElement) -> Iterator[tuple[CaexElement, str]]:
    """The modules of a device, with their ids in its description file."""
    for one in device.walk():
        found = _TYPE.fullmatch(one.attributes.get("TypeIdentifier", ""))
        if found is not None and found["part"].upper() == "M" and found["id"]:
            yield one, found["id"]


def _telegram(
    device: CaexElement, file: Path, drive_model: Model, dap_ident: int | None, notes: list[str]
) -> int | None:
    """The first telegram among the project's modules, as the drive's identity matches them."""
    document = load_gsdml(file)
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
            notes.append(f"{file.name} has no module {module_id!r}, which the project plugs")
        elif ident not in numbers:
            notes.append(f"module {module.name or module_id} (0x{ident:X}) is not a known telegram")
        else:
            notes.append(f"telegram {numbers[ident]}: {module.name or module_id}")
            first = numbers[ident] if first is None else first
    return first


def _telegram_by_name(device: CaexElement, drive_model: Model, notes: list[str]) -> int | None:
    """The same where the description file is not at hand: by a number in a module's name."""
    for module, _ in _modules(device):
        known = [number for number in numbers_in(module.name) if number in drive_model.profidrive.telegrams]
        if len(known) == 1:
            notes.append(f"telegram {known[0]} by the name of its module, {module.name}")
            return known[0]
    return None


def _by_file(file: Path, notes: list[str]) -> Model | None:
    """By vendor and device number, else by the vendor."""
    try:
        document = load_gsdml(file)
    except ConfigError as exc:
        notes.append(str(exc))
        return _by_name(file.name, notes)
    known, ids = models_on("profinet"), (document.vendor_id, document.device_id)
    same = [one for one in known if numbers_of(one) == ids]
    if same:
        return same[0]
    of_vendor = [one for one in known if numbers_of(one)[0] == ids[0]]
    if of_vendor:
        notes.append(f"chosen by its vendor: device number 0x{ids[1]:04X} is none of a model")
    return of_vendor[0] if of_vendor else None


def _by_name(name: str, notes: list[str]) -> Model | None:
    """By the maker's name in the file's: ``GSDML-V2.3-MAKER-family-date.xml``."""
    words = re.split(r"[^a-z0-9]+", name.lower())
    for entry in models().values():
        if entry.bus == "profinet" and entry.maker.split()[0].lower() in words:
            notes.append(f"chosen by its maker's name: {name} is not at hand, so that the idents are the model's own")
            return model(entry.name)
    return None


def _facts(device: CaexElement) -> list[str]:
    facts = []
    node = _node(device)
    if node is not None:
        facts.append(f"IP {node.attributes['NetworkAddress']}")
    for one in device.walk():
        identifier = one.attributes.get("TypeIdentifier", "")
        if not identifier or identifier.startswith("System:Rack") or one is device:
            continue
        place = one.attributes.get("PositionNumber")
        facts.append(f"{'' if place is None else f'slot {place}: '}{one.name or '-'} ({identifier})")
    return facts or [device.attributes.get("TypeIdentifier", "no type")]
