"""The keys of the plant of the farm file: models, and wires between their ports and the stations' signals."""

from __future__ import annotations

import math
import re
import sys
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, PlainValidator, WithJsonSchema

from pnfarm.config.section import Section
from pnfarm.config.values import Duration
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

__all__ = ["MOST_MODELS", "MOST_WIRES", "PlantModel", "PlantSection", "WireText", "read_wire"]

MOST_MODELS, MOST_WIRES = 2000, 10_000
#: Ports of a model that it may name as metrics.
MOST_EXPORTED = 1000
FASTEST_STEP_NS, SLOWEST_STEP_NS = 500_000, 100_000_000
_NAME = re.compile(r"[A-Za-z_](?:[A-Za-z0-9_-]{0,62}[A-Za-z0-9_])?")
_NUMBER = r"[-+]?[0-9]{1,15}(?:\.[0-9]{1,15})?(?:[eE][-+]?[0-9]{1,3})?"
_UNIT = r"[A-Za-z%°µμ][A-Za-z0-9%°µμ/^².]{0,15}"
# FMUs have variables such as u[1,2] and der(x)
_END = r"[A-Za-z0-9_][][A-Za-z0-9_.,()-]{0,254}"
_WIRE = re.compile(
    rf"(?P<inverted>not\s+)?(?P<source>{_END})"
    rf"(?:\s*\*\s*(?P<scale>{_NUMBER})(?:\s*(?P<unit>{_UNIT}))?)?"
    rf"(?:\s*(?P<sign>[-+])\s*(?P<offset>{_NUMBER})(?:\s*(?P<offset_unit>{_UNIT}))?)?"
    rf"\s*->\s*(?P<target>{_END})"
)
_OF_FMUS = ("parameters", "on_failure")
_ALLOWED = "SOURCE -> TARGET, such as axis-1.shaft_position * 40 mm -> belt.travel, or not gate.on -> island-1.free"


@dataclass(frozen=True, slots=True)
class WireText:
    """A wire as it is written: the target gets source * scale + offset; ``unit``: of source * scale, if given."""

    text: str
    source: str
    target: str
    scale: float = 1.0
    unit: str = ""
    offset: float = 0.0
    offset_unit: str = ""
    inverted: bool = False

    @property
    def is_plain(self) -> bool:
        """Whether it changes nothing."""
        return self.scale == 1.0 and self.offset == 0.0 and not self.inverted


def read_wire(value: Any) -> WireText:
    """``SOURCE [* FACTOR [UNIT]] [+ OFFSET [UNIT]] -> TARGET``, or ``not SOURCE -> TARGET``; raises Problem."""
    if isinstance(value, WireText):
        return value
    if not isinstance(value, str):
        raise Problem(f"is {shown(value)}", _ALLOWED)
    found = _WIRE.fullmatch(value.strip()) if len(value) <= 1000 else None
    if found is None:
        raise Problem(f"{shown(value)} is no wire", _ALLOWED)
    scale = float(found["scale"] or 1.0)
    offset = float(found["offset"] or 0.0) * (-1.0 if found["sign"] == "-" else 1.0)
    wire = WireText(
        " ".join(value.split()),
        found["source"],
        found["target"],
        scale,
        found["unit"] or "",
        offset,
        found["offset_unit"] or "",
        found["inverted"] is not None,
    )
    if not (math.isfinite(scale) and math.isfinite(offset)):
        raise Problem(f"{shown(value)} has a number too large", _ALLOWED)
    if wire.inverted and (found["scale"] or found["offset"]):
        raise Problem(f"{shown(value)} inverts and scales", "one of the two: `not` is for bits")
    return wire


def _model_name(value: str) -> str:
    if not _NAME.fullmatch(value):
        raise Problem(f"{shown(value)} is not a model's name", "letters, digits, _ and - inside, at most 64 characters")
    return value


def _within(step_ns: int) -> int:
    if not FASTEST_STEP_NS <= step_ns <= SLOWEST_STEP_NS:
        raise Problem(f"{format_duration(step_ns)} is no step of a plant", "500us to 100ms")
    return step_ns


