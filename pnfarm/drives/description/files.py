"""The files of a model, and the places in them for error messages.

A model is a product on a bus.  The product's folder holds ``axis.toml`` and the data that are the same on every bus; a
subfolder holds what one bus adds, and a subfolder of that one edition of the bus's manual, if there are several.
The model's own folder is the one with ``model.toml``.  A folder with ``model.toml`` and no product above it is a
whole model.

A file of the same name in a subfolder adds to the one above it, row by row and key by key, and overrides it.  Every
mistake is a :class:`~pnfarm.errors.ConfigError` that names file, line and field.
"""

from __future__ import annotations

import csv
import re
import tomllib
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from pathlib import Path

    #: A place in a file, or a function that finds it for an error message.
    Where = str | Callable[[], str]

__all__ = [
    "MODEL_FILE",
    "ModelFiles",
    "Table",
    "flat",
    "integer",
    "joined_tables",
    "line_of",
    "place_of",
    "read_toml",
    "required",
    "rows",
]

#: In a model's own folder.
MODEL_FILE = "model.toml"
#: In a product's folder.
PRODUCT_FILE = "axis.toml"
#: A bus's folder lies in the product's, an edition's in the bus's.
DEPTH = 2


class ModelFiles:
    """The folders of a model, the product's first, its own last."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        chain = [folder, *folder.parents[:DEPTH]]
        product = next((index for index, place in enumerate(chain) if (place / PRODUCT_FILE).exists()), 0)
        self.folders = chain[product::-1]
        self._tomls: dict[Path, dict[str, Any]] = {}

    def named(self, name: str) -> list[Path]:
        """The files of this name, the product's first."""
        return [path for folder in self.folders if (path := folder / name).exists()]

    def tomls(self, name: str) -> list[tuple[Path, dict[str, Any]]]:
        """As :meth:`named`, each file with its content; a file is read once."""
        found = self.named(name)
        for path in found:
            if path not in self._tomls:
                self._tomls[path] = read_toml(path)
        return [(path, self._tomls[path]) for path in found]

    def wanted(self, name: str) -> list[Path]:
        """As :meth:`named`; :class:`ConfigError` if there is none."""
        found = self.named(name)
        if not found:
            raise ConfigError(f"{self.folder / name}: no such file, nor one above it in the product's folder")
        return found


def place_of(where: Where) -> str:
    """A place as text."""
    return where if isinstance(where, str) else where()


# CSV


class _Row(dict[str, str]):
    """The cells of a row by their columns; another column is an error of the file."""

    def __init__(self, cells: Iterable[tuple[str, str]], where: str) -> None:
        super().__init__(cells)
        self._where = where

    def __missing__(self, column: str) -> str:
        raise ConfigError(f"{self._where}, {column}: missing; the file's columns are {', '.join(self)}")


def rows(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """The rows of a CSV file with a place for error messages."""
    try:
        # spreadsheets begin a UTF-8 file with a byte order mark
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            columns = next(reader, [])
            for cells in filter(None, reader):
                where = f"{path}, line {reader.line_num}"
                if len(cells) != len(columns):
                    raise ConfigError(f"{where}: must have {len(columns)} columns")
                yield where, _Row(zip(columns, cells, strict=True), where)
    except (OSError, UnicodeDecodeError, csv.Error) as exc:
        raise ConfigError(f"{path}: {exc}") from exc


def integer(text: str, where: str, field: str, default: int | None = None) -> int:
    """A number as Python writes it, ``default`` for an empty field."""
    if not text and default is not None:
        return default
    try:
        return int(text, 0)
    except ValueError:
        raise ConfigError(f"{where}, {field}: {text!r} is not a number") from None


# TOML


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file; :class:`ConfigError` with its name if it cannot be read."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as exc:
        raise ConfigError(f"{path}: {exc}") from exc


def required(table: Mapping[str, Any], key: str, where: str) -> Any:
    """The value of a key that must be there."""
    try:
        return table[key]
    except KeyError:
        raise ConfigError(f"{where}, {key}: missing") from None


def line_of(path: Path, section: str, key: str = "") -> int:
    """The line of a section's key, or of the section; 0 if it is written in another form."""
    here = not section
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if header := re.fullmatch(r"\[+([^\[\]]+)\]+\s*(#.*)?", line):
            here = header[1] == section
            if here and not key:
                return number
        elif here and key and re.match(rf'"?{re.escape(key)}"?\s*=', line):
            return number
    return 0


def flat(table: Mapping[str, Any]) -> dict[str, Any]:
    """The entries of a table whose keys are fields of the axis, by those fields: TOML makes tables of their parts.

    An entry is a value, or a table with the key ``value``.
    """
    found: dict[str, Any] = {}
    for key, entry in table.items():
        if isinstance(entry, dict) and "value" not in entry:
            found |= {f"{key}.{inner}": value for inner, value in flat(entry).items()}
        else:
            found[key] = entry
    return found


class Table(dict[str, Any]):
    """An entry ``[[name]]`` of a list, joined from several files; :meth:`where` says which of them gave a key."""

    def __init__(self, place: str) -> None:
        super().__init__()
        self._place = place
        self._places: dict[str, str] = {}

    def add(self, table: Mapping[str, Any], place: str) -> None:
        """Add another file's keys for the same entry."""
        self.update(table)
        self._places |= dict.fromkeys(table, place)

    def where(self, key: str = "") -> str:
        """The place of a key, or of the entry."""
        return f"{self._places.get(key, self._place)}, {key}" if key else self._place

    def wrong(self, key: str, what: str) -> ConfigError:
        return ConfigError(f"{self.where(key)}: {what}")

    def required(self, key: str) -> Any:
        """The value of a key that must be there."""
        return required(self, key, self._place)


def joined_tables(files: ModelFiles, file: str, name: str, key: str) -> dict[Any, Table]:
    """The entries ``[[name]]`` of all files of this name by their ``key``; later files add keys to an entry."""
    found: dict[Any, Table] = {}
    for path, data in files.tomls(file):
        here: set[Any] = set()
        for index, table in enumerate(data.get(name, ()), 1):
            identity = required(table, key, f"{path}, {name} {index}")
            place = f"{path}, {name} {identity}"
            if identity in here:
                raise ConfigError(f"{place}, {key}: is given twice")
            here.add(identity)
            found.setdefault(identity, Table(place)).add(table, place)
    return found
