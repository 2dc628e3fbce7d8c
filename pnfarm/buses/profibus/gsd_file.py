"""GSD files from disk."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError, DecodeError
from pnfarm.protocols.profibus.gsd.reader import parse_gsd_file
from pnfarm.protocols.profibus.gsd.statements import LONGEST
from pnfarm.vocabulary.regular_file import read_regular

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.protocols.profibus.gsd.document import Gsd

__all__ = ["load_gsd"]

#: A farm's many groups and a master's many slaves have a few files.
_parsed = lru_cache(maxsize=8)(parse_gsd_file)


def load_gsd(path: Path) -> Gsd:
    """Read a file; :class:`ConfigError` with its name, and what is wrong where, if it is none of a slave."""
    try:
        data = read_regular(path, LONGEST + 1)
    except OSError as exc:
        raise ConfigError(f"the GSD file {path} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    try:
        return _parsed(data)
    except DecodeError as exc:
        raise ConfigError(f"{path}, {exc.detail or exc.reason}") from exc
