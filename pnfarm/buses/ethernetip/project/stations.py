"""The EtherNet/IP modules of an engineering project: drives, devices by EDS files or their connections, and others."""

from __future__ import annotations

import re
from dataclasses import replace
from ipaddress import AddressValueError, IPv4Address
from typing import TYPE_CHECKING, Any

from pnfarm.buses.decoding.identity import models_by
from pnfarm.buses.ethernetip.decode.identity import numbers_of
from pnfarm.buses.ethernetip.described.file_signals import SUBSLOT
from pnfarm.buses.ethernetip.eds_file import read_eds
from pnfarm.buses.ethernetip.found import said_of
from pnfarm.buses.ethernetip.project.generic import generic_eds, lengths, points
from pnfarm.buses.imports import FoundDevice, FoundDrive, FoundStation, drives_first
from pnfarm.buses.projects.description_folders import DescriptionFile
from pnfarm.buses.projects.tags import signal_name
from pnfarm.errors import ConfigError
from pnfarm.protocols.enip.eds.text import LONGEST
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pnfarm.buses.imports import Found
    from pnfarm.buses.projects.description_folders import DescriptionFolders, FileAtHand
    from pnfarm.buses.projects.l5x import L5xConnection, L5xModule, L5xProject
    from pnfarm.protocols.enip.eds.document import Connection, Sheet

__all__ = [
    "PREFIX", "EdsFiles", "address_of", "connection_of", "data_connection", "of_project", "rpi_of",
]  # fmt: skip

#: The project does not have the prefix length of an address.
PREFIX = 24
_KEYS = re.compile(rb"\b(VendCode|ProdType|ProdCode|MajRev)\s*=\s*(0x[0-9a-f]{1,4}\b|[0-9]{1,6})", re.IGNORECASE)
_ALIAS = re.compile(r"(?P<module>[^:]+):(?P<way>[IO])\.Data\[(?P<index>[0-9]{1,4})\](?:\.(?P<bit>[0-9]{1,2}))?")
#: Octets of an element, and its type as that of a signal.
_ELEMENTS = {
    "SINT": (1, "int8"), "INT": (2, "int16"), "DINT": (4, "int32"), "REAL": (4, "float32"), "LINT": (8, "int64"),
    "USINT": (1, "uint8"), "UINT": (2, "uint16"), "UDINT": (4, "uint32"),
}  # fmt: skip
#: A connection that carries data, by its type in the project.
_WITH_DATA = frozenset({"Output", "Input", "StandardDataDriven"})
#: Catalog number of a device that is described by nothing but its connection.
_GENERIC = "ETHERNET-MODULE"
_MOST_FACTS = 40


def of_project(project: L5xProject, folders: DescriptionFolders, base: Path) -> Iterator[Found]:
    """Drives first, then devices, then modules that become neither.

    EDS files are searched in ``folders``; a farm file that names one is in ``base``.
    """
    return drives_first(_Stations(project, folders, base).found())


