"""GSD files from disk."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from pnfarm.buses.description_file import load_description, read_description
from pnfarm.protocols.profibus.gsd.reader import parse_gsd_file
from pnfarm.protocols.profibus.gsd.statements import LONGEST

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.protocols.profibus.gsd.document import Gsd

__all__ = ["load_gsd", "read_gsd"]

#: A farm's many groups and a master's many slaves have a few files.
_parsed = lru_cache(maxsize=8)(parse_gsd_file)


def load_gsd(path: Path) -> Gsd:
    """Raises :class:`~pnfarm.errors.ConfigError`."""
    return load_description("GSD", path, LONGEST, _parsed)


def read_gsd(data: bytes, name: str) -> Gsd:
    """The same of octets, which are a file of this name."""
    return read_description(name, data, _parsed)
