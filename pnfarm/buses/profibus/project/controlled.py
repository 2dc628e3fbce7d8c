"""A project's PLC on PROFIBUS, for the built-in master: its address, and its slaves as it expects them.

A slave whose modules are not all in its GSD file is not run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import FoundController, FoundDevice, FoundStation
from pnfarm.buses.profibus.config.drive import HIGHEST_ADDRESS
from pnfarm.buses.profibus.found import LINE
from pnfarm.buses.profibus.gsd_file import read_gsd
from pnfarm.buses.profibus.project.stations import address_in, plugged_modules, slots_of
from pnfarm.buses.projects.parts import head_of_file, is_on_profibus, only_system, type_of
from pnfarm.buses.projects.view import ProjectView
from pnfarm.errors import ConfigError
from pnfarm.protocols.profibus.gsd.statements import LONGEST

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.buses.projects.caex import CaexElement, CaexProject
    from pnfarm.buses.projects.description_folders import DescriptionFolders

__all__ = ["controller_of_project"]


def controller_of_project(
    project: CaexProject, folders: DescriptionFolders, base: Path, plc: str | None
) -> FoundController:
    """See :meth:`pnfarm.buses.imports.ProjectBus.controller_of_project`."""
    view = ProjectView(project)
    systems = view.io_systems(plc)
    master = only_system(systems, "Profibus")
    address = None if master is None else address_in(master)
    stations = [one for one in view.stations_of(systems) if is_on_profibus(one)]
    return FoundController(
        {} if address is None else {"address": address}, [_slave(one, folders, base) for one in stations]
    )


def _slave(device: CaexElement, folders: DescriptionFolders, base: Path) -> FoundDevice | FoundStation:
    def refused(why: str, missing: str = "") -> FoundStation:
        return FoundStation(device.name, (why,), LINE, missing=missing)

    head, address = head_of_file(device), address_in(device)
    if head is None:
        return refused("the project names no GSD file for it")
    name = type_of(head).file
    if address is None:
        return refused(f"it has no station address from 0 to {HIGHEST_ADDRESS}")
    if (file := folders.named(name)) is None:
        return refused(f"{name} was not found", name)
    try:
        gsd = read_gsd(file.octets(LONGEST), file.name)
    except ConfigError as exc:
        return refused(str(exc), name)
    left_out: list[str] = []
    slots = slots_of(device, head, gsd, left_out)
    if not left_out:
        # what the file does not allow together
        plugged_modules(gsd, slots, left_out)
    if left_out:
        return refused(left_out[0].removeprefix("left out: ").removesuffix(": left out"))
    modules = [slots.get(slot) for slot in range(1, max(slots, default=0) + 1)]
    keys: dict[str, Any] = {"address": address, "modules": modules}
    return FoundDevice(device.name, file.for_farm("gsd", base, LONGEST), keys, line=LINE)
