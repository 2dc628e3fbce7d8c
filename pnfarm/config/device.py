"""The keys of a device (a station without axes) of the farm file."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, PlainValidator, WithJsonSchema, model_validator

from pnfarm.config.drive import MAX_DRIVES
from pnfarm.config.impairment import Impairment
from pnfarm.config.section import DescribedSection, Section
from pnfarm.config.values import NamePattern
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown
from pnfarm.wire.value_types import BOOL, TYPE_PATTERN, UINT8, ByteOrder, ValueType, read_type

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.config.drive import Claim

__all__ = ["DeviceConfig", "DeviceGroup", "SignalPlace", "SignalSetting", "read_place"]

_PLACE = re.compile(r"([0-9]{1,5})\.([0-9]{1,5})\.([0-9]{1,4})(?:\.([0-7]))?")
_MOST_SCALE = 1e12
#: Kinds of types that a metric can have.
_EXPORTED = frozenset({"bool", "int", "uint", "float"})
_ALLOWED = "slot.subslot.octet or slot.subslot.octet.bit, such as 3.1.0 or 1.1.0.3"
#: Slot, subslot, octet, bit.
Place = tuple[int, int, int, int | None]
PLACE_SCHEMA = WithJsonSchema({"type": "string", "pattern": rf"^{_PLACE.pattern}$", "examples": ["1.1.0.3", "3.1.0"]})
PlaceText = Annotated[str, PLACE_SCHEMA]


def read_place(value: Any) -> Place:
    """``1.1.0.3``: slot, subslot, octet, and bit or None."""
    if not isinstance(value, str):
        raise Problem(f"is {shown(value)}", _ALLOWED)
    found = _PLACE.fullmatch(value.strip())
    if found is None:
        raise Problem(f"{shown(value)} is not a place in a device's data", _ALLOWED)
    slot, subslot, octet, bit = found.groups()
    if int(slot) > 0x7FFF or not 0 < int(subslot) <= 0x9FFF:
        raise Problem(f"{shown(value)} is not a place in a device's data", "slots 0 to 32767, subslots 1 to 40959")
    return int(slot), int(subslot), int(octet), None if bit is None else int(bit)


def _read_type(value: Any) -> ValueType:
    if not isinstance(value, str):
        raise Problem(f"is {shown(value)}", "a type such as bool, int16, uint32, float32, octets[8] or text[20]")
    return read_type(value)


def _read_scale(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value == 0:
        raise Problem(f"is {shown(value)}", "a number other than 0: one step of the raw value in units")
    if abs(value) > _MOST_SCALE:
        raise Problem(f"is {shown(value)}", f"-{_MOST_SCALE:g} to {_MOST_SCALE:g}")
    return float(value)


class SignalPlace(Section):
    """A named value of a device's data: where it lies, its type, unit and scale."""

    at: Annotated[Place, PlainValidator(read_place), PLACE_SCHEMA] = Field(
        description="slot.subslot.octet, and .bit for a bool."
    )
    type: Annotated[
        ValueType | None,
        PlainValidator(_read_type),
        WithJsonSchema({"type": "string", "pattern": f"^{TYPE_PATTERN}$", "examples": ["int16", "octets[8]"]}),
    ] = Field(default=None, description="bool where `at` names a bit, else uint8, unless given.")
    unit: str = Field(default="", max_length=20, description="Unit of the value.")
    scale: Annotated[
        float,
        PlainValidator(_read_scale),
        WithJsonSchema({"type": "number", "minimum": -_MOST_SCALE, "maximum": _MOST_SCALE}),
    ] = Field(default=1.0, description="Value of one step of the raw number, in units.")
    order: ByteOrder | None = Field(default=None, description="Order of the octets; left out, that of the bus.")
    direction: Literal["input", "output"] | None = Field(
        default=None, description="The controller's; input where the submodule has inputs, else output, unless given."
    )

    metrics: bool | None = Field(
        default=None,
        description="Export it as pnfarm_signal_value{station, signal}; left out, as the group's `metrics` says.",
    )

    @property
    def value_type(self) -> ValueType:
        """The type given, else the one that `at` implies."""
        return self.type or (UINT8 if self.at[3] is None else BOOL)

    @property
    def text(self) -> str:
        """``1.1.0.3``."""
        return ".".join(str(number) for number in self.at if number is not None)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.at[3] is not None and self.value_type != BOOL:
            raise Problem(
                f"`at` names bit {self.at[3]}, {self.value_type.name} has whole octets",
                "type: bool, or `at` without a bit",
            )
        if self.scale != 1 and not self.value_type.is_number:
            raise Problem(f"`scale` is for numbers, not for {self.value_type.name}", "no scale, or such as type: int16")
        if self.metrics:
            self.check_metric()
        return self

    def check_metric(self) -> None:
        """Raises :class:`Problem` for a type that no metric has."""
        if self.value_type.kind not in _EXPORTED:
            raise Problem(
                f"is of type {self.value_type.name}, and a metric is a number", "metrics: false, or another type"
            )


