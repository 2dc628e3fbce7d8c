"""The plant's part of a state: values of all ports, what is inside models, what users wrote and force."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

from pnfarm.behaviours.declaration import Behaviour
from pnfarm.errors import ConfigError
from pnfarm.farm.state.refused import RefusedStateError, listed, mapped
from pnfarm.plant.coupling_kinds import CouplingKind
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from pnfarm.plant.plan import PlannedModel
    from pnfarm.plant.plant import Plant
    from pnfarm.plant.table import PlantCopies

__all__ = ["check_plant", "filled", "plain_plant"]

_KEYS = ("models", "values", "behaviours", "couplings", "parts", "python", "fmus")
#: What steps write of a coupling, but for the flag ``begun``.
_COUPLED = ("angle", "speed", "torque", "before")
_LONGEST_NS = 10**18


def _kinds(plant: Plant) -> dict[str, str]:
    return {name: model.what.kind_name for name, model in plant.plan.models.items()}


def _of(plant: Plant, kind: type) -> list[PlannedModel]:
    """The models of a kind, in the order of their rows."""
    return [model for model in plant.plan.models.values() if isinstance(model.what, kind)]


def _finite(values: Any) -> list[float]:
    return [value if isfinite(value) else 0.0 for value in values.tolist()]


def plain_plant(plant: Plant, copies: PlantCopies, parts: Any, python: Any, fmus: Any) -> dict[str, Any]:
    """As plain JSON; ``parts``, ``python`` and ``fmus`` are so already."""
    behaviours = {}
    for row, model in zip(copies.behaviours, _of(plant, Behaviour), strict=False):
        begin = int(row.memory) + int(row.parameters)
        behaviours[model.name] = {
            "age": copies.last_ns - int(row.last_ns) if row.last_ns else None,
            "state": _finite(copies.memory[begin : begin + int(row.state)]),
        }
    couplings = {
        model.name: [*(float(row[name]) for name in _COUPLED), int(row.begun)]
        for row, model in zip(copies.couplings, _of(plant, CouplingKind), strict=False)
    }
    return {
        "models": _kinds(plant), "values": _finite(copies.values), "behaviours": behaviours, "couplings": couplings,
        "parts": parts, "python": python, "fmus": fmus,
    }  # fmt: skip


def check_plant(plant: Plant | None, state: Any) -> None:
    """What :func:`plain_plant` gave; raises :class:`RefusedStateError`."""
    if plant is None or state is None:
        if (plant is None) != (state is None):
            raise RefusedStateError("it is of another farm file: only one of them has a plant")
        return
    mapped(state, "`plant`", _KEYS)
    if state["models"] != _kinds(plant):
        raise RefusedStateError("it is of another farm file: the models of the plant are others")
    _check_numbers(state["values"], "`values` of the plant", len(plant.table.values))
    behaviours, couplings = _of(plant, Behaviour), _of(plant, CouplingKind)
    mapped(state["behaviours"], "`behaviours`", [model.name for model in behaviours])
    for model in behaviours:
        _check_behaviour(model, state["behaviours"][model.name])
    mapped(state["couplings"], "`couplings`", [model.name for model in couplings])
    for model in couplings:
        found = state["couplings"][model.name]
        _check_numbers(found, f"the state of {model.name}", len(_COUPLED) + 1)
        if found[-1] not in {0, 1}:
            raise RefusedStateError(f"the state of {model.name} cannot end with {shown(found[-1])}")
    mapped(state["parts"], "`parts`", plant.parts.keys())
    for name, part in plant.parts.items():
        try:
            part.signals.take_state(mapped(state["parts"][name], name), check=True)
        except ConfigError as exc:
            raise RefusedStateError(f"{name}: {exc}") from exc
    try:
        plant.python.check_states(state["python"])
        plant.fmus.check_states(state["fmus"])
    except ConfigError as exc:
        raise RefusedStateError(str(exc)) from exc


def _check_behaviour(model: PlannedModel, state: Any) -> None:
    kind = model.what
    assert isinstance(kind, Behaviour)
    mapped(state, model.name, ("age", "state"))
    age = state["age"]
    if age is not None and not (type(age) is int and abs(age) <= _LONGEST_NS):
        raise RefusedStateError(f"`age` of {model.name} cannot be {shown(age)}")
    _check_numbers(state["state"], f"`state` of {model.name}", kind.state)
    for place, most in kind.counts.items():
        if not 0 <= state["state"][place] <= most:
            raise RefusedStateError(
                f"`state` of {model.name} has {shown(state['state'][place])} for a count up to {most}"
            )


def _check_numbers(values: Any, what: str, count: int) -> None:
    for value in listed(values, what, count):
        # an integer may be too large for a floating point number
        if type(value) not in {int, float} or not abs(value) <= 1e300:
            raise RefusedStateError(f"{what} cannot have {shown(value)}")


def filled(plant: Plant, copies: PlantCopies, state: dict[str, Any]) -> PlantCopies:
    """Present copies with a state that :func:`check_plant` accepted."""
    copies.values[:] = state["values"]
    for row, model in zip(copies.behaviours, _of(plant, Behaviour), strict=False):
        found = state["behaviours"][model.name]
        begin = int(row.memory) + int(row.parameters)
        copies.memory[begin : begin + int(row.state)] = found["state"]
        # 0 would be none
        row.last_ns = 0 if found["age"] is None else (copies.last_ns - found["age"]) or 1
    for row, model in zip(copies.couplings, _of(plant, CouplingKind), strict=False):
        for name, value in zip((*_COUPLED, "begun"), state["couplings"][model.name], strict=True):
            row[name] = value
    return copies
