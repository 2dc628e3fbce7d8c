"""Makers' description files in folders, with all below them and in zip files there, and beside a file.

Folders are not trusted more than any input: links to folders are not followed, files and octets are bounded, and of a
zip file's member only the last part of its name counts.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.vocabulary.regular_file import read_regular
from pnfarm.vocabulary.zip_files import DamagedZipError, zip_member, zip_names

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

__all__ = ["DescriptionFile", "DescriptionFolders", "FileAtHand"]

#: Of GSDML, EDS and GSD files, the last with letters for languages.
SUFFIXES = frozenset({".xml", ".eds", ".gsd", ".gse", ".gsg", ".gsf", ".gsi", ".gsp", ".gss"})
#: Files of all folders, those in zip files among them; engineering tools keep some thousand.
MOST_FILES = 50_000


@dataclass(frozen=True, slots=True)
class DescriptionFile:
    """``key``: that of a group which names such a file; ``{name}`` in ``name`` is the station's in the farm.

    ``octets`` are to be written into it, None where the file is there.
    """

    key: str
    name: str
    octets: bytes | None


@dataclass(frozen=True, slots=True)
class FileAtHand:
    """``path`` is the file, or the zip file of which it is ``member``."""

    path: Path
    member: str = ""

    @property
    def name(self) -> str:
        return PurePosixPath(self.member.replace("\\", "/")).name if self.member else self.path.name

    def octets(self, most: int) -> bytes:
        """Raises :class:`ConfigError` where it cannot be read, or is longer."""
        where = f"{self.name} in {self.path}" if self.member else str(self.path)
        try:
            data = self._whole(most + 1)
        except DamagedZipError as exc:
            raise ConfigError(f"{where} cannot be read: {exc}") from exc
        except OSError as exc:
            raise ConfigError(f"{where} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
        if len(data) > most:
            raise ConfigError(f"{where} is longer than {most} octets")
        return data

    def for_farm(self, key: str, base: Path, most: int) -> DescriptionFile:
        """How a farm file in the folder ``base`` names it; one of a zip file is to be written beside that."""
        if self.member:
            return DescriptionFile(key, self.name, self.octets(most))
        near = self.path.is_relative_to(base)
        return DescriptionFile(key, str(self.path.relative_to(base) if near else self.path.resolve()), None)

    def _whole(self, most: int) -> bytes:
        return zip_member(self.path, self.member, most) if self.member else read_regular(self.path, most)


class DescriptionFolders:
    """Those of ``folders`` and of what is below them, and those of the folder ``beside`` alone; of two with one name
    the first counts.

    Raises :class:`ConfigError` for a folder that cannot be read, or too many files.
    """

    def __init__(self, folders: Sequence[Path], beside: Path) -> None:
        #: What could not be read.
        self.remarks: list[str] = []
        self._by_name: dict[str, FileAtHand] = {}
        for folder in (*folders, beside):
            for one in self._of(folder, deep=folder is not beside):
                self._by_name.setdefault(one.name.lower(), one)
                if len(self._by_name) > MOST_FILES:
                    raise ConfigError(f"{folder} and those before it have more than {MOST_FILES} description files")

    def __iter__(self) -> Iterator[FileAtHand]:
        return iter(self._by_name.values())

    def contents(self, suffix: str, most: int) -> Iterator[tuple[FileAtHand, bytes]]:
        """The files with this suffix and their octets, without those that cannot be read or are longer."""
        for one in self:
            if not one.name.lower().endswith(suffix):
                continue
            try:
                octets = one.octets(most)
            except ConfigError as exc:
                self.remarks.append(str(exc))
            else:
                yield one, octets

    def named(self, name: str) -> FileAtHand | None:
        """The file of this name, in upper or lower case."""
        return self._by_name.get(name.lower())

    def _of(self, folder: Path, *, deep: bool) -> Iterator[FileAtHand]:
        def refuse(error: OSError) -> None:
            if error.filename == str(folder):
                raise ConfigError(
                    f"the folder {folder} cannot be read: {(error.strerror or str(error)).lower()}"
                ) from error

        looked = 0
        for place, below, names in os.walk(folder, onerror=refuse):
            below[:] = sorted(below) if deep else ()
            looked += len(names)
            if looked > MOST_FILES:
                raise ConfigError(f"{folder} has more than {MOST_FILES} files")
            for name in sorted(names):
                file = Path(place) / name
                if file.suffix.lower() in SUFFIXES:
                    yield FileAtHand(file)
                elif file.suffix.lower() == ".zip":
                    yield from self._in_zip(file)

    def _in_zip(self, file: Path) -> Iterator[FileAtHand]:
        """Those of a zip file; one that is damaged has none."""
        try:
            members = zip_names(file, MOST_FILES)
        except DamagedZipError as exc:
            self.remarks.append(f"{file} cannot be read: {exc}")
            return
        for member in members:
            if PurePosixPath(member.replace("\\", "/")).suffix.lower() in SUFFIXES:
                yield FileAtHand(file, member)
