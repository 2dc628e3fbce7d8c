"""The PROFINET stations of an engineering project: drives, devices by their GSDML files, and what is neither."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.buses.imports import FoundStation, Said, drives_first
from pnfarm.buses.profinet.project.device import project_device
from pnfarm.buses.profinet.project.drive import drive_by_file, drive_by_name, profile_drive
from pnfarm.buses.profinet.project.files import GsdmlFiles
from pnfarm.buses.profinet.project.parts import address_keys, head_of, name_of
from pnfarm.buses.projects.parts import devices, facts, is_on_profibus, type_of
from pnfarm.buses.projects.view import ProjectView
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from pnfarm.buses.imports import Found
    from pnfarm.buses.projects.caex import CaexElement, CaexProject
    from pnfarm.buses.projects.description_folders import DescriptionFolders, FileAtHand
    from pnfarm.buses.projects.parts import PartType
    from pnfarm.protocols.profinet.gsdml.document import Dap

__all__ = ["of_project"]


def of_project(project: CaexProject, folders: DescriptionFolders, base: Path) -> Iterator[Found]:
    """Drives first, then devices, then stations that nothing stands for.

    GSDML files are looked for in ``folders``; a farm file that names one is in ``base``.
    """
    found = _Stations(ProjectView(project), GsdmlFiles(folders, base))
    return drives_first(found.of(device) for device in devices(project.root) if not is_on_profibus(device))


class _Stations:
    def __init__(self, project: ProjectView, files: GsdmlFiles) -> None:
        self._project = project
        self._files = files

    def of(self, device: CaexElement) -> Found:
        head = head_of(device, self._project)
        if head is None:
            return self._station(device, tuple(facts(device)))
        kind = type_of(head)
        return self._by_file(device, head, kind) if kind.file else self._by_number(device, head, kind)

    def _by_file(self, device: CaexElement, head: CaexElement, kind: PartType) -> Found:
        file = self._files.named(kind.file)
        missing = f"{kind.file}, of {_maker(kind.file)}"
        if file is None:
            return drive_by_name(device, kind.file) or self._nothing(device, f"{kind.file} is not at hand", missing)
        try:
            document = self._files.document(file)
        except ConfigError as exc:
            return drive_by_name(device, kind.file) or self._nothing(device, str(exc), missing)
        drive = drive_by_file(device, kind, document, self._files.for_farm(file))
        if drive is not None:
            return drive
        dap = next((one for one in document.daps if one.id.lower() == kind.id.lower()), None)
        if dap is None:
            return self._nothing(device, f"{file.name} has no access point {kind.id!r}", missing)
        drive = profile_drive(device, head, document, dap, self._files.for_farm(file))
        if drive is not None:
            return drive
        return self._device(device, head, file, dap)

    def _by_number(self, device: CaexElement, head: CaexElement, kind: PartType) -> Found:
        """A device of Siemens' that the project names by order number."""
        named = f"{kind.order_number} {kind.version}".strip()
        found = self._files.ordered(kind.order_number, kind.version)
        if found is None:
            return self._nothing(device, f"no GSDML file at hand has {named}", f"a GSDML file with {named}, of Siemens")
        remark = f"{found.file.name} has no version {kind.version}: {found.dap.info.name or found.dap.id} is taken"
        return self._device(device, head, found.file, found.dap, () if found.exact else (remark,))

    def _device(
        self, device: CaexElement, head: CaexElement, file: FileAtHand, dap: Dap, remarks: Sequence[str] = ()
    ) -> Found:
        document, tags = self._files.document(file), self._project.tags(device)
        made = project_device(device, head, document, dap, self._files.for_farm(file), tags)
        return replace(made, notes=(*remarks, *made.notes), doubts=(*remarks, *made.doubts))

    def _nothing(self, device: CaexElement, why: str, missing: str) -> FoundStation:
        return self._station(device, (why, *facts(device)), missing)

    @staticmethod
    def _station(device: CaexElement, told: tuple[str, ...], missing: str = "") -> FoundStation:
        name = name_of(device)
        return FoundStation(name, told, missing=missing, keys=address_keys(device), said=Said(name=name))


def _maker(file: str) -> str:
    """``GSDML-V2.3-MAKER-family-date.xml``."""
    parts = file.split("-")
    return parts[2] if len(parts) > 3 else "an unknown maker"
