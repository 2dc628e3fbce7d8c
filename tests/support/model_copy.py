"""A copy of a model's product, for tests that change its files."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

from pnfarm.drives.catalogue import SHIPPED_FOLDER, models

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["SHIPPED", "copy_model", "file_of", "rewrite"]

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
    return next(path for place in (folder, *folder.parents) if (path := place / name).exists())


def rewrite(folder: Path, name: str, old: str, new: str, count: int = 1) -> Path:
    """Replace text in a file of the model of ``folder``, where it stands; gives the file."""
    path = file_of(folder, name)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, count), encoding="utf-8")
    return path
