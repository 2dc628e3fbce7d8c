"""GSDML files from disk."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from pnfarm.buses.description_file import load_description, read_description
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.safe_xml import MAX_OCTETS

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.protocols.profinet.gsdml.document import Gsdml

__all__ = ["load_gsdml", "read_gsdml"]

#: A farm's many groups and a project's many devices have a few files.
_parsed = lru_cache(maxsize=8)(parse_gsdml)


def load_gsdml(path: Path) -> Gsdml:
    """Raises :class:`~pnfarm.errors.ConfigError`."""
    return load_description("GSDML", path, MAX_OCTETS, lambda data: _parsed(data, path.name))


def read_gsdml(data: bytes, name: str) -> Gsdml:
    """The same of octets, which are a file of this name."""
    return read_description(name, data, lambda octets: _parsed(octets, name))
