"""Reading the files of a model's folder, and saying where a mistake is.

Whatever is wrong in them is a :class:`~pnfarm.errors.ConfigError` that names file, row and field.
"""

from __future__ import annotations

import csv
import tomllib
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

__all__ = ["integer", "read_toml", "required", "rows"]


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file; :class:`ConfigError` with its name if it cannot be read."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as exc:
        raise ConfigError(f"{path}: {exc}") from exc


def rows(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """The rows of a CSV file with a place for error messages."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            for row in (reader := csv.DictReader(file)):
                where = f"{path}, line {reader.line_num}"
                if None in row or None in row.values():
                    raise ConfigError(f"{where}: {len(reader.fieldnames or ())} columns are wanted")
                yield where, row
    except OSError as exc:
        raise ConfigError(f"{path}: {exc}") from exc


def integer(text: str, where: str, field: str, default: int | None = None) -> int:
    """A number as Python writes it, ``default`` for an empty field."""
    if not text and default is not None:
        return default
    try:
        return int(text, 0)
    except ValueError:
        raise ConfigError(f"{where}, {field}: {text!r} is not a number") from None


def required(table: Mapping[str, Any], key: str, where: str) -> Any:
    """The value of a key that must be there."""
    try:
        return table[key]
    except KeyError:
        raise ConfigError(f"{where}, {key}: missing") from None
