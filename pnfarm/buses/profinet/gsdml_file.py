"""GSDML files from disk."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError, DecodeError
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.safe_xml import MAX_OCTETS
from pnfarm.vocabulary.regular_file import read_regular

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.protocols.profinet.gsdml.document import Gsdml

__all__ = ["load_gsdml"]

#: A farm's many groups and a project's many devices have a few files.
_parsed = lru_cache(maxsize=8)(parse_gsdml)


def load_gsdml(path: Path) -> Gsdml:
    """Read a file; :class:`ConfigError` with its name, and what is wrong where, if it is not a GSDML file."""
    try:
        data = read_regular(path, MAX_OCTETS + 1)
    except OSError as exc:
        raise ConfigError(f"the GSDML file {path} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    try:
        return _parsed(data, path.name)
    except DecodeError as exc:
        raise ConfigError(f"{path}, {exc.detail or exc.reason}") from exc
