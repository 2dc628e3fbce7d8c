"""How many globs, and how long ones, a list of drives may hold, so that nobody's list stops the farm's event loop."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from pnfarm.faults.words import Problem

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["MAX_GLOB", "MAX_PATTERNS", "is_pattern", "too_much"]

#: Longest glob, characters: a station name has at most 240.
MAX_GLOB = 250
#: Most globs with `*`, `?` or `[` in one list; each is compared with every drive, a plain name is looked up.
MAX_PATTERNS = 64
_WILD = re.compile(r"[*?\[]")


def too_much(globs: Sequence[str]) -> Problem | None:
    """Why a list of globs costs more time than any farm needs; None for one that does not."""
    if (longest := max(map(len, globs))) > MAX_GLOB:
        return Problem(f"has a glob of {longest} characters", f"at most {MAX_GLOB}: a station name has at most 240")
    if (patterns := sum(map(is_pattern, globs))) > MAX_PATTERNS:
        what = f"has {patterns} globs with *, ? or [, or of models"
        return Problem(what, f"at most {MAX_PATTERNS}, and any number of whole names")
    return None


def is_pattern(glob: str) -> bool:
    """Whether a glob must be compared with each drive: it has wildcards, or names a model."""
    return glob.startswith("model:") or _WILD.search(glob) is not None
