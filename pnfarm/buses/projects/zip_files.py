"""Zip files that are not trusted: members and their octets, or one kind of error."""

from __future__ import annotations

import zipfile
import zlib
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

__all__ = ["DamagedZipError", "zip_member", "zip_names"]

#: What `zipfile` raises for a damaged or foreign file: no archive (BadZipFile), damaged data (zlib.error, EOFError), a
#: compression that it does not know (NotImplementedError), a member with a password (RuntimeError), a place or a name
#: that cannot be (ValueError), and what the system says of the file (OSError).
_DAMAGES = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, OSError)


class DamagedZipError(ConfigError):
    """A zip file, or a member of it, cannot be read."""


@contextmanager
def _opened(file: Path | IO[bytes]) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(file) as archive:
            yield archive
    except _DAMAGES as exc:
        raise DamagedZipError(exc.strerror.lower() if isinstance(exc, OSError) and exc.strerror else str(exc)) from exc


def zip_names(file: Path | IO[bytes], most: int) -> list[str]:
    """The names of its first members; raises :class:`DamagedZipError`."""
    with _opened(file) as archive:
        return archive.namelist()[:most]


def zip_member(file: Path | IO[bytes], name: str, most: int) -> bytes:
    """The first octets of a member, unpacked; raises :class:`DamagedZipError`."""
    with _opened(file) as archive, archive.open(name) as part:
        return part.read(most)
