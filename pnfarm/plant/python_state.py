"""The state of a model in Python as plain JSON: what its ``save()`` gives, or its attributes.

A model with ``save()`` and ``restore(state)`` decides itself.  Of any other, attributes that are numbers, switches,
texts, None or lists of these are saved; the others are named, so that no user relies on them.
"""

from __future__ import annotations

import inspect
import json
import math
from typing import Any

from pnfarm.errors import ConfigError

__all__ = ["check_state", "put_state", "state_of"]

#: Octets of one model's state as JSON.
MOST_OCTETS = 1_000_000
#: Lists in lists.
_DEEPEST = 4


def state_of(model: Any) -> tuple[dict[str, Any], list[str]]:
    """The state, and the names of attributes that are not in it.  Raises what the model's own ``save`` raises."""
    if _decides(model):
        own = model.save()
        text = json.dumps(own, allow_nan=False)
        if len(text) > MOST_OCTETS:
            raise ValueError(f"save() gives {len(text)} octets of JSON, more than {MOST_OCTETS}")
        # as it will be read: tuples are lists then
        return {"own": json.loads(text)}, []
    found = {name: value for name, value in vars(model).items() if _is_plain(value)}
    return {"attributes": json.loads(json.dumps(found))}, [name for name in vars(model) if name not in found]


def check_state(model: Any, state: Any) -> None:
    """Whether it can be put back; raises :class:`ConfigError`."""
    if not isinstance(state, dict) or state.keys() != {"own" if _decides(model) else "attributes"}:
        raise ConfigError("has no state of this class")
    attributes = state.get("attributes", {})
    if not isinstance(attributes, dict):
        raise ConfigError("`attributes` is no mapping")
    for name, value in attributes.items():
        if not name.isidentifier() or name.startswith("__") or _is_code(model, name) or not _is_plain(value):
            raise ConfigError(f"{name[:60]!r} is no attribute that can be restored")


def put_state(model: Any, state: dict[str, Any]) -> None:
    """Put back what :func:`check_state` accepted.  Raises what the model's own ``restore`` raises."""
    if _decides(model):
        model.restore(state["own"])
        return
    for name, value in [*vars(model).items()]:
        # what was not set then has the value of the class again
        if name not in state["attributes"] and hasattr(type(model), name) and _is_plain(value):
            delattr(model, name)
    for name, value in state["attributes"].items():
        setattr(model, name, value)


def _decides(model: Any) -> bool:
    return callable(getattr(model, "save", None)) and callable(getattr(model, "restore", None))


def _is_code(model: Any, name: str) -> bool:
    """Whether it is a method, a property or the like of the class, and no value that objects have until they set it."""
    own = inspect.getattr_static(type(model), name, None)
    return callable(own) or hasattr(own, "__get__")


def _is_plain(value: Any, depth: int = 0) -> bool:
    if isinstance(value, list):
        return depth < _DEEPEST and len(value) <= MOST_OCTETS and all(_is_plain(one, depth + 1) for one in value)
    if type(value) is float:
        return math.isfinite(value)
    return value is None or type(value) in {bool, int, str}
