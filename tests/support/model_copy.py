"""A copy of a model's product, for tests that change its files."""

from __future__ import annotations

import re
import shutil
from typing import TYPE_CHECKING

from pnfarm.drives.catalogue import SHIPPED_FOLDER, models

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["SHIPPED", "copy_model", "drop_section", "file_of", "files_of", "rewrite"]

#: The models that come with the program.
SHIPPED = sorted(name for name, entry in models().items() if SHIPPED_FOLDER in entry.folder.parents)


def copy_model(name: str, place: Path) -> Path:
    """Copy a model's product into ``place``, without its other models; gives the model's own folder in it."""
    folder = models()[name].folder
    root = next(path for path in (folder, *folder.parents) if path.parent == SHIPPED_FOLDER)
    shutil.copytree(root, place)
    own = place / folder.relative_to(root)
    for other in list(place.rglob("model.toml")):
        if other.parent != own:
            shutil.rmtree(other.parent)
    return own


def file_of(folder: Path, name: str) -> Path:
    """The file of this name that the model of ``folder`` reads: its own, or that of its bus or product."""
    return files_of(folder, name)[0]


def files_of(folder: Path, name: str) -> list[Path]:
    """All files of this name that make the model, its own first; with ``model.toml`` those of its kind."""
    names = ("model.toml", "bus.toml", "axis.toml") if name == "model.toml" else (name,)
    return [path for place in (folder, *folder.parents) for each in names if (path := place / each).exists()]


def rewrite(folder: Path, name: str, old: str, new: str, count: int = 1) -> Path:
    """Replace text in that one of :func:`files_of` that contains it; gives the file."""
    path = next(path for path in files_of(folder, name) if old in path.read_text(encoding="utf-8"))
    path.write_text(path.read_text(encoding="utf-8").replace(old, new, count), encoding="utf-8")
    return path


def drop_section(folder: Path, name: str) -> None:
    """Take a section out of all files of the model of ``folder``."""
    for path in files_of(folder, "model.toml"):
        text = path.read_text(encoding="utf-8")
        path.write_text(re.sub(rf"(?m)^\[{name}\]\n(?:(?!\[).*\n?)*", "", text), encoding="utf-8")
