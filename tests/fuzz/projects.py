"""What an engineering project becomes: its stations for a farm, and its PLC's devices for the built-in controller."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from pathlib import Path

from pnfarm.buses import registry
from pnfarm.buses.imports import ProjectBus
from pnfarm.buses.projects.caex import NotCaexError, parse_caex
from pnfarm.buses.projects.description_folders import DescriptionFolders
from pnfarm.buses.projects.hwl import NotHwlError, parse_hwl
from pnfarm.buses.projects.l5x import NotL5xError, parse_l5x
from pnfarm.errors import ConfigError, DecodeError

__all__ = ["import_caex", "import_hwl", "import_l5x"]

CONFIGS = Path(__file__).parents[2] / "configs"


@cache
def _folders() -> DescriptionFolders:
    return DescriptionFolders([CONFIGS / kind for kind in ("gsdml", "gsd", "eds")], None)


def _read(kind, project) -> None:
    for bus in registry.BUSES.values():
        if isinstance(bus, ProjectBus) and bus.project_kind == kind:
            assert all(one.name is not None for one in bus.of_project(project, _folders(), CONFIGS))
            with suppress(ConfigError):
                bus.controller_of_project(project, _folders(), CONFIGS, None)


def import_caex(data: bytes) -> None:
    """Raises :class:`DecodeError` where the octets are no such project; so do the others."""
    try:
        project = parse_caex(data)
    except NotCaexError as exc:
        raise DecodeError("not-caex") from exc
    _read("caex", project)


def import_l5x(data: bytes) -> None:
    try:
        project = parse_l5x(data)
    except NotL5xError as exc:
        raise DecodeError("not-l5x") from exc
    _read("l5x", project)


def import_hwl(data: bytes) -> None:
    try:
        project = parse_hwl({"a.hwl.yml": data})
    except NotHwlError as exc:
        raise DecodeError("not-hwl") from exc
    _read("caex", project)
