"""Makers' description files from disk."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from pnfarm.errors import ConfigError, DecodeError
from pnfarm.vocabulary.regular_file import read_regular

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

__all__ = ["load_description", "read_description"]

T = TypeVar("T")


def load_description(kind: str, path: Path, longest: int, parse: Callable[[bytes], T]) -> T:
    """What a file of a kind (``GSD``) says; :class:`ConfigError` with its name, and what is wrong where."""
    try:
        data = read_regular(path, longest + 1)
    except OSError as exc:
        raise ConfigError(f"the {kind} file {path} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    return read_description(str(path), data, parse)


def read_description(name: str, data: bytes, parse: Callable[[bytes], T]) -> T:
    """The same of octets, which are a file of this name."""
    try:
        return parse(data)
    except DecodeError as exc:
        raise ConfigError(f"{name}, {exc.detail or exc.reason}") from exc
