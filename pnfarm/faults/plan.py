"""An injection as requested: kind, drives, parameters, start and end.

:meth:`.Catalogue.parse` takes the dict that a scenario step, an API body or the command line makes; errors are
reported field by field.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import (
    ConfigDict,
    Field,
    PlainSerializer,
    PlainValidator,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

from pnfarm.config.fault_fields import FaultFields
from pnfarm.faults.errors import InjectionError
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.globs import GLOBS, GLOBS_SCHEMA, is_pattern, means, read_globs
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.faults.kind import InjectionKind, Misfits
    from pnfarm.wire.direction import Direction

__all__ = ["InjectionSpec", "matching"]

_ALLOWED = {
    "on": GLOBS,
    "params": "a mapping of the kind's parameters",
    "probability": "a number above 0, at most 1",
    "seed": "a whole number from 0 to 2^64 - 1",
    "direction": "in, out or both, seen from the drive",
    "after_cycles": "a whole number from 0 to 2^32 - 1",
    "count": "a whole number from 1 to 2^32 - 1",
    "cycles": "a whole number from 1 to 2^32 - 1",
    "most": "a whole number from 1 to 2^32 - 1",
    "times": "a whole number from 1 to 2^32 - 1",
    "as": "a name: a-z, 0-9, -, _ and ., at most 64 characters",
}
#: Most fields of an injection, and most of its parameters: more make no sense, and each wrong one would be reported.
MAX_FIELDS = 64
#: A shorter time to live could lapse between two renewals of a client on a busy machine.
SHORTEST_TTL_NS = 100_000_000


def _kind(value: Any, info: ValidationInfo) -> InjectionKind:
    kinds: Mapping[str, InjectionKind] = info.context or {}
    found = kinds.get(value) if isinstance(value, str) else None
    if found is None:
        hint = did_you_mean(value, kinds) if isinstance(value, str) else ""
        allowed = "a kind of `pnfarm fault kinds`: " + ", ".join(kinds)
        raise Problem(f"{shown(value)} is not a kind of fault{hint}", allowed)
    return found


if TYPE_CHECKING:
    Kind = InjectionKind
else:
    # as Any, because pydantic would derive its own schema from the dataclass
    Kind = Annotated[
        Any,
        PlainValidator(_kind),
        PlainSerializer(lambda kind: kind.name, return_type=str),
        WithJsonSchema({"type": "string", "enum": []}),
    ]
Globs = Annotated[
    list[str],
    PlainValidator(read_globs),
    WithJsonSchema(GLOBS_SCHEMA),
]
Params = Annotated[
    dict[str, Any],
    WithJsonSchema({"type": "object", "additionalProperties": {"type": ["number", "string", "boolean"]}}),
]


class InjectionSpec(FaultFields):
    """See the module's docstring. Times are nanoseconds here and durations such as ``500ms`` outside."""

    # the title is what the API's description calls it
    model_config = ConfigDict(title="FaultSpec")

    kind: Kind = Field(description="What it does, one of `pnfarm fault kinds`.")
    on: Globs = Field(description="Which drives: globs over their names, model:NAME, or all.")
    params: Params = Field(default_factory=dict, description="Parameters of this kind.")

    @classmethod
    def parse(cls, data: Mapping[str, Any], kinds: Mapping[str, InjectionKind]) -> Self:
        """From plain values; raises :class:`InjectionError` naming every wrong field and what is allowed."""
        for field, entries in (("fault", data), ("params", data.get("params"))):
            if isinstance(entries, dict) and len(entries) > MAX_FIELDS:
                raise InjectionError([(field, f"has {len(entries)} fields", f"at most {MAX_FIELDS}")])
        try:
            return cls.model_validate(dict(data), context=kinds)
        except ValidationError as exc:
            raise InjectionError(issue for error in exc.errors(include_url=False) for issue in _issues(error)) from exc

    @classmethod
    def schema_of(cls, kinds: Iterable[str]) -> dict[str, Any]:
        """The JSON Schema of what :meth:`parse` takes."""
        schema = cls.model_json_schema(by_alias=True)
        schema["properties"]["kind"]["enum"] = list(kinds)
        return schema

    @model_validator(mode="after")
    def _fits_the_kind(self) -> Self:
        misfits = [(field, problem.what, problem.allowed) for field, problem in _misfits(self)]
        if misfits:
            raise PydanticCustomError("pnfarm-kind", "{what}", {"what": misfits[0][1], "misfits": misfits})
        return self

    def without(self, *fields: str) -> Self:
        """A copy without these fields."""
        return self.model_copy(update=dict.fromkeys(fields))

    @property
    def chooses(self) -> bool:
        """Whether drives or times are chosen at random, so that the seed counts for any kind."""
        return self.share is not None or self.most is not None or self.rate is not None

    @property
    def ends(self) -> bool:
        """Whether it ends without being cleared."""
        return self.count is not None or self.for_ns is not None or self.cycles is not None

    def limited_to(self, count: int) -> Self:
        """A copy with this ``count``."""
        return self.model_copy(update={"count": count})

    def values(self) -> dict[str, Any]:
        """Every parameter of the kind as its effect uses it: given, preset or default."""
        kind = self.kind
        found: dict[str, Any] = dict(kind.preset)
        for name, spec in kind.params.items():
            value = self.params.get(name, spec.default)
            found[name] = None if value is None else spec.read(value)
        return found

    @property
    def directions(self) -> tuple[Direction, ...]:
        """Those in force; empty for a kind that has none."""
        if not self.kind.directions:
            return ()
        match self.direction or self.kind.directions[0]:
            case "in":
                return ("in",)
            case "out":
                return ("out",)
            case _:
                return ("out", "in")


