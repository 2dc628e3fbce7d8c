"""Faults that a farm file injects from the start."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import Field, PlainValidator, ValidationInfo, WithJsonSchema, field_validator

from pnfarm.config.fault_fields import FaultFields
from pnfarm.config.values import Globs, Scalar  # noqa: TC001 - pydantic reads the annotations of fields
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown
from pnfarm.vocabulary.samples import with_files

__all__ = ["FAULT_KINDS", "FOLDER", "Impairment"]

#: Keys of the validation context: the kinds of the fault catalogue, or None where kinds are not checked; the folder of
#: the farm file.
FAULT_KINDS, FOLDER = "fault_kinds", "folder"


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


class Impairment(FaultFields):
    """A fault that is active from the start; the kinds are those of `pnfarm fault kinds`."""

    kind: FaultKind = Field(description="Kind of fault, such as loss or f702.")
    on: Globs | None = Field(default=None, description="Drives; left out, all of the group.")
    params: dict[str, Scalar] = Field(default_factory=dict, description="Parameters of this kind.")

    @field_validator("params")
    @classmethod
    def _with_files(cls, params: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        found: dict[str, Any] = with_files(params, (info.context or {}).get(FOLDER))
        return found
