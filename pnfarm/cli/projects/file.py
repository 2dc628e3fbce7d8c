"""Engineering projects as files: of which kind one is, and the buses that find their stations in it."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnfarm.buses import registry
from pnfarm.buses.imports import ProjectBus
from pnfarm.buses.projects.caex import MAX_OCTETS, NotCaexError, is_project, parse_caex
from pnfarm.buses.projects.description_folders import DescriptionFolders
from pnfarm.buses.projects.hwl import MAX_FILES, SUFFIXES, NotHwlError, parse_hwl
from pnfarm.buses.projects.l5x import NotL5xError, is_l5x, parse_l5x
from pnfarm.errors import ConfigError
from pnfarm.vocabulary.regular_file import read_regular
from pnfarm.vocabulary.yaml_lines import MAX_OCTETS as MAX_YAML_OCTETS

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["READ", "description_folders", "is_project_file", "read_project"]

#: Octets in which the root of an XML file begins.
_HEAD = 4096
#: Projects that are not read, by the ends of their names and by their roots, and what to do instead.
_BY_NAME = {
    r"\.z?ap[0-9]{2}(?:_[0-9])?": "a project of TIA Portal: export its CAx data (.aml)",
    r"\.s7p": "a project of STEP 7: move it to TIA Portal, and export its CAx data (.aml)",
    r"\.acd": "a project of Studio 5000: save it as L5X",
    r"\.project(?:archive)?": "a project of CODESYS, which is not read",
    r"\.(?:tsproj|tnzip)": "a project of TwinCAT, which is not read",
}
_BY_ROOT = {
    b"<ExportFile": "an export of CODESYS, which is not read",
    b"www.plcopen.org/xml/": "PLCopen XML, which has programs, and devices only in additions of each tool: not read",
    b"<Engineering version=": "XML of TIA Portal's blocks: export the project's CAx data (.aml) instead",
    b"<TcSmProject": "a project of TwinCAT, which is not read",
    b"<TcSmItem": "a part of a project of TwinCAT, which is not read",
}
#: What is read, as an end of a refusal.
READ = "supported are CAx data (.aml, .amlx), L5X, and SIMATIC AX (.hwl.yml)"


def is_project_file(file: Path) -> bool:
    """Whether it is a project, and no capture.  Raises :class:`ConfigError` for one that cannot be read."""
    if _is_hwl(file):
        return True
    for ending, what in _BY_NAME.items():
        if re.search(f"{ending}$", file.name.lower()):
            raise ConfigError(f"{file} is {what}; {READ}")
    try:
        with file.open("rb") as begin:
            return is_project(begin.read(16))
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc


def description_folders(file: Path, folders: Sequence[Path]) -> DescriptionFolders:
    """Makers' files in these folders, and beside a project or in its folder."""
    return DescriptionFolders([*folders, file] if file.is_dir() else folders, None if file.is_dir() else file.parent)


def read_project(file: Path) -> tuple[list[ProjectBus], Any]:
    """The buses that read projects of this kind, and the project.  Raises :class:`ConfigError`."""
    if not is_project_file(file):
        raise ConfigError(f"{file} is no engineering project; {READ}")
    try:
        kind, project = _read(file)
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    buses = [bus for bus in registry.BUSES.values() if isinstance(bus, ProjectBus) and bus.project_kind == kind]
    return buses, project


def _read(file: Path) -> tuple[str, Any]:
    try:
        if _is_hwl(file):
            return "caex", parse_hwl(_hwl_files(file))
        data = read_regular(file, MAX_OCTETS + 1)
        if is_l5x(data[:_HEAD]):
            return "l5x", parse_l5x(data)
        for root, what in _BY_ROOT.items():
            if root in data[:_HEAD] and b"<CAEXFile" not in data[:_HEAD]:
                raise ConfigError(f"{file} is {what}; {READ}")
        return "caex", parse_caex(data)
    except NotHwlError as exc:
        raise ConfigError(f"{file} is not read as hardware of SIMATIC AX: {exc}") from exc
    except NotCaexError as exc:
        raise ConfigError(f"{file} is not CAx data: {exc}") from exc
    except NotL5xError as exc:
        raise ConfigError(f"{file} is not an L5X file: {exc}") from exc


def _is_hwl(file: Path) -> bool:
    return file.name.lower().endswith(SUFFIXES) or file.is_dir()


def _hwl_files(file: Path) -> dict[str, bytes]:
    """The file, or all such files in the folder and below it; links to folders are not followed."""
    if not file.is_dir():
        return {file.name: read_regular(file, MAX_YAML_OCTETS + 1)}
    found: dict[str, bytes] = {}
    looked = 0
    for place, _, names in os.walk(file):
        looked += len(names)
        for one in (Path(place) / name for name in names if name.lower().endswith(SUFFIXES)):
            found[str(one.relative_to(file))] = read_regular(one, MAX_YAML_OCTETS + 1)
        if len(found) > MAX_FILES or looked > 100 * MAX_FILES:
            raise ConfigError(f"{file} has more than {MAX_FILES} files of SIMATIC AX, or {100 * MAX_FILES} of any kind")
    return found