def _misfits(spec: InjectionSpec) -> Misfits:
    kind = spec.kind
    for name, value in spec.params.items():
        known = kind.params.get(name)
        if known is None:
            allowed = ", ".join(kind.params) or f"none: {kind.name} has no parameters"
            yield (
                f"params.{name[:60]}",
                Problem(f"{kind.name} has no such parameter{did_you_mean(name, kind.params)}", allowed),
            )
            continue
        try:
            known.read(value)
        except Problem as problem:
            yield f"params.{name}", problem
    for name, known in kind.params.items():
        if known.required and name not in spec.params:
            yield f"params.{name}", Problem("is missing", known.allowed)
    given = {
        "probability": spec.probability,
        "seed": spec.seed,
        "count": spec.count,
        "for": spec.for_ns,
        "cycles": spec.cycles,
    }
    for name, common in given.items():
        if name == "seed" and spec.chooses:
            continue
        if common is not None and name not in kind.takes:
            yield (
                name,
                Problem(f"means nothing for {kind.name}", ", ".join((*kind.common, *sorted(kind.takes)))),
            )
    if spec.direction is not None and spec.direction not in kind.directions:
        allowed = ", ".join(kind.directions) or f"none: {kind.name} has no direction"
        yield "direction", Problem(f"is {shown(spec.direction)}", allowed)
    if spec.times is not None and spec.rate is None:
        yield "times", Problem("means nothing without rate", "times with rate; count ends after N occurrences")
    if spec.rate is not None and not (
        spec.ends or (kind.effect.ends_by_itself and spec.params.get("hold") is not True)
    ):
        ends = ", ".join(sorted({"count", "for", "cycles"} & kind.takes))
        if ends:
            yield "rate", Problem(f"needs an end of each {kind.name}, or it would begin once only", f"rate with {ends}")
        else:
            yield "rate", Problem(f"means nothing for {kind.name}, which lasts until it is cleared", "leave it out")
    if spec.ttl_ns is not None and spec.ttl_ns < SHORTEST_TTL_NS:
        yield "ttl", Problem(f"is {format_duration(spec.ttl_ns)}", "a duration of 100ms or more")
    yield from kind.misfits(spec)


def _issues(error: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """One of pydantic's errors as (field, what is wrong, what is allowed); this module's own error gives several."""
    return error["ctx"]["misfits"] if error["type"] == "pnfarm-kind" else [_issue(error)]


def _issue(error: Mapping[str, Any]) -> tuple[str, str, str]:
    kind, context = error["type"], error.get("ctx", {})
    field = ".".join(str(step)[:60] for step in error["loc"]) or "fault"
    if isinstance(problem := context.get("error"), Problem):
        return field, problem.what, problem.allowed
    if kind == "missing":
        return field, "is missing", _ALLOWED.get(field, "a kind of `pnfarm fault kinds`")
    if kind == "extra_forbidden":
        keys = [info.alias or name for name, info in InjectionSpec.model_fields.items()]
        return field, f"is not a field of an injection{did_you_mean(str(error['loc'][-1]), keys)}", ", ".join(keys)
    return field, f"is {shown(error.get('input'))}", _ALLOWED.get(field.split(".", maxsplit=1)[0], error["msg"])


def matching(globs: Iterable[str], drives: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]) -> list[str]:
    """The drives that the globs match, in their order; ``drives``: name -> (its names, names of its model).

    Raises :class:`InjectionError` for a glob that matches none.
    """
    chosen: set[str] = set()
    answering: dict[str, list[str]] = {}
    for name, (names, _) in drives.items():
        for other in names:
            answering.setdefault(other, []).append(name)
    for glob in globs:
        if glob == "all":
            found = set(drives)
        elif is_pattern(glob):
            found = {name for name, known in drives.items() if means(glob, *known)}
        else:
            found = set(answering.get(glob, ()))
        if not found:
            raise InjectionError([("on", _no_drive(glob, drives), _ALLOWED["on"])])
        chosen |= found
    return [name for name in drives if name in chosen]


def _no_drive(glob: str, drives: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]) -> str:
    prefix, _, model = glob.partition(":")
    if prefix == "model" and model:
        known = sorted({name for _, models in drives.values() for name in models})
        return f"no drive is of model {shown(model)}{did_you_mean(model, known)}; there are {', '.join(known)}"
    return f"no drive matches {shown(glob)}{did_you_mean(glob, drives)}"
