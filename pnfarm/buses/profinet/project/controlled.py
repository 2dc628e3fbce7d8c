"""A project's PLC on PROFINET, for the built-in controller: its address, and its devices as it expects them.

Nothing is chosen here that the project does not say: no drive models, and a device whose modules are not all in its
GSDML file is not run.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import FoundController, FoundDevice, FoundStation
from pnfarm.buses.profinet.project.files import GsdmlFiles, UndescribedError
from pnfarm.buses.profinet.project.parts import address_keys, head_of, name_of
from pnfarm.buses.profinet.project.slots import ProjectSlots
from pnfarm.buses.projects.parts import WATCHDOG_FACTOR, is_on_profibus, only_system, type_of
from pnfarm.buses.projects.view import ProjectView
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.planning import plan_station
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.buses.projects.caex import CaexElement, CaexProject
    from pnfarm.buses.projects.description_folders import DescriptionFolders

__all__ = ["controller_of_project"]

#: What a device gets that can do it; the project has no cycles.
_USUAL_CYCLE_NS = 2_000_000


def controller_of_project(
    project: CaexProject, folders: DescriptionFolders, base: Path, plc: str | None
) -> FoundController:
    """See :meth:`pnfarm.buses.imports.ProjectBus.controller_of_project`."""
    view, files = ProjectView(project), GsdmlFiles(folders, base)
    systems = view.io_systems(plc)
    keys: dict[str, Any] = {}
    if (interface := only_system(systems, "Ethernet")) is not None:
        keys = {"name": name_of(interface), **address_keys(interface)}
        keys.pop("gateway", None)
    found = [
        _station(device, head, files)
        for device in view.stations_of(systems)
        if not is_on_profibus(device) and (head := head_of(device, view)) is not None
    ]
    return FoundController(keys, found)


def _station(device: CaexElement, head: CaexElement, files: GsdmlFiles) -> FoundDevice | FoundStation:
    name, kind = name_of(device), type_of(head)
    try:
        found = files.of(kind)
    except UndescribedError as exc:
        return FoundStation(name, (str(exc),), missing=exc.missing)
    if found.dap is None:
        return FoundStation(name, (f"{found.file.name} has no access point {kind.id!r}",))
    slots = ProjectSlots(found.document, found.dap, device, head)
    # what the file does not allow together is left out, too
    plugged = None if slots.left_out else slots.plugged()
    if plugged is None or slots.left_out:
        return FoundStation(name, (slots.left_out[0].removeprefix("left out: ").removesuffix(": left out"),))
    try:
        cycle_ns = plan_station(plugged).slowed(_USUAL_CYCLE_NS)
    except ConfigError as exc:
        return FoundStation(name, (str(exc),))
    factors = [one.attributes[WATCHDOG_FACTOR] for one in device.walk() if WATCHDOG_FACTOR in one.attributes]
    keys = {
        **address_keys(device),
        **({"watchdog_factor": int(factors[0])} if factors and re.fullmatch("[0-9]{1,4}", factors[0]) else {}),
        "cycle": format_duration(cycle_ns),
        "dap": found.dap.id,
        "modules": {slot: one["module"] if isinstance(one, dict) else one for slot, one in slots.chosen.items()},
        "submodules": {slot: one["submodules"] for slot, one in slots.chosen.items() if isinstance(one, dict)},
    }
    return FoundDevice(name, files.for_farm(found.file), keys, (*filter(None, (found.remark,)), *slots.notes))
