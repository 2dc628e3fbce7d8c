"""A project's controller on EtherNet/IP, for the built-in scanner: its modules with the connections that it opens.

The project has what Forward_Open needs: the path, the lengths, the identity.  The EDS file at hand counts where it has
that connection with these lengths, because it alone says which data have a header for run and idle.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pnfarm.buses.ethernetip.eds_file import read_eds
from pnfarm.buses.ethernetip.project.generic import configuration_octets, generic_eds, lengths, points
from pnfarm.buses.ethernetip.project.stations import (
    PREFIX,
    EdsFiles,
    address_of,
    connection_of,
    data_connection,
    rpi_of,
)
from pnfarm.buses.imports import FoundController, FoundDevice, FoundStation
from pnfarm.buses.projects.description_folders import DescriptionFile
from pnfarm.errors import ConfigError
from pnfarm.protocols.enip.eds.text import LONGEST

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pnfarm.buses.projects.description_folders import DescriptionFolders
    from pnfarm.buses.projects.l5x import L5xConnection, L5xModule, L5xProject

__all__ = ["controller_of_project"]


def controller_of_project(
    project: L5xProject, folders: DescriptionFolders, base: Path, plc: str | None
) -> FoundController:
    """See :meth:`pnfarm.buses.imports.ProjectBus.controller_of_project`."""
    if plc is not None:
        raise ConfigError("an L5X file has one controller: leave --plc out")
    files = EdsFiles(folders)
    modules = [(one, ip) for one in project.modules if (ip := address_of(one)) is not None]
    return FoundController({}, [_module(one, {"ip": f"{ip}/{PREFIX}"}, files, base) for one, ip in modules])


def _module(module: L5xModule, keys: dict[str, Any], files: EdsFiles, base: Path) -> FoundDevice | FoundStation:
    connection = data_connection(module)
    if connection is None:
        return FoundStation(module.name, ("the project has no connection with its data",))
    if rpi := rpi_of(connection):
        keys["rpi"] = rpi
    wrong = ""
    for file, octets in _files(module, connection, files, base):
        try:
            chosen = connection_of(read_eds(octets, file.name), points(module, connection))
        except ConfigError as exc:
            wrong = wrong or str(exc)
            continue
        if chosen is None or (chosen.outputs.size.default, chosen.inputs.size.default) != lengths(module, connection):
            continue
        if count := chosen.configuration.size.default:
            data = _configuration(module)
            if len(data) != count:
                wrong = f"its configuration of {count} octets is not in the project octet by octet"
                continue
            keys["configuration"] = data.hex()
        return FoundDevice(module.name, file, {**keys, "connection": chosen.keyword})
    return FoundStation(module.name, (wrong or "the project does not name the assemblies of its connection",))


def _files(
    module: L5xModule, connection: L5xConnection, files: EdsFiles, base: Path
) -> Iterator[tuple[DescriptionFile, bytes]]:
    """The maker's file, and one made of the project, with their octets."""
    if (file := files.of(module)) is not None:
        yield file.for_farm("eds", base, LONGEST), file.octets(LONGEST)
    if (made := generic_eds(module, connection)) is not None:
        yield DescriptionFile("eds", "pnfarm-{name}.eds", made), made


def _configuration(module: L5xModule) -> bytes:
    """The octets of its configuration; none where the project has other elements, or not all.

    A generic module has room for 400, of which the first number says how many count.
    """
    head = re.match(r"\[\s*[0-9]+\s*,\s*[0-9]+\s*,\s*\[(?P<octets>[0-9,\s-]*)\]", module.configuration)
    values = [] if head is None else [one.strip() for one in head["octets"].split(",")]
    if not all(re.fullmatch(r"-?[0-9]{1,3}", one) and -128 <= int(one) < 256 for one in values):
        return b""
    return bytes(int(one) % 256 for one in values[: configuration_octets(module)])