def _fmu_value(value: Any) -> Any:
    if isinstance(value, bool | str) or (isinstance(value, int | float) and abs(value) <= sys.float_info.max):
        return value
    raise Problem(f"is {shown(value)}", "a number, true, false, or a text")


def _on_failure(value: Any) -> Any:
    if isinstance(value, dict):
        return value
    if value == "hold":
        return {}
    raise Problem(f"is {shown(value)}", "hold, or {OUTPUT: VALUE}")


_FMU_VALUE = {"type": ["boolean", "number", "string"]}
FmuValue = Annotated[bool | int | float | str, PlainValidator(_fmu_value), WithJsonSchema(_FMU_VALUE)]
OnFailure = Annotated[
    dict[str, FmuValue],
    BeforeValidator(_on_failure),
    WithJsonSchema({"anyOf": [{"const": "hold"}, {"type": "object", "additionalProperties": _FMU_VALUE}]}),
]
PortName = Annotated[str, Field(min_length=1, max_length=255)]
Step = Annotated[Duration, AfterValidator(_within)]
Wire = Annotated[
    WireText,
    PlainValidator(read_wire),
    WithJsonSchema({"type": "string", "maxLength": 1000, "examples": ["gripper.extended -> island-1.gripped"]}),
]


def _texts(value: Any) -> Any:
    """A model's other keys are its parameters: numbers, switches, words, lists of words."""
    if isinstance(value, dict):
        for key, one in value.items():
            if key in _OF_FMUS:
                continue
            if not isinstance(one, int | float | str) and not (
                isinstance(one, list) and len(one) <= 64 and all(isinstance(each, str) for each in one)
            ):
                raise Problem(f"{key} is {shown(one)}", "a number, a word, or a list of words")
    return value


class PlantModel(Section):
    """A model of the plant: a built-in one (``kind``), a Python class, or an FMU; other keys are its parameters."""

    model_config = ConfigDict(strict=True, extra="allow", frozen=True, allow_inf_nan=False)
    first_keys: ClassVar[tuple[str, ...]] = ("name", "kind", "python", "fmu")

    name: Annotated[str, AfterValidator(_model_name)] = Field(description="Its name; its ports are NAME.PORT.")
    kind: str | None = Field(default=None, description="A built-in model of `pnfarm plant --kinds`.")
    python: str | None = Field(
        default=None, min_length=1, max_length=4096, description="A Python file with a class of ports and step."
    )
    class_name: str | None = Field(
        default=None, alias="class", min_length=1, max_length=200, description="The class, where the file has several."
    )
    fmu: str | None = Field(
        default=None, min_length=1, max_length=4096, description="An FMU for co-simulation, FMI 2.0 or 3.0."
    )
    fmu_parameters: dict[str, FmuValue] | None = Field(
        default=None, alias="parameters", max_length=10_000, description="Parameters of an FMU, by its names."
    )
    on_failure: OnFailure | None = Field(
        default=None, description="Outputs of an FMU that has failed: held, or the values of those that are named."
    )
    step_ns: Step | None = Field(
        default=None, alias="step", description="Time between its steps; left out, the plant's."
    )
    metrics: Annotated[list[PortName], Field(max_length=MOST_EXPORTED)] | bool = Field(
        default=False, description="Ports to export as pnfarm_signal_value{station, signal}; true: all of them."
    )

    @property
    def parameters(self) -> dict[str, Any]:
        """Its other keys."""
        return dict(self.model_extra or {})


class PlantSection(Section):
    """What is behind the stations: models that move, joined with their signals by wires."""

    step_ns: Step = Field(default=1_000_000, alias="step", description="Time between two steps of the plant.")
    models: list[Annotated[PlantModel, BeforeValidator(_texts)]] = Field(
        default_factory=list, max_length=MOST_MODELS, description="The models."
    )
    wires: list[Wire] = Field(
        default_factory=list,
        max_length=MOST_WIRES,
        description="SOURCE [* FACTOR [UNIT]] [+ OFFSET [UNIT]] -> TARGET, or not SOURCE -> TARGET.",
    )
