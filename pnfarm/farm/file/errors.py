"""From the validator's errors to sentences: what is wrong, and what the key allows."""

from __future__ import annotations

import typing
from typing import TYPE_CHECKING, Any, Literal

import annotated_types
from pydantic.fields import FieldInfo

from pnfarm.buses.devices import devices_part
from pnfarm.buses.registry import BUSES
from pnfarm.config.controller import ControllerSection
from pnfarm.config.device import DeviceGroup
from pnfarm.config.drive import DriveGroup
from pnfarm.config.links import LINK_KINDS
from pnfarm.config.section import Section
from pnfarm.farm.file.choice import titles
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown

if typing.TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

if TYPE_CHECKING:
    from pnfarm.buses.bus import Bus
    from pnfarm.farm.file.choice import Choice
    from pnfarm.vocabulary.issues import Location

__all__ = ["Explainer", "strip_tags"]

#: Name of a section in messages about a key of another bus.
_CALLED: dict[type[Section], str] = {DriveGroup: "a drive", ControllerSection: "a controller"}

#: Sections whose location carries the union's tag after the key: ``("link", "veth", "bridge")``.
_TAGGED = frozenset(("link",))


_BY_TYPE = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "bool_type": "true or false",
    "string_type": "a word",
    "list_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "finite_number": "a finite number",
}

#: Errors about a length -> what is counted.
_LENGTHS = {
    "string_too_short": ("character", "characters"),
    "string_too_long": ("character", "characters"),
    "too_short": ("entry", "entries"),
    "too_long": ("entry", "entries"),
    "bytes_too_short": ("octet", "octets"),
    "bytes_too_long": ("octet", "octets"),
}


def strip_tags(location: Location) -> Location:
    """The location as the file has it."""
    steps: list[str | int] = []
    after_tagged = False
    for step in location:
        # a wrong key of a mapping has its place followed by this word
        if not after_tagged and step != "[key]":
            steps.append(step)
        after_tagged = not after_tagged and step in _TAGGED
    return tuple(steps)


