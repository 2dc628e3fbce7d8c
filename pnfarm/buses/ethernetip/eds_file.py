"""EDS files from disk."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from pnfarm.buses.description_file import load_description, read_description
from pnfarm.protocols.enip.eds.reader import parse_sheet
from pnfarm.protocols.enip.eds.text import LONGEST

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.protocols.enip.eds.document import Sheet

__all__ = ["load_eds", "read_eds"]

#: A farm's many groups have a few files.
_parsed = lru_cache(maxsize=8)(parse_sheet)


def load_eds(path: Path) -> Sheet:
    """Raises :class:`~pnfarm.errors.ConfigError`."""
    return load_description("EDS", path, LONGEST, _parsed)


def read_eds(data: bytes, name: str) -> Sheet:
    """The same of octets, which are a file of this name."""
    return read_description(name, data, _parsed)
