"""Engineering projects as files: of which kind one is, and the buses that find their stations in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.buses.imports import ProjectBus

__all__ = ["is_project_file", "read_project"]

#: Octets in which the root of an XML file begins.
_HEAD = 4096


def is_project_file(file: Path) -> bool:
    """Whether it is a project, and no capture.  Raises :class:`ConfigError` for one that cannot be read."""
    from pnfarm.buses.projects.caex import is_project

    try:
        with file.open("rb") as begin:
            return is_project(begin.read(16))
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc


def read_project(file: Path) -> tuple[list[ProjectBus], Any]:
    """The buses that read projects of this kind, and the project.  Raises :class:`ConfigError`."""
    from pnfarm.buses import registry
    from pnfarm.buses.imports import ProjectBus
    from pnfarm.buses.projects.caex import MAX_OCTETS, NotCaexError, parse_caex
    from pnfarm.buses.projects.l5x import NotL5xError, is_l5x, parse_l5x
    from pnfarm.vocabulary.regular_file import read_regular

    try:
        data = read_regular(file, MAX_OCTETS + 1)
        kind, project = ("l5x", parse_l5x(data)) if is_l5x(data[:_HEAD]) else ("caex", parse_caex(data))
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    except NotCaexError as exc:
        raise ConfigError(f"{file} is not CAx data: {exc}") from exc
    except NotL5xError as exc:
        raise ConfigError(f"{file} is not an L5X file: {exc}") from exc
    buses = [bus for bus in registry.BUSES.values() if isinstance(bus, ProjectBus) and bus.project_kind == kind]
    return buses, project