class _Stations:
    def __init__(self, project: L5xProject, folders: DescriptionFolders, base: Path) -> None:
        self._project = project
        self._base = base
        self._files = EdsFiles(folders)
        self._below: dict[str, list[str]] = {}
        for one in project.modules:
            self._below.setdefault(one.attributes.get("ParentModule", ""), []).append(_called(one))

    def found(self) -> Iterator[Found]:
        for module in self._project.modules:
            if (ip := address_of(module)) is not None:
                one = self._of(module, ip)
                yield one if isinstance(one, FoundStation) or module.keyed else replace(one, keyed=False)

    def _of(self, module: L5xModule, ip: IPv4Address) -> Found:
        numbers = tuple(module.number(key) for key in ("Vendor", "ProductType", "ProductCode"))
        below = [f"behind it: {one}" for one in self._below.get(module.name, ())[:_MOST_FACTS]]
        facts = (f"IP {ip}", _called(module), *below)
        keys: dict[str, Any] = {"ip": f"{ip}/{PREFIX}"}
        notes = [f"the project does not have its prefix length: /{PREFIX} is assumed"]
        connection = data_connection(module)
        if connection is not None and (rpi := rpi_of(connection)):
            keys["rpi"] = rpi
        said = said_of(module.name, numbers, f"{module.number('Major')}.{module.number('Minor')}")
        model = models_by("ethernetip", numbers_of).get(numbers)
        if model is not None:
            return FoundDrive(module.name, model.name, keys, tuple(notes), facts, said=said)
        generic = module.attributes.get("CatalogNumber", "").upper() == _GENERIC
        file = None if generic else self._files.of(module)
        if file is not None:
            return replace(self._by_file(module, connection, file, keys, notes, facts), said=said)
        named = f"an EDS file for vendor {numbers[0]}, type {numbers[1]}, code {numbers[2]}"
        missing = "" if generic else f"{named} ({module.attributes.get('CatalogNumber', '')})"
        octets = None if connection is None else generic_eds(module, connection)
        try:
            own = None if octets is None else read_eds(octets, module.name).connection()
        except ConfigError as exc:
            why = f"no device can be made of its connection: {exc}"
            return FoundStation(module.name, (why, *facts), missing=missing, keys=keys, said=said)
        if own is None or octets is None or connection is None or len(own.points) < 2:
            why = "the project has no connection with its data and their assemblies"
            return FoundStation(module.name, (why, *facts), missing=missing, keys=keys, said=said)
        notes.append("its data are octets, because the project does not describe them")
        if missing:
            notes.append(f"with {missing} it has names and parameters")
        keys |= self._signals(module, connection, notes, own)
        made = DescriptionFile("eds", "pnfarm-{name}.eds", octets)
        return FoundDevice(module.name, made, keys, tuple(notes), facts, said=said)

    def _by_file(
        self,
        module: L5xModule,
        connection: L5xConnection | None,
        file: FileAtHand,
        keys: dict[str, Any],
        notes: list[str],
        facts: tuple[str, ...],
    ) -> Found:
        try:
            sheet = read_eds(file.octets(LONGEST), file.name)
        except ConfigError as exc:
            return FoundStation(module.name, (str(exc), *facts), keys=keys)
        doubts: tuple[str, ...] = ()
        chosen = None if connection is None else connection_of(sheet, points(module, connection))
        if chosen is not None and connection is not None:
            keys["connection"] = chosen.keyword
            sizes = dict(zip(("outputs", "inputs"), lengths(module, connection), strict=True))
            for way, limits in (("outputs", chosen.outputs.size), ("inputs", chosen.inputs.size)):
                if limits.least < limits.most and sizes[way]:
                    keys.setdefault("sizes", {})[way] = sizes[way]
        elif connection is not None:
            doubts = (f"the project's connection {connection.attributes.get('Name', '')!r} is not in {file.name}",)
            notes += doubts
        written = file.for_farm("eds", self._base, LONGEST)
        return FoundDevice(module.name, written, keys, tuple(notes), facts, doubts=doubts)

    def _signals(
        self, module: L5xModule, connection: L5xConnection, notes: list[str], own: Connection
    ) -> dict[str, Any]:
        """The key ``signals``: aliases of the module's data."""
        *_, outputs, inputs = own.points
        found: dict[str, Any] = {}
        for name, target in self._project.aliases:
            alias = _ALIAS.fullmatch(target.strip())
            if alias is None or alias["module"] != module.name:
                continue
            size, kind = _ELEMENTS.get(connection.elements.get(alias["way"], ""), (0, ""))
            bit = None if alias["bit"] is None else int(alias["bit"])
            if not size or (bit is not None and bit >= 8 * size):
                notes.append(f"no signal for the tag {name!r}: the type of {target} is not known")
                continue
            instance, way = (inputs, "input") if alias["way"] == "I" else (outputs, "output")
            place = int(alias["index"]) * size + (0 if bit is None else bit // 8)
            at = f"{instance}.{SUBSLOT}.{place}" + ("" if bit is None else f".{bit % 8}")
            signal = signal_name(name, found)
            found[signal] = {"at": at, "direction": way} | ({"type": kind} if bit is None else {})
        return {"signals": found} if found else {}


def connection_of(sheet: Sheet, path: bytes) -> Connection | None:
    """The cyclic connection with this path."""
    return next((one for one in sheet.connections if one.is_class_1 and one.path == path), None) if path else None


def _called(module: L5xModule) -> str:
    shown = module.attributes
    revision = f"{shown.get('Major', '')}.{shown.get('Minor', '')}"
    return f"{module.name}: {shown.get('CatalogNumber', '')}, revision {revision}"


def address_of(module: L5xModule) -> IPv4Address | None:
    """None for one that is not on the network."""
    try:
        return IPv4Address(module.address)
    except AddressValueError:
        return None


def data_connection(module: L5xModule) -> L5xConnection | None:
    """Its first connection with data."""
    return next((one for one in module.connections if one.attributes.get("Type", "") in _WITH_DATA), None)


def rpi_of(connection: L5xConnection) -> str:
    """The packet interval as a farm file has it; empty where the project has none."""
    text = connection.attributes.get("RPI", "")
    return format_duration(int(text) * 1000) if text.isascii() and text.isdigit() and 0 < len(text) < 8 else ""


class EdsFiles:
    """EDS files in ``folders``, by the identity of their devices."""

    def __init__(self, folders: DescriptionFolders) -> None:
        #: By vendor, type and code, with their major revisions, the highest first.
        self._known: dict[tuple[int, ...], list[tuple[FileAtHand, int]]] = {}
        for file, data in folders.contents(".eds", LONGEST):
            words = reversed(_KEYS.findall(data))
            keys = {key.lower(): int(value, 16 if b"x" in value.lower() else 10) for key, value in words}
            numbers = tuple(keys.get(key, -1) for key in (b"vendcode", b"prodtype", b"prodcode"))
            self._known.setdefault(numbers, []).append((file, keys.get(b"majrev", 0)))
        for files in self._known.values():
            files.sort(key=lambda one: -one[1])

    def of(self, module: L5xModule) -> FileAtHand | None:
        """Of several files for a device the one with the project's major revision."""
        files = self._known.get(tuple(module.number(key) for key in ("Vendor", "ProductType", "ProductCode")), [])
        major = module.number("Major")
        return next((file for file, own in files if own == major), files[0][0] if files else None)