def _open_place(value: Any) -> Any:
    if isinstance(value, str):
        return {"at": value}
    if isinstance(value, (dict, SignalPlace)):
        return value
    raise Problem(f"is {shown(value)}", f"{_ALLOWED}, or a mapping such as {{at: 3.1.0, type: int16, unit: bar}}")


#: A value of the key `signals`: ``1.1.0.3``, or a mapping.
SignalSetting = Annotated[SignalPlace, BeforeValidator(_open_place, json_schema_input_type=PlaceText | SignalPlace)]

SignalName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,79}$")]


class DeviceGroup(DescribedSection):
    """One device, or `count` alike; its maker's file describes it."""

    first_keys: ClassVar[tuple[str, ...]] = ("name", "count", "start")
    #: What messages call them.
    members: ClassVar[str] = "devices"

    name: NamePattern = Field(description="Station name; {n} counts, {n:02} with leading zeros.")
    count: int = Field(default=1, ge=1, le=MAX_DRIVES, description="Number of devices.")
    start: int = Field(default=1, ge=0, le=1_000_000, description="First number for {n}.")
    signals: dict[SignalName, SignalSetting] = Field(
        default_factory=dict,
        description="Names of values in its data, besides those of its file: slot.subslot.octet.bit, or a mapping "
        "with `at`, type, unit and scale.",
        examples=[{"part_present": "1.1.0.3"}],
    )
    metrics: bool = Field(default=False, description="Export every signal that `signals` names as a metric.")
    limits: Literal["strict", "lax"] = Field(
        default="strict",
        description="strict: refuse what the file does not permit; lax: permit every cycle, and keep parameter records "
        "that are wrong with a warning.",
    )
    impair: list[Impairment] = Field(default_factory=list, description="Faults that are active from the start.")

    @model_validator(mode="after")
    def _exports(self) -> Self:
        for name, place in self.signals.items() if self.metrics else ():
            if place.metrics is None:
                try:
                    place.check_metric()
                except Problem as problem:
                    raise Problem(f"`metrics` exports {name}, which {problem.what}", problem.allowed) from problem
                self.signals[name] = place.model_copy(update={"metrics": True})
        return self

    @property
    def is_described(self) -> bool:
        """Whether its file was read, without errors."""
        return self.described is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceConfig:
    """One device as the farm file configures it; a bus's devices have more.

    ``index`` counts through the farm's devices from 0; ``group`` is the entry of ``devices:`` that it comes from.
    ``kinds``: what it is, by the names of its file.  ``mac`` is that of its port.
    """

    index: int
    group: int
    name: str
    bus: str
    kinds: tuple[str, ...]
    strict: bool
    impair: tuple[Impairment, ...]
    mac: bytes = b""

    @classmethod
    def extending(cls, common: DeviceConfig, **own: Any) -> Self:
        """The device of a bus: the fields of ``common``, and the bus's ``own``."""
        return cls(**{each.name: getattr(common, each.name) for each in fields(DeviceConfig)} | own)

    @property
    def names(self) -> tuple[str, ...]:
        """Its own: it has no axes."""
        return (self.name,)

    @property
    def known_signals(self) -> Mapping[str, Any]:
        """Its signals (:class:`pnfarm.signals.signal.Signal`) by name."""
        return {}

    def claims(self) -> Sequence[Claim]:
        """Values that no other station of the farm may have, besides its name."""
        return ()

    def addresses(self) -> Sequence[str]:
        """Its addresses on its bus, as text for a table: hardware address, address."""
        return "", ""
