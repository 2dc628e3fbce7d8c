"""Points that a manual leaves open, each with its readings, from which a farm file chooses.

A point is an entry ``[[behaviour]]`` of a model's ``behaviour.toml``; its readings are data.  Each reading gives
another value to the same fields of the axis record, defaults of parameters or keys of the model's own sections, so that
no code checks for a reading by its name:

* ``firmware``: fields of writer ``parameter`` that neither a parameter nor the section ``firmware`` sets;
* ``defaults``: PNU -> raw number, the default of a parameter that is not an array;
* ``model``: ``section.key`` of the sections that :data:`SECTIONS` names, and of the one named after the model's bus.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.behaviour_sets import SET, with_set
from pnfarm.drives.description.files import flat, joined_tables, required
from pnfarm.drives.description.parts import Point, Reading
from pnfarm.drives.parameters.rows import axis_parameters
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from collections.abc import Set as AbstractSet

    from pnfarm.drives.description.files import ModelFiles
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.parameters.numbers import ParameterNumbers
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = ["BUS_FACTS", "SECTIONS", "read_behaviour", "with_behaviour"]

#: Sections whose values a reading may set for any bus, and their place in the model.
SECTIONS = {
    "communication_loss": "communication_loss",
    "parameter_access": "access",
    "position_units": "position_units",
}
#: Place of the section named after the bus.
BUS_FACTS = "bus_facts"
FILE = "behaviour.toml"
_NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")
#: YAML reads these as booleans or null; and the key of sets.
_NOT_TEXT = frozenset({SET, "false", "n", "no", "null", "off", "on", "true", "y", "yes"})
_SETS = ("firmware", "defaults", "model")


# behaviour.toml


def read_behaviour(
    files: ModelFiles,
    parameters: Mapping[int, Parameter],
    numbers: ParameterNumbers,
    fixed: AbstractSet[object],
    sections: Mapping[str, str],
    section_value: Callable[[str, str, Any, str], Any],
) -> tuple[Point, ...]:
    """Check and build the points, none without the file; raises :class:`ConfigError` that names the entry.

    ``fixed`` is what other data of the model set: fields, and keys of sections with the section's place.  ``sections``
    are those whose values a reading may set, with their places; ``section_value`` converts the value of a section's
    key to the model's form, or raises.
    """
    points: list[Point] = []
    owners: dict[object, str] = {}
    for path, data in files.tomls(FILE):
        if unknown := sorted(data.keys() - {"behaviour"}):
            raise ConfigError(f"{path}, {unknown[0]}: unknown; only behaviour is allowed")
    for name, table in joined_tables(files, FILE, "behaviour", "name").items():
        where = table.where()
        if not _is_word(str(name)):
            raise ConfigError(f"{where}: not a name of a-z, 0-9 and - between")
        readings = {
            key: _reading(str(key), entry, parameters, numbers, sections, section_value, f"{where}.{key}")
            for key, entry in table.required("readings").items()
        }
        texts = {key: str(table.required(key)) for key in ("about", "default", "reason", "source")}
        point = Point(name=name, readings=readings, **texts)
        _check_point(point, fixed, owners, where)
        points.append(point)
    return tuple(points)


def _is_word(name: str) -> bool:
    return bool(_NAME.fullmatch(name)) and name not in _NOT_TEXT and not name.isdigit()


def _reading(
    name: str,
    entry: Mapping[str, Any],
    parameters: Mapping[int, Parameter],
    numbers: ParameterNumbers,
    sections: Mapping[str, str],
    section_value: Callable[[str, str, Any, str], Any],
    where: str,
) -> Reading:
    if not _is_word(name):
        raise ConfigError(f"{where}: not a name of a-z, 0-9 and - between")
    if unknown := sorted(entry.keys() - {"does", *_SETS}):
        raise ConfigError(f"{where}, {unknown[0]}: unknown; allowed are does, {', '.join(_SETS)}")
    does = str(required(entry, "does", where))
    firmware: dict[str, float] = {}
    for key, value in flat(entry.get("firmware", {})).items():
        column = AXIS.fields.get(key)
        if column is None or column.writer != "parameter" or column.unit not in {"", "ns", "s"}:
            raise ConfigError(f"{where}, firmware.{key}: not a field of the axis that a reading may set")
        firmware[key] = value
    defaults: dict[int, int] = {}
    for key, value in entry.get("defaults", {}).items():
        pnu = numbers.of(key, f"{where}, defaults")
        parameter = parameters.get(pnu)
        if parameter is None or parameter.elements or type(value) is not int or not parameter.allows(value):
            raise ConfigError(f"{where}, defaults.{key}: not a plain parameter, or it does not allow {value!r}")
        defaults[pnu] = value
    model: dict[tuple[str, str], Any] = {}
    for key, value in entry.get("model", {}).items():
        section, _, inside = key.partition(".")
        if section not in sections:
            raise ConfigError(f"{where}, model.{key}: the section must be one of {', '.join(sections)}")
        given = tuple(value) if isinstance(value, list) else value
        model[sections[section], inside] = section_value(section, inside, given, f"{where}, model.{key}")
    return Reading(name, does, firmware, defaults, model)


def _check_point(point: Point, fixed: AbstractSet[object], owners: dict[object, str], where: str) -> None:
    """Check that all readings set the same keys, to different values, and that nothing else sets them."""
    if len(point.readings) < 2 or point.default not in point.readings:
        raise ConfigError(f"{where}: must have at least two readings, and one of them as its default")
    default = point.readings[point.default]
    for name, reading in point.readings.items():
        if not reading.keys or reading.keys != default.keys:
            raise ConfigError(f"{where}.{name}: must set the same keys as {point.default}, at least one")
        same = [other.name for other in point.readings.values() if other.values == reading.values]
        if same != [name]:
            raise ConfigError(f"{where}.{name}: sets the same as {next(n for n in same if n != name)}")
    for key in default.keys:
        if key in fixed:
            raise ConfigError(f"{where}: {_named(key)} is set by other data of the model")
        if key in owners:
            raise ConfigError(f"{where}: {_named(key)} is set by {owners[key]}")
        owners[key] = point.name


def _named(key: object) -> str:
    """A key as an error names it; of a section only its key is written in the model's files."""
    return str(key[1] if isinstance(key, tuple) else key)