class Explainer:
    """Explains the errors of one file: its ``values`` were read as ``root``, by the keys that ``choice`` selects."""

    def __init__(self, root: type[Section], values: Any, choice: Choice) -> None:
        self._choice = choice
        self._known: dict[Location, tuple[list[type[Section]], Any]] = {(): ([root], values)}

    def explain(self, error: Mapping[str, Any]) -> tuple[Location, str, str]:
        """One of pydantic's errors as (place in the file, what is wrong, what is allowed)."""
        place, what, allowed = self._explain(error)
        return place, self._bus_before(place, error["type"], what) + what, allowed

    def _bus_before(self, place: Location, kind: str, what: str) -> str:
        """``on PROFINET: `` for a key of the controllers' section that not all of several controllers have."""
        match place:
            case ("controller", str(key), *_) if key not in BUSES and kind != "extra_forbidden":
                several = self._at(place[:1])[0]
                knowing = [bus for bus in BUSES.values() if _knows(bus, key, several)]
                if 0 < len(knowing) < len(several) and not all(bus.title in what for bus in knowing):
                    return f"on {titles(knowing)}: "
            case _:
                pass
        return ""

    def _explain(self, error: Mapping[str, Any]) -> tuple[Location, str, str]:
        location: Location = error["loc"]
        place = strip_tags(location)
        kind: str = error["type"]
        value = error.get("input")
        context = error.get("ctx", {})
        if isinstance(found := context.get("error"), Problem):
            return place, found.what, found.allowed
        field = self._field_at(location)
        if kind == "missing":
            return place, "is missing", _described(field)
        if kind == "extra_forbidden":
            return place, *self._unknown_key(location)
        if kind in {"union_tag_invalid", "union_tag_not_found"} or (place[-1:] == ("link",) and kind in _BY_TYPE):
            return place, *_wrong_tag(value)
        if kind == "literal_error":
            words = [str(word) for word in _literals(field)]
            hint = did_you_mean(value, words) if isinstance(value, str) else ""
            return place, f"is {shown(value)}{hint}", ", ".join(words) or context["expected"]
        if kind in _BY_TYPE:
            # a secret, which a log would keep, is not repeated
            what = f"is {shown(value)}" if field is None or field.repr else "is not text: put it in quotes"
            return place, what, _BY_TYPE[kind] + (self._keys(location) if kind == "model_type" else _bounds(field))
        if kind.startswith(("greater_than", "less_than")):
            return place, f"is {shown(value)}", "a number" + _bounds(field)
        if kind in _LENGTHS:
            return place, *_wrong_length(kind, value, context, field)
        if kind == "string_pattern_mismatch":
            return place, f"{shown(value)} is not allowed here", f"{_described(field)} ({context['pattern']})"
        return place, f"is {shown(value)}: {error['msg']}", _described(field)

    def _keys(self, location: Location) -> str:
        """The keys of the mapping that a value should be."""
        keys = dict.fromkeys(key for model in self._at(location)[0] for key in model.listed_keys())
        return f" with {', '.join(keys)}" if keys else ""

    def _unknown_key(self, location: Location) -> tuple[str, str]:
        models, _ = self._at(location[:-1])
        keys = list(dict.fromkeys(key for model in models for key in model.listed_keys()))
        key = str(location[-1])
        for section in (DriveGroup, ControllerSection):
            if any(issubclass(model, section) for model in models):
                for bus in BUSES.values():
                    other = _section_of(bus, section)
                    if other is not None and key in other.listed_keys():
                        own = titles([own for own in BUSES.values() if _section_of(own, section) in models])
                        what = f"is a key of {bus.title}, and this is {_CALLED[section]} on {own}"
                        return what, ", ".join(keys)
        return f"is not a key here{did_you_mean(key, keys)}", ", ".join(keys)

    def _at(self, location: Location) -> tuple[list[type[Section]], Any]:
        """The sections that a value may be (those of groups and controller as their bus has them), and the value."""
        if (known := self._known.get(location)) is not None:
            return known
        models, value = self._at(location[:-1])
        step = location[-1]
        value = _inside(value, step)
        tagged = [model for model in models if step in _literals(model.model_fields.get("kind"))]
        if isinstance(step, int):
            models = [one for model in models for one in self._as_buses_have_it(model, value)]
        elif step in BUSES and any(issubclass(model, ControllerSection) for model in models):
            # the map for one bus
            models = [BUSES[step].farm_file.controller or ControllerSection]
        elif tagged and len(models) > 1:
            models = tagged
        else:
            fields = [field for model in models if (field := _field(model, step)) is not None]
            models = [member for field in fields for member in _members(field.annotation)]
            if not isinstance(value, list):
                models = [one for model in models for one in self._as_buses_have_it(model, value)]
        self._known[location] = models, value
        return models, value

    def _as_buses_have_it(self, model: type[Section], value: Any) -> list[type[Section]]:
        if model is DriveGroup:
            return [self._choice.group(value).farm_file.drives]
        if model is DeviceGroup:
            return [devices_part(self._choice.devices(value)).devices]
        if model is ControllerSection:
            return [one.section for one in self._choice.controllers(value)]
        return [model]

    def _field_at(self, location: Location) -> FieldInfo | None:
        # a place inside a list or a mapping of values is described by the key that holds it
        for end in range(len(location), 0, -1):
            step = location[end - 1]
            if isinstance(step, str):
                for model in self._at(location[: end - 1])[0]:
                    if (field := _field(model, step)) is not None:
                        return field
        return None


def _section_of(bus: Bus, section: type[Section]) -> type[Section] | None:
    return bus.farm_file.drives if section is DriveGroup else bus.farm_file.controller


def _knows(bus: Bus, key: str, sections: list[type[Section]]) -> bool:
    section = bus.farm_file.controller
    return section is not None and section in sections and key in section.listed_keys()


