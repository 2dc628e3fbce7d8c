"""The PROFINET stations of an engineering project: drives, devices by their GSDML files, and what is neither."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.buses.imports import FoundStation, Said, drives_first
from pnfarm.buses.profinet.project.device import project_device
from pnfarm.buses.profinet.project.drive import drive_by_file, drive_by_name, profile_drive
from pnfarm.buses.profinet.project.files import GsdmlFiles, UndescribedError, with_maker
from pnfarm.buses.profinet.project.parts import address_keys, head_of, name_notes, name_of
from pnfarm.buses.projects.parts import devices, facts, is_on_profibus, type_of
from pnfarm.buses.projects.view import ProjectView

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pnfarm.buses.imports import Found
    from pnfarm.buses.projects.caex import CaexElement, CaexProject
    from pnfarm.buses.projects.description_folders import DescriptionFolders

__all__ = ["of_project"]


def of_project(project: CaexProject, folders: DescriptionFolders, base: Path) -> Iterator[Found]:
    """Drives first, then devices, then stations that become neither.

    GSDML files are searched in ``folders``; a farm file that names one is in ``base``.
    """
    view = ProjectView(project)
    found = _Stations(view, GsdmlFiles(folders, base))
    return drives_first(
        made
        if isinstance(made, FoundStation)
        else replace(made, notes=(*name_notes(device), *_topology_notes(device, view), *made.notes))
        for device in devices(project.root)
        if not is_on_profibus(device)
        for made in (found.of(device),)
    )


def _topology_notes(device: CaexElement, view: ProjectView) -> tuple[str, ...]:
    """The PLC checks the project's topology, and a farm's stations have the neighbours of their wire."""
    cables = [f"{port} with {far} of {name_of(other)}" for port, far, other in view.cables(device)]
    if not cables:
        return ()
    why = "a PLC that checks it reports a remote mismatch unless the farm's wire has the same neighbours"
    return (f"the project's topology connects {', '.join(cables)}: {why}",)


class _Stations:
    def __init__(self, project: ProjectView, files: GsdmlFiles) -> None:
        self._project = project
        self._files = files

    def of(self, device: CaexElement) -> Found:
        head = head_of(device, self._project)
        if head is None:
            return self._station(device, tuple(facts(device)))
        kind = type_of(head)
        try:
            found = self._files.of(kind)
        except UndescribedError as exc:
            by_name = drive_by_name(device, kind.file) if kind.file else None
            return by_name or self._station(device, (str(exc), *facts(device)), exc.missing)
        file, document, dap = self._files.for_farm(found.file), found.document, found.dap
        # a head that the project names by order number is Siemens', which are no drives here
        if kind.file and (drive := drive_by_file(device, kind, document, file)) is not None:
            return drive
        if dap is None:
            why = f"{found.file.name} has no access point {kind.id!r}"
            return self._station(device, (why, *facts(device)), with_maker(kind.file))
        if kind.file and (drive := profile_drive(device, head, document, dap, file)) is not None:
            return drive
        made = project_device(device, head, document, dap, file, self._project.tags(device))
        remarks = (found.remark,) if found.remark else ()
        return replace(made, notes=(*remarks, *made.notes), doubts=(*remarks, *made.doubts))

    @staticmethod
    def _station(device: CaexElement, told: tuple[str, ...], missing: str = "") -> FoundStation:
        name = name_of(device)
        return FoundStation(name, told, missing=missing, keys=address_keys(device), said=Said(name=name))
