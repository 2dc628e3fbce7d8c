"""Finds the class of a model in a Python file: ``inputs``, ``outputs`` and ``step(self, dt)``.

::

    class LightBarrier:
        inputs = {"position": "mm"}
        outputs = {"on": bool}

        def step(self, dt):
            self.on = 100.0 <= self.position <= 140.0
"""

from __future__ import annotations

import contextlib
import inspect
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.behaviours.declaration import Port
from pnfarm.errors import ConfigError
from pnfarm.user_code.file import line_of, own_classes, run_file
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["ModelClass", "PlantFileError", "load_model"]

#: Most ports of a model.
MOST_PORTS = 1000
_ALLOWED = "a file with a class that has inputs, outputs and step(self, dt)"


class PlantFileError(Exception):
    """What is wrong with the file, and what is allowed."""

    def __init__(self, what: str, allowed: str = _ALLOWED) -> None:
        super().__init__(what)
        self.allowed = allowed


@dataclass(frozen=True, slots=True)
class ModelClass:
    """A class of models, and its ports."""

    name: str
    kind: type[Any]
    path: Path
    module: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    #: What its ``__init__`` takes.
    parameters: tuple[str, ...]

    @property
    def kind_name(self) -> str:
        return "python"

    def lack(self, given: Mapping[str, Any]) -> str:
        """Why its ``__init__`` does not take these parameters, empty if it does."""
        try:
            needed = inspect.signature(self.kind)
        except (TypeError, ValueError):
            return ""
        try:
            needed.bind(**given)
        except TypeError as error:
            return str(error)
        return ""


def load_model(path: Path, class_name: str | None) -> ModelClass:
    """Run the file and return its class; without a name, the only one with a ``step``.

    Raises :class:`PlantFileError`.
    """
    try:
        module = run_file(path, "python")
    except ConfigError as error:
        raise PlantFileError(str(error)) from error
    own = {name: kind for name, kind in own_classes(module).items() if callable(getattr(kind, "step", None))}
    if class_name is not None and class_name not in own:
        raise PlantFileError(
            f"{path} has no class {class_name} with a method step{did_you_mean(class_name, own)}",
            ", ".join(own) or _ALLOWED,
        )
    if class_name is None and len(own) != 1:
        have = f"the classes {', '.join(own)}" if own else "no class with a method step(self, dt)"
        raise PlantFileError(f"{path} has {have}", "class: NAME of one" if own else _ALLOWED)
    name = class_name or next(iter(own))
    kind = own[name]
    _check_step(kind, path)
    inputs, outputs = (_ports(kind, side, path) for side in ("inputs", "outputs"))
    both = {port.name for port in inputs} & {port.name for port in outputs}
    if both:
        raise PlantFileError(f"{path}: {name} has {shown(min(both))} as input and output", "each name once")
    if not inputs and not outputs:
        raise PlantFileError(f"{path}: {name} has no ports", 'inputs = {"position": "mm"}, outputs = {"on": bool}')
    return ModelClass(name, kind, path, module.__name__, inputs, outputs, _parameters(kind))


def _check_step(kind: type[Any], path: Path) -> None:
    step = kind.step
    line = line_of(step)
    if inspect.iscoroutinefunction(step) or inspect.isgeneratorfunction(step) or inspect.isasyncgenfunction(step):
        raise PlantFileError(f"{path}:{line}: step is called and returns: neither `async` nor `yield`")
    with contextlib.suppress(ValueError):  # of a base class in C
        try:
            inspect.signature(step).bind(None, 0.0)
        except TypeError:
            raise PlantFileError(f"{path}:{line}: {kind.__name__} needs step(self, dt)") from None


def _ports(kind: type[Any], side: str, path: Path) -> tuple[Port, ...]:
    """``{"position": "mm", "on": bool, "speed": float}``, or names alone, which are numbers."""
    given = getattr(kind, side, {})
    what = f"{path}: {kind.__name__}.{side}"
    if isinstance(given, (list, tuple, set, frozenset)):
        given = dict.fromkeys(given, "")
    if not isinstance(given, dict) or len(given) > MOST_PORTS:
        allowed = f'a mapping such as {{"position": "mm", "on": bool}}, at most {MOST_PORTS} ports'
        raise PlantFileError(f"{what} is {shown(given)}", allowed)
    found = []
    for name, form in given.items():
        if not isinstance(name, str) or not name.isidentifier() or name.startswith("_") or hasattr(kind, name):
            raise PlantFileError(f"{what} has {shown(name)}", "names of attributes that the class does not have")
        if form is bool:
            found.append(Port(name, "bit", ""))
        elif form is float or form is int or isinstance(form, str):
            found.append(Port(name, "number", "", form if isinstance(form, str) else ""))
        else:
            raise PlantFileError(f"{what}: {name} is {shown(form)}", 'bool, float, or a unit such as "mm"')
    return tuple(found)


def _parameters(kind: type[Any]) -> tuple[str, ...]:
    """What ``__init__`` takes beside self."""
    try:
        known = inspect.signature(kind).parameters.values()
    except (TypeError, ValueError):
        return ()
    return tuple(one.name for one in known if one.kind in {one.KEYWORD_ONLY, one.POSITIONAL_OR_KEYWORD})
