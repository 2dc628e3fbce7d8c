"""The fields of an injection from the keywords of a Python call."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnfarm.faults.errors import InjectionError
from pnfarm.faults.plan import InjectionSpec
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.samples import with_files

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["fields_of", "nanoseconds"]

#: What belongs to every injection; all other keywords are parameters of its kind.
_COMMON = frozenset(field.alias or name for name, field in InjectionSpec.model_fields.items()) - {"kind", "on"}
#: Those that are durations, and may be numbers of seconds.
_DURATIONS = frozenset(
    field.alias for name, field in InjectionSpec.model_fields.items() if name.endswith("_ns") and field.alias
)


def nanoseconds(seconds: float) -> str:
    """Seconds as a duration of the fault catalogue, which refuses those that are none."""
    return f"{round(seconds * 1e9)}ns" if isfinite(seconds) else f"{seconds}s"


def fields_of(kind: str, on: str | Sequence[str], options: Mapping[str, Any]) -> dict[str, Any]:
    """``for_`` and ``as_`` stand for ``for`` and ``as``; ``after``, ``for_`` and ``ttl`` may be numbers of seconds."""
    given = {key.removesuffix("_"): value for key, value in options.items()}
    common = {key: value for key, value in given.items() if key in _COMMON}
    for key in _DURATIONS & common.keys():
        if isinstance(common[key], (int, float)) and not isinstance(common[key], bool):
            common[key] = nanoseconds(common[key])
    more = common.pop("params", {})
    params = {key: value for key, value in given.items() if key not in _COMMON}
    # what is no mapping is the catalogue's to refuse
    whole = {**params, **more} if isinstance(more, dict) else more
    try:
        whole = with_files(whole, Path())
    except Problem as problem:
        raise InjectionError([("params.values", problem.what, problem.allowed)]) from problem
    return {"kind": kind, "on": on if isinstance(on, str) else list(on), "params": whole, **common}
