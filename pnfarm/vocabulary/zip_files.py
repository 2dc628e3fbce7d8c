"""Zip files that are not trusted: members and their octets, or one kind of error."""

from __future__ import annotations

import zipfile
import zlib
from contextlib import contextmanager
from pathlib import PurePosixPath
from typing import IO, TYPE_CHECKING

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

__all__ = ["DamagedZipError", "unpack_zip", "zip_member", "zip_names"]

#: Octets that are unpacked at once.
_PIECE = 1 << 20
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


def unpack_zip(file: Path | IO[bytes], folder: Path, most_members: int, most_octets: int) -> None:
    """All its files into an empty folder, links as files with their texts.

    Raises :class:`DamagedZipError`, also for a member that would be elsewhere, and for too much.
    """
    left = most_octets
    with _opened(file) as archive:
        members = archive.infolist()
        if len(members) > most_members:
            raise DamagedZipError(f"it has {len(members)} members; at most {most_members}")
        for member in members:
            path = PurePosixPath(member.filename)
            if path.is_absolute() or ".." in path.parts or "\\" in member.filename:
                raise DamagedZipError(f"member {member.filename[:100]!r} would be outside of the folder")
            if member.is_dir():
                continue
            place = folder / path
            place.parent.mkdir(parents=True, exist_ok=True)
            with archive.open(member) as part, place.open("xb") as whole:
                while piece := part.read(min(_PIECE, left + 1)):
                    left -= len(piece)
                    if left < 0:
                        raise DamagedZipError(f"unpacked, it has more than {most_octets} octets")
                    whole.write(piece)
