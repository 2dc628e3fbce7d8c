"""The drive models that come with pnfarm, and those of :data:`MODELS_VARIABLE`; each is read on first use."""

from __future__ import annotations

import difflib
import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.drives.description.files import MODEL_FILE, ModelFiles, required
from pnfarm.drives.description.loader import load_model
from pnfarm.drives.description.sections import NAMING_FILES, joined_data
from pnfarm.errors import ConfigError
from pnfarm.vocabulary.regular_file import beside

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model

__all__ = ["MODELS_VARIABLE", "SHIPPED_FOLDER", "Entry", "model", "models", "models_on"]

#: The models that come with the program, a folder for each product.
SHIPPED_FOLDER = Path(__file__).resolve().parent / "models"
#: Environment: further folders with a folder for each model, written as PATH is.
MODELS_VARIABLE = "PNFARM_MODELS"
#: Places of a model's folder: alone, as a bus of a product, as an edition of that.
_DEPTHS = tuple(f"{'*/' * depth}{MODEL_FILE}" for depth in (1, 2, 3))


@dataclass(frozen=True, slots=True)
class Entry:
    """A model in the list of models, before it is loaded."""

    name: str
    aliases: tuple[str, ...]
    title: str
    maker: str
    bus: str
    edition: str
    folder: Path


def _folders_in(place: Path) -> list[Path]:
    return sorted(path.parent for depth in _DEPTHS for path in place.glob(depth))


def _folders(further: str) -> list[Path]:
    """The folders of all models; raises :class:`ConfigError` for a named place without any."""
    found = _folders_in(SHIPPED_FOLDER)
    for place in filter(None, further.split(os.pathsep)):
        own = _folders_in(beside(Path.cwd(), place).resolve())
        if not own:
            raise ConfigError(f"{MODELS_VARIABLE}: {place} has no folder with a model.toml")
        found += [folder for folder in own if folder not in found]
    return found


@cache
def _entries(further: str) -> dict[str, Entry]:
    found: dict[str, Entry] = {}
    owners: dict[str, Path] = {}
    products: dict[str, Path] = {}
    for folder in _folders(further):
        path, files = folder / MODEL_FILE, ModelFiles(folder)
        data, _ = joined_data(files, NAMING_FILES)
        name = str(required(data, "name", str(path)))
        aliases = data.get("aliases", [])
        if not isinstance(aliases, list) or not all(isinstance(word, str) for word in aliases):
            raise ConfigError(f"{path}, aliases: {aliases!r} is not a list of names")
        for word in (name, *aliases):
            if word in owners:
                raise ConfigError(f"{path}: {word!r} is already a name of {owners[word]}")
            owners[word] = path
        texts = {key: str(data.get(key, "")) for key in ("title", "maker", "bus", "edition")}
        found[name] = Entry(name=name, aliases=tuple(aliases), **texts, folder=folder)
        products[name] = files.folders[0]
    order = list(dict.fromkeys(products.values()))
    return {name: found[name] for name in sorted(found, key=lambda name: (order.index(products[name]), name))}


def models() -> dict[str, Entry]:
    """All models by name, those of a product next to each other.

    Raises :class:`ConfigError` when those of :data:`MODELS_VARIABLE` cannot be listed.
    """
    return dict(_entries(os.environ.get(MODELS_VARIABLE, "")))


@cache
def _loaded(folder: Path) -> Model:
    return load_model(folder)


def model(name: str) -> Model:
    """The model of this name or alias; raises :class:`ConfigError` that lists those there are."""
    entries = models()
    for entry in entries.values():
        if name == entry.name or name in entry.aliases:
            return _loaded(entry.folder)
    known = [word for entry in entries.values() for word in (entry.name, *entry.aliases)]
    close = difflib.get_close_matches(name, known, 1)
    hint = f"; did you mean {close[0]}?" if close else ""
    raise ConfigError(f"there is no drive model {name!r}, there are {', '.join(entries)}{hint}")


def models_on(bus: str) -> list[Model]:
    """Every model on a bus, in the order of :func:`models`."""
    return [_loaded(entry.folder) for entry in models().values() if entry.bus == bus]
