"""Lists of drives as people write them: names, globs over names, ``model:NAME``, ``all``.

Number and length of the globs in a list are bounded, so that no list can block the farm's event loop.
"""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

__all__ = ["GLOBS", "GLOBS_SCHEMA", "MAX_GLOB", "MAX_PATTERNS", "is_pattern", "means", "read_globs"]

#: What is allowed, for error messages.
GLOBS = "a glob over drive names such as axis-*, model:NAME, all, or a list of them"
GLOBS_SCHEMA: dict[str, Any] = {
    "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}]
}
#: Longest glob, characters: a station name has at most 240.
MAX_GLOB = 250
#: Most globs with `*`, `?` or `[` in one list; each is compared with every drive, a plain name is looked up.
MAX_PATTERNS = 64
_WILD = re.compile(r"[*?\[]")
_MODEL = "model:"


def read_globs(value: object) -> list[str]:
    """One glob or a list of them.  Raises :class:`Problem`."""
    globs = [value] if isinstance(value, str) else value
    if globs == []:
        raise Problem("is []", GLOBS)
    if not isinstance(globs, (list, tuple)) or not globs or not all(isinstance(item, str) and item for item in globs):
        raise Problem(f"is {shown(value)}", GLOBS)
    _bound(globs)
    return list(globs)


def _bound(globs: Sequence[str]) -> None:
    """Raises :class:`Problem` for a list whose matching would take longer than any farm needs."""
    if (longest := max(map(len, globs))) > MAX_GLOB:
        raise Problem(f"has a glob of {longest} characters", f"at most {MAX_GLOB}: a station name has at most 240")
    if (patterns := sum(map(is_pattern, globs))) > MAX_PATTERNS:
        what = f"has {patterns} globs with *, ? or [, or of models"
        raise Problem(what, f"at most {MAX_PATTERNS}, and any number of whole names")


def is_pattern(glob: str) -> bool:
    """Whether a glob must be compared with each drive: it has wildcards, or names a model."""
    return glob.startswith(_MODEL) or _WILD.search(glob) is not None


def means(glob: str, names: Iterable[str], models: Iterable[str] = ()) -> bool:
    """Whether a glob matches the drive with these names and these names of its model."""
    if glob.startswith(_MODEL) and glob != _MODEL:
        return any(fnmatchcase(model, glob.removeprefix(_MODEL)) for model in models)
    return glob == "all" or any(fnmatchcase(name, glob) for name in names)