# in force


def with_behaviour(model: Model, chosen: Mapping[str, str]) -> Model:
    """The model with these readings by the names of their points, those of a set (:data:`SET`), else the defaults.

    Raises :class:`ConfigError` for a set, a point or a reading that the model does not have.
    """
    points = {point.name: point for point in model.behaviour}
    readings: list[Reading] = []
    named = chosen.get(SET)
    if named is not None and named not in model.behaviour_sets:
        raise ConfigError(f"{model.name} has no set {named}; there are {', '.join(model.behaviour_sets) or 'none'}")
    own = {name: wanted for name, wanted in chosen.items() if name != SET}
    for name, wanted in own.items():
        if name not in points or wanted not in points[name].readings:
            known = ", ".join(points[name].readings if name in points else points) or "none"
            raise ConfigError(f"{model.name} has no behaviour {name}: {wanted}; there are {known}")
    usual = {} if named is None else {name: fact.value for name, fact in model.behaviour_sets[named].readings.items()}
    for name, point in points.items():
        readings.append(point.readings[own.get(name, usual.get(name, point.default))])
    firmware = dict(model.firmware)
    defaults: dict[int, int] = {}
    sections: dict[str, dict[str, Any]] = {}
    for reading in readings:
        firmware |= reading.firmware
        defaults |= reading.defaults
        for (section, key), value in reading.model.items():
            sections.setdefault(section, {})[key] = value
    facts = sections.pop(BUS_FACTS, {})
    parts: dict[str, Any] = {section: replace(getattr(model, section), **keys) for section, keys in sections.items()}
    if facts:
        parts[BUS_FACTS] = {**model.bus_facts, **facts}
    absent = set(parts.get("access", model.access).absent)
    if defaults or absent != model.absent.keys():
        rows = {
            pnu: replace(parameter, default=defaults[pnu]) if pnu in defaults else parameter
            for pnu, parameter in sorted((*model.parameters.items(), *model.absent.items()))
        }
        parts["parameters"] = parameters = {pnu: row for pnu, row in rows.items() if pnu not in absent}
        parts["absent"] = {pnu: row for pnu, row in rows.items() if pnu in absent}
        parts["axis_parameters"] = axis_parameters(parameters, linear=model.pitch > 0.0)
    model = replace(model, firmware=firmware, readings=usual | own, **parts)
    return model if named is None else with_set(model, named)