def _inside(value: Any, step: str | int) -> Any:
    """The value at a step of a location; None where there is none, as after a union's tag."""
    if isinstance(value, dict) and isinstance(step, str):
        return value.get(step)
    if isinstance(value, list) and isinstance(step, int) and step < len(value):
        return value[step]
    return None


def _wrong_length(kind: str, value: Any, context: Mapping[str, Any], field: FieldInfo | None) -> tuple[str, str]:
    """How long a value is, and how long it may be; never the value, which may be a secret."""
    rules = [*(field.metadata if field is not None else ()), _Length(context)]
    low = next((rule.min_length for rule in rules if getattr(rule, "min_length", None)), None)
    high = next((rule.max_length for rule in rules if getattr(rule, "max_length", None) is not None), None)
    one, many = _LENGTHS[kind]
    length = len(value) if isinstance(value, (str, list, tuple, dict)) else 0
    what = f"has {length} {one if length == 1 else many}" if length else "is empty"
    bounds = f"{low} to {high}" if low and high else f"at most {high}" if high else f"at least {low}"
    only = high or low
    described = _described(field)
    allowed = f"{bounds} {one if only == 1 else many}"
    return what, f"{allowed}: {described}" if described else allowed


class _Length:
    """The bound in pydantic's error, where the key's own rules have none."""

    def __init__(self, context: Mapping[str, Any]) -> None:
        self.min_length: int | None = context.get("min_length")
        self.max_length: int | None = context.get("max_length")


def _wrong_tag(value: Any) -> tuple[str, str]:
    kinds = tuple(LINK_KINDS)
    allowed = "kind: " + ", ".join(kinds)
    tag = value.get("kind") if isinstance(value, dict) else None
    if tag is None:
        return "has no kind" if isinstance(value, dict) else f"is {shown(value)}, not a mapping with a kind", allowed
    hint = did_you_mean(tag, kinds) if isinstance(tag, str) else ""
    return f"{shown(tag)} is not a kind of link{hint}", allowed


# --- the models behind a location -------------------------------------------------------------------------------


def _members(annotation: Any) -> Iterator[type[Section]]:
    """The models inside ``X | None``, ``list[X]``, ``Annotated[X | Y, ...]``."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield annotation
        return
    for argument in typing.get_args(annotation):
        yield from _members(argument)


def _field(model: type[Section], key: str) -> FieldInfo | None:
    for name, field in model.model_fields.items():
        if key == (field.alias or name):
            return field
    return None


def _described(field: FieldInfo | None) -> str:
    if field is None or not field.description:
        return ""
    text = field.description.split(". ", maxsplit=1)[0].rstrip(".")
    return text[:1].lower() + text[1:] if text[:2] != text[:2].upper() else text


def _literals(field: FieldInfo | None) -> list[Any]:
    if field is None:
        return []
    found: list[Any] = []
    pending = [field.annotation]
    while pending:
        annotation = pending.pop()
        if typing.get_origin(annotation) is Literal:
            found += typing.get_args(annotation)
        else:
            pending += typing.get_args(annotation)
    return found


def _bounds(field: FieldInfo | None) -> str:
    """`` from 1 to 99``, `` above 0`` ... as the key's own bounds say."""
    if field is None:
        return ""
    low = high = ""
    for rule in _rules(field):
        match rule:
            case annotated_types.Ge(ge=bound):
                low = f" from {bound}"
            case annotated_types.Gt(gt=bound):
                low = f" above {bound}"
            case annotated_types.Le(le=bound):
                high = f" to {bound}"
            case _:
                pass
    return low + high


def _rules(field: FieldInfo) -> list[Any]:
    """A key's own rules, and those of the values in its list."""
    rules = list(field.metadata)
    pending: list[Any] = [field.annotation]
    while pending:
        inner = typing.get_args(pending.pop())
        rules += [rule for part in inner if isinstance(part, FieldInfo) for rule in part.metadata]
        pending += inner
    return rules
