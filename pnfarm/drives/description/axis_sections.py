"""A drive's properties on any bus, from its sections: limits of its axis, motion tasks, units, monitoring."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from pnfarm.drives.description.fault_rows import number_of_fault
from pnfarm.drives.description.parts import (
    SEND_CLOCKS,
    FollowingError,
    Limits,
    MotionTaskParameters,
    PositionUnits,
    SignOfLife,
    fault_label,
)
from pnfarm.drives.parameters.parameter import Backing
from pnfarm.errors import ConfigError
from pnfarm.table.axis_codes import MOTION_TASKS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.drives.description.parts import Fault
    from pnfarm.drives.description.sections import Section
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = [
    "read_limits",
    "read_motion_tasks",
    "read_parameter_texts",
    "read_position_units",
    "read_watched",
    "wants_stored",
]

_Watched = TypeVar("_Watched", SignOfLife, FollowingError)


def wants_stored(section: Section, key: str, parameters: Mapping[int, Parameter]) -> Parameter:
    """The plain stored parameter that a key names; raises :class:`ConfigError` for any other."""
    parameter = parameters.get(section[key].value)
    if parameter is None or parameter.backing is not Backing.STORED or parameter.elements:
        raise section.wrong(key, f"{section[key].value} is not a plain parameter that is stored")
    return parameter


def read_limits(section: Section) -> Limits:
    limits: Limits = section.build(Limits)
    if type(limits.alarms) is not bool:
        raise section.wrong("alarms", f"{limits.alarms!r} is neither true nor false")
    if not limits.send_clocks or set(limits.send_clocks) - set(SEND_CLOCKS):
        raise section.wrong("send_clocks", f"{list(limits.send_clocks)} are not all among {list(SEND_CLOCKS)}")
    if limits.max_cycle_ns and limits.max_cycle_ns < limits.min_cycle_ns:
        raise section.wrong("max_cycle_ns", f"{limits.max_cycle_ns} is below min_cycle_ns, {limits.min_cycle_ns}")
    if not 0 <= limits.motion_tasks <= MOTION_TASKS:
        raise section.wrong("motion_tasks", f"{limits.motion_tasks} is not within 0..{MOTION_TASKS}")
    if type(limits.axes) is not int or limits.axes < 1:
        raise section.wrong("axes", f"{limits.axes!r} is not a number of axes")
    return limits


def read_watched(kind: type[_Watched], section: Section, faults: Mapping[int, Fault]) -> _Watched | None:
    """A condition that a drive monitors, and the fault that it raises."""
    if not section:
        return None
    watched: _Watched = section.build(kind)
    watched = replace(watched, fault=number_of_fault(str(watched.fault), partial(section.where, "fault")))
    if watched.fault not in faults:
        raise section.wrong("fault", f"there is no fault {fault_label(watched.fault)}")
    return watched


def read_motion_tasks(section: Section, parameters: Mapping[int, Parameter]) -> MotionTaskParameters | None:
    """The section of a drive that keeps motion tasks: plain stored parameters, each once."""
    if not section:
        return None
    numbers: MotionTaskParameters = section.build(MotionTaskParameters)
    for key in section:
        parameter = wants_stored(section, key, parameters)
        if key in {"number", "next"} and parameter.maximum >= MOTION_TASKS:
            raise section.wrong(key, f"PNU {parameter.pnu} goes beyond task {MOTION_TASKS - 1}")
    return numbers


def read_position_units(section: Section, parameters: Mapping[int, Parameter]) -> PositionUnits | None:
    """The section of a drive with selectable position units: plain stored parameters, and a value for each unit.

    A parameter that it does not name counts as 1, or as the first unit.
    """
    if not section:
        scaled = next((parameter.pnu for parameter in parameters.values() if parameter.scale == "position"), None)
        if scaled is not None:
            raise section.wrong("", f"missing, but PNU {scaled} has the scale position")
        return None
    units: PositionUnits = section.build(PositionUnits)
    for key in ("scaling", "unit", "numerator", "denominator"):
        if key in section:
            wants_stored(section, key, parameters)
    for key, number in (("default", units.default), ("multiple", units.multiple)):
        if not isinstance(number, int | float) or number <= 0.0:
            raise section.wrong(key, f"{number!r} is not a number above 0")
    if not units.revolution:
        raise section.wrong("revolution", "must have a number")
    if units.unit and parameters[units.unit].maximum >= len(units.revolution):
        raise section.wrong("revolution", f"PNU {units.unit} goes to {parameters[units.unit].maximum}")
    for key, pnu in (("scaling", units.scaling), ("numerator", units.numerator), ("denominator", units.denominator)):
        if pnu and parameters[pnu].minimum < 1:
            where = section.where(key)
            raise ConfigError(f"{where}: PNU {pnu} may be {parameters[pnu].minimum}, which divides nothing")
    return units


def read_parameter_texts(section: Section, parameters: Mapping[int, Parameter]) -> dict[int, tuple[str, ...]]:
    """PNU -> a text for each element of an array."""
    found: dict[int, tuple[str, ...]] = {}
    for key, fact in section.items():
        parameter = parameters.get(int(key))
        if parameter is None or len(fact.value) != parameter.elements:
            raise section.wrong(key, f"not an array, or not of {len(fact.value)} elements")
        found[parameter.pnu] = fact.value
    return found
