"""A farm file with the settings of ``pnfarm up``'s flags and environment."""

from __future__ import annotations

from typing import Any

from pnfarm.cli.commands import up
from pnfarm.farm.file.reading import FarmConfig, parse_farm


class _Context:
    """Where the command line's values come from."""

    def __init__(self, **sources: str) -> None:
        self._sources = sources

    def get_parameter_source(self, name: str) -> Any:
        return type("Source", (), {"name": self._sources.get(name, "COMMANDLINE")})


def overridden(text: str, given: dict[str, Any], **sources: str) -> FarmConfig:
    """``sources``: where a value comes from by its name, the command line where left out."""
    return up._overridden(_Context(**sources), parse_farm(text), given)
