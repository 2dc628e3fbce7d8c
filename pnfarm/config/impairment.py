"""Faults that a farm file injects from the start."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import Field, PlainValidator, ValidationInfo, WithJsonSchema

from pnfarm.config.section import Section
from pnfarm.config.values import Duration, Globs, Scalar
from pnfarm.vocabulary.conditions import CONDITION_SCHEMA, read_condition
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown
from pnfarm.wire.direction import Directions

__all__ = ["FAULT_KINDS", "Impairment"]

#: Key of the validation context: the kinds of the fault catalogue, or None where kinds are not checked.
FAULT_KINDS = "fault_kinds"


def _read_kind(value: Any, info: ValidationInfo) -> str:
    allowed = "a kind of `pnfarm fault kinds`, such as loss or f702"
    if not isinstance(value, str) or not _KIND.fullmatch(value):
        raise Problem(f"{shown(value)} is not a kind of fault", allowed)
    kinds = (info.context or {}).get(FAULT_KINDS)
    if kinds is not None and value not in kinds:
        raise Problem(f"{shown(value)} is not a kind of fault{did_you_mean(value, kinds)}", allowed)
    return value


_KIND = re.compile(r"[a-z0-9][a-z0-9-]*")
FaultKind = Annotated[
    str, PlainValidator(_read_kind), WithJsonSchema({"type": "string", "pattern": f"^{_KIND.pattern}$"})
]


Condition = Annotated[str, PlainValidator(read_condition), WithJsonSchema(CONDITION_SCHEMA)]


class Impairment(Section):
    """A fault that is active from the start; the kinds are those of `pnfarm fault kinds`."""

    kind: FaultKind = Field(description="Kind of fault, such as loss or f702.")
    on: Globs | None = Field(default=None, description="Drives; left out, all of the group.")
    params: dict[str, Scalar] = Field(default_factory=dict, description="Parameters of this kind.")
    probability: float | None = Field(default=None, gt=0, le=1, description="Probability of each occurrence.")
    seed: int | None = Field(
        default=None, ge=0, le=(1 << 64) - 1, description="Seed of the random choices, to repeat a run."
    )
    direction: Directions | None = Field(default=None, description="Direction, seen from the drive.")
    when: Condition | None = Field(default=None, description="Begin once this holds on the drive.")
    after_cycles: int | None = Field(default=None, ge=0, description="Begin after this many healthy cycles.")
    after_ns: Duration | None = Field(default=None, alias="after", description="Begin after this time.")
    count: int | None = Field(default=None, ge=1, description="End after this many occurrences.")
    for_ns: Duration | None = Field(default=None, alias="for", description="End after this time.")
    cycles: int | None = Field(default=None, ge=1, description="End after this many cycles.")
