"""GSDML files of a project's devices: by name, or by the order number of an access point."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.gsdml_file import load_gsdml, read_gsdml
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.safe_xml import MAX_OCTETS

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.buses.projects.description_folders import DescriptionFile, DescriptionFolders, FileAtHand
    from pnfarm.buses.projects.parts import PartType
    from pnfarm.protocols.profinet.gsdml.document import Dap, Gsdml

__all__ = ["FileOfHead", "GsdmlFiles", "UndescribedError", "is_of_version", "plain_number", "with_maker"]

_ORDER_NUMBER = re.compile(rb'OrderNumber\s+Value\s*=\s*"([^"]{1,60})"')
#: Files with one order number that are read; makers have one for each firmware version.
_MOST_ALIKE = 20


def plain_number(order_number: str) -> str:
    """Without blanks, which makers set differently."""
    return "".join(order_number.split()).upper()


def is_of_version(version: str, *texts: str) -> bool:
    """Whether a text names a firmware version, such as ``V3.3`` or a longer number that begins so."""
    digits = version.strip().lstrip("Vv")
    return bool(digits) and any(re.search(rf"(?<![\d.]){re.escape(digits)}(?!\d)", text) for text in texts)


class UndescribedError(ConfigError):
    """No file that was found describes a device; ``missing`` is the one that would do, with its maker."""

    def __init__(self, why: str, missing: str) -> None:
        super().__init__(why)
        self.missing = missing


@dataclass(frozen=True, slots=True)
class FileOfHead:
    """The file with the access point that a project names; ``dap`` is None where the file has no such one.

    ``remark``: what is not as in the project.
    """

    file: FileAtHand
    document: Gsdml
    dap: Dap | None
    remark: str = ""


class GsdmlFiles:
    """Files in ``folders``; a farm file that names one is in ``base``."""

    def __init__(self, folders: DescriptionFolders, base: Path) -> None:
        self._folders = folders
        self._base = base
        self._known: dict[FileAtHand, Gsdml] = {}

    def of(self, kind: PartType) -> FileOfHead:
        """The file of a head with this type, by its name, else by its order number.

        Raises :class:`UndescribedError`.
        """
        if not kind.file:
            return self._ordered(kind.order_number, kind.version)
        file, missing = self._folders.named(kind.file), with_maker(kind.file)
        if file is None:
            raise UndescribedError(f"{kind.file} was not found", missing)
        try:
            document = self._document(file)
        except ConfigError as exc:
            raise UndescribedError(str(exc), missing) from exc
        return FileOfHead(
            file, document, next((one for one in document.daps if one.id.lower() == kind.id.lower()), None)
        )

    def _document(self, file: FileAtHand) -> Gsdml:
        """Raises :class:`ConfigError`."""
        if not file.member:
            return load_gsdml(file.path)
        if file not in self._known:
            self._known[file] = read_gsdml(file.octets(MAX_OCTETS), file.name)
        return self._known[file]

    def for_farm(self, file: FileAtHand) -> DescriptionFile:
        """How the farm file names it."""
        return file.for_farm("gsdml", self._base, MAX_OCTETS)

    def _ordered(self, order_number: str, version: str) -> FileOfHead:
        """The access point with this order number: of the version, else of the file that is last by name."""
        first: FileOfHead | None = None
        wanted = plain_number(order_number)
        for file in self._by_number.get(wanted, ())[:_MOST_ALIKE]:
            try:
                document = self._document(file)
            except ConfigError:
                # another file may have it, else it is missing
                continue
            for dap in reversed(document.daps):
                if plain_number(dap.info.order_number) != wanted:
                    continue
                if is_of_version(version, dap.info.software_release, dap.info.name, dap.id):
                    return FileOfHead(file, document, dap)
                remark = f"{file.name} has no version {version}: {dap.info.name or dap.id} is taken"
                first = first or FileOfHead(file, document, dap, remark)
        if first is None:
            named = f"{order_number} {version}".strip()
            raise UndescribedError(
                f"no GSDML file that was found has {named}", f"a GSDML file with {named}, of Siemens"
            )
        return first

    @cached_property
    def _by_number(self) -> dict[str, list[FileAtHand]]:
        """By order number without blanks, the last by name first."""
        found: dict[str, list[FileAtHand]] = {}
        for file, data in self._folders.contents(".xml", MAX_OCTETS):
            for number in {plain_number(one.decode("latin-1")) for one in _ORDER_NUMBER.findall(data)}:
                found.setdefault(number, []).append(file)
        for files in found.values():
            files.sort(key=lambda one: one.name.lower(), reverse=True)
        return found


def with_maker(file: str) -> str:
    """What is missing: a file's name, and its maker by that (``GSDML-V2.3-MAKER-family-date.xml``)."""
    parts = file.split("-")
    return f"{file}, of {parts[2] if len(parts) > 3 else 'an unknown maker'}"
