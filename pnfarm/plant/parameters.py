"""The parameters of built-in models: checked, in the units of the step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.plant.coupling_kinds import CouplingKind
from pnfarm.vocabulary.durations import read_duration
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quantities import in_unit
from pnfarm.vocabulary.quoting import did_you_mean, shortened, shown

if TYPE_CHECKING:
    from collections.abc import Collection

    from pnfarm.behaviours.declaration import Behaviour, Parameter
    from pnfarm.config.plant import PlantModel
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["read_parameters"]


def read_parameters(
    at: Location,
    model: PlantModel,
    kind: Behaviour | CouplingKind,
    axes: Collection[str],
    report: Report,
) -> dict[str, Any] | None:
    """By name, those left out with their defaults; ``axes`` of a coupling by name.  None: something is wrong."""
    given = dict(model.parameters)
    found: dict[str, Any] = {}
    wrong = False
    if isinstance(kind, CouplingKind):
        joined = _axes_of(at, kind, given, axes, report)
        wrong = joined is None
        found["axes"] = joined
    known = {one.name: one for one in kind.parameters}
    for key, value in given.items():
        if key not in known:
            hint = did_you_mean(key, known)
            report((*at, key), f"{kind.name} has no such parameter{hint}", ", ".join(known))
            wrong = True
            continue
        try:
            found[key] = _value(known[key], value)
        except Problem as problem:
            report((*at, key), problem.what, problem.allowed)
            wrong = True
    for key, one in known.items():
        if key in given:
            continue
        if one.default is None:
            unit = "a time such as 300ms" if one.unit == "s" else one.unit
            report(at, f"{kind.name} {model.name} has no {key}", f"{key}: {one.doc}{unit and f', {unit}'}")
            wrong = True
        else:
            found[key] = one.default
    return None if wrong else found


def _axes_of(
    at: Location, kind: CouplingKind, given: dict[str, Any], axes: Collection[str], report: Report
) -> tuple[str, ...] | None:
    """The axes that a coupling joins, taken out of ``given``."""
    key = "axis" if kind.shafts == 1 else "axes"
    value = given.pop(key, None)
    names = [value] if isinstance(value, str) and kind.shafts == 1 else value
    wanted = "axis: NAME" if kind.shafts == 1 else "axes: [NAME, NAME]"
    if not isinstance(names, list) or len(names) != kind.shafts or len(set(names)) != kind.shafts:
        where = at if value is None else (*at, key)
        report(where, f"{kind.name} is between {'an axis and a mass' if kind.shafts == 1 else 'two axes'}", wanted)
        return None
    unknown = [name for name in names if name not in axes]
    for name in unknown:
        report((*at, key), f"there is no axis {shown(name)}{did_you_mean(name, axes)}", shortened(list(axes)) or "none")
    return None if unknown else tuple(names)


def _value(parameter: Parameter, value: Any) -> float:
    """One value; raises :class:`Problem`."""
    if parameter.words:
        if value not in parameter.words:
            raise Problem(f"is {shown(value)}", ", ".join(parameter.words))
        return float(parameter.words.index(value))
    if parameter.unit == "s":
        number = read_duration(value) / 1e9
    elif isinstance(value, bool) or not isinstance(value, int | float | str):
        raise Problem(f"is {shown(value)}", f"a number{parameter.unit and f' of {parameter.unit}'}")
    elif isinstance(value, str):
        number = _with_unit(parameter, value)
    else:
        number = float(value)
    if not parameter.low <= number <= parameter.high:
        raise Problem(f"is {shown(value)}", f"{parameter.low:g} to {parameter.high:g} {parameter.unit}".rstrip())
    return number


def _with_unit(parameter: Parameter, value: str) -> float:
    """``2 deg``."""
    text, _, unit = value.strip().partition(" ")
    try:
        number = float(text)
    except ValueError as error:
        raise Problem(f"is {shown(value)}", f"a number{parameter.unit and f' of {parameter.unit}'}") from error
    if unit and not parameter.unit:
        raise Problem(f"is {shown(value)}", "a number without unit: it is in the unit of the model's ports")
    return in_unit(number, unit.strip(), parameter.unit)
