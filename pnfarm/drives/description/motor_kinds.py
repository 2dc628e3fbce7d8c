"""Kinds of motors of one drive model: its default rotary one, and those that a farm file may choose instead.

The axis record is that of a rotary motor: it counts revolutions, rpm and N m.  A linear motor moves by its pitch in one
revolution of the record: its data are given in millimetres, newtons and kilograms and converted here.  Values that a
kind does not give are those of the model's own sections.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import TYPE_CHECKING

from pnfarm.drives.description.files import integer
from pnfarm.drives.description.parts import MotorKind
from pnfarm.drives.parameters.rows import PER_PITCH, axis_parameters
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.description.sections import Section
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = ["ROTARY", "axis_value", "axis_values", "read_motor_kinds", "with_motor"]

#: The kind of a model's own sections ``motor`` and ``firmware``.
ROTARY = "rotary"
#: Of a section ``motors.<kind>``.
PARTS = ("kind", "motor", "firmware", "defaults")


def _metres_per_radian(pitch: float) -> float:
    """Metres of travel for one radian, for a pitch in millimetres."""
    return pitch / 1000.0 / (2.0 * pi)


#: Unit in the axis record -> unit of a linear motor, and the factor from the latter to the former.
_LINEAR: dict[str, tuple[str, Callable[[float], float]]] = {
    "rev": ("mm", lambda pitch: 1.0 / pitch),
    "1/rev": ("1/mm", lambda pitch: pitch),
    "rpm": ("mm/s", lambda pitch: 60.0 / pitch),
    "rpm/s": ("mm/s^2", lambda pitch: 60.0 / pitch),
    "N m": ("N", _metres_per_radian),
    "N m/A": ("N/A", _metres_per_radian),
    "kg m^2": ("kg", lambda pitch: _metres_per_radian(pitch) ** 2),
    "N m s/rad": ("N s/m", lambda pitch: _metres_per_radian(pitch) ** 2),
}


def axis_value(name: str, value: float, pitch: float) -> float:
    """A field of the axis record from a value in the units of a motor with this pitch; unchanged for a rotary one."""
    linear = _LINEAR.get(AXIS.fields[name].unit)
    return value if pitch <= 0.0 or linear is None else value * linear[1](pitch)


def with_motor(model: Model, name: str | None, pitch: float | None = None) -> Model:
    """The model with a motor of this kind, None for its default one; ``pitch`` in mm overrides that of a linear motor.

    Raises :class:`ConfigError` for a kind that the model does not have, and a pitch for a rotary motor.
    """
    kind = MotorKind() if name in {None, ROTARY} else model.motor_kinds.get(str(name))
    if kind is None:
        raise ConfigError(f"{model.name} has no {name} motor; it has {', '.join((ROTARY, *model.motor_kinds))}")
    if pitch is not None and kind.pitch <= 0.0:
        raise ConfigError(f"a {name or ROTARY} motor turns and has no pitch")
    travel = kind.pitch if pitch is None else pitch
    if kind == MotorKind():
        return model
    parameters = {pnu: _fitted(parameter, kind, travel) for pnu, parameter in model.parameters.items()}
    return replace(
        model,
        pitch=travel,
        motor={**model.motor, **{key: axis_value(key, value, travel) for key, value in kind.motor.items()}},
        firmware={**model.firmware, **{key: axis_value(key, value, travel) for key, value in kind.firmware.items()}},
        parameters=parameters,
        axis_parameters=axis_parameters(parameters, linear=travel > 0.0),
    )


def _fitted(parameter: Parameter, kind: MotorKind, pitch: float) -> Parameter:
    """A parameter's default and factor with this motor."""
    factor = parameter.factor / pitch if parameter.scale.endswith(PER_PITCH) and pitch > 0.0 else parameter.factor
    default = kind.defaults.get(parameter.pnu, parameter.default)
    if factor == parameter.factor and default == parameter.default:
        return parameter
    return replace(parameter, factor=factor, default=default)


# the sections motors.<kind>


def read_motor_kinds(
    motors: Mapping[str, Mapping[str, Section]], parameters: Mapping[int, Parameter]
) -> dict[str, MotorKind]:
    """The sections ``motors.<kind>``; raises :class:`ConfigError` that names the section and the key."""
    kinds: dict[str, MotorKind] = {}
    for name, parts in motors.items():
        for part, section in parts.items():
            if name == ROTARY:
                raise section.wrong("", "the default motor is in the sections motor and firmware")
            if part not in PARTS:
                raise section.wrong("", f"not one of {', '.join(PARTS)}")
        pitch = parts["kind"]["pitch"].value if "pitch" in parts.get("kind", {}) else 0.0
        if not isinstance(pitch, int | float) or pitch < 0:
            raise ConfigError(f"{parts['kind'].where('pitch')}: {pitch!r} is not a length in mm")
        kinds[name] = MotorKind(
            float(pitch),
            _values(parts["motor"], "station", float(pitch)) if "motor" in parts else {},
            _values(parts["firmware"], "parameter", float(pitch)) if "firmware" in parts else {},
            _defaults(parts["defaults"], parameters) if "defaults" in parts else {},
        )
    return kinds


def _values(section: Section, writer: str, pitch: float) -> dict[str, float]:
    values = axis_values(section, writer)
    for key, fact in section.items():
        unit = AXIS.fields[key].unit
        wanted = _LINEAR[unit][0] if pitch > 0.0 and unit in _LINEAR else unit
        if fact.unit != wanted:
            raise ConfigError(f"{section.where(key)}, unit: {fact.unit!r}; for this motor it is {wanted!r}")
    return values


def axis_values(section: Section, writer: str) -> dict[str, float]:
    """Fields of the axis record that ``writer`` owns, by name; raises :class:`ConfigError` for another key."""
    for key in section:
        field = AXIS.fields.get(key)
        if field is None or field.writer != writer:
            raise section.wrong(key, f"the axis has no such field written by the {writer}")
    return section.values_by_key()


def _defaults(section: Section, parameters: Mapping[int, Parameter]) -> dict[int, int]:
    found: dict[int, int] = {}
    by_name = {parameter.name: parameter for parameter in parameters.values()}
    for key, fact in section.items():
        if key not in by_name:
            raise section.wrong(key, "there is no such parameter")
        parameter = by_name[key]
        value = integer(str(fact.value), section.name, key)
        if not parameter.minimum <= value <= parameter.maximum:
            raise section.wrong(key, f"{value} is not within {parameter.minimum}..{parameter.maximum}")
        found[parameter.pnu] = value
    return found
