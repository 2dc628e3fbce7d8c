"""``realism`` of a drive group: noise, latency, boot time and clock drift, and its short forms.

A key that is left out is on where a source gives the model's figure, the drives' limits are strict and the link is
real; else it is off.  ``on`` takes the model's figure, even if it is assumed.
"""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PlainValidator, WithJsonSchema

from pnfarm.config.section import Section
from pnfarm.config.values import OFF
from pnfarm.drives.description.realism import BOUNDS
from pnfarm.vocabulary.durations import format_duration, read_duration
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pnfarm.drives.description.model import Model

__all__ = ["ALL", "OFF", "ON", "SWITCH", "BootTime", "DriveRealism", "Noise", "Realism", "asked_for", "missing_figures"]

ON: Literal["on"] = "on"
#: Value of each key with the short form ``realism: on``: on, where the model has a figure.
ALL: Literal["all"] = "all"
#: Values of the short forms, including those of YAML 1.1, which some editors write.
SWITCH: dict[str, Any] = {"enum": [ON, OFF, True, False]}

_DURATION_SCHEMA = {"type": "string", "examples": ["20ms"]}


def _switch(value: Any) -> str | None:
    """``on`` or ``off``, None for anything else."""
    if value is True or value == ON:
        return ON
    return OFF if value is False or value == OFF else None


def _number(value: Any, least: float, most: float, unit: str) -> float:
    allowed = f"a number from {least:g} to {most:g} {unit}, on or off"
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Problem(f"is {shown(value)}", allowed)
    if not isfinite(value) or not least <= value <= most:
        raise Problem(f"is {shown(value)}", allowed)
    return float(value)


def _duration(value: Any, most_ns: int, also: str) -> int:
    allowed = f"a duration up to {format_duration(most_ns)}, such as 20ms{also}"
    if not isinstance(value, str):
        raise Problem(f"is {shown(value)}", allowed)
    duration = read_duration(value)
    if duration > most_ns:
        raise Problem(f"is {value}", allowed)
    return duration


def _ends(value: list[Any], read: Callable[[Any], float]) -> tuple[float, float]:
    """Both ends of a range."""
    if len(value) != 2:
        raise Problem(f"has {len(value)} entries", "a list of two, the least and the most")
    low, high = read(value[0]), read(value[1])
    if low > high:
        raise Problem("begins above its end", "the least first")
    return low, high


def _or_switch(read: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A reader that also takes ``on``, ``off`` and nothing."""
    return lambda value: None if value is None else _switch(value) or read(value)


def _amount(name: str, unit: str) -> Callable[[Any], float | str | None]:
    return _or_switch(lambda value: _number(value, 0.0, BOUNDS[name], unit))


def _range(one: Callable[[Any], float]) -> Callable[[Any], tuple[float, float] | str | None]:
    return _or_switch(lambda value: _ends(value, one) if isinstance(value, list) else (one(value), one(value)))


_MOST_DRIFT = BOUNDS["clock_drift"]
_read_latency = _range(
    lambda end: _duration(end, int(BOUNDS["parameter_latency_ns"]), ", a list of two, on or off"),
)
_read_drift = _range(lambda end: _number(end, -_MOST_DRIFT, _MOST_DRIFT, "ppm, a list of two"))
_read_time = _or_switch(lambda value: _duration(value, int(BOUNDS["answer_time_ns"]), ", on or off"))


def _schema(*kinds: dict[str, Any]) -> WithJsonSchema:
    return WithJsonSchema({"anyOf": [SWITCH, *kinds]})


def _amount_schema(name: str) -> WithJsonSchema:
    return _schema({"type": "number", "minimum": 0, "maximum": BOUNDS[name]})


def _range_schema(kind: dict[str, Any]) -> WithJsonSchema:
    return _schema(kind, {"type": "array", "items": kind, "minItems": 2, "maxItems": 2})


class Noise(Section):
    """Noise added to measured values: its RMS values; each firmware step has a new random value."""

    velocity: Annotated[
        float | str | None, PlainValidator(_amount("velocity_noise", "rpm")), _amount_schema("velocity_noise")
    ] = Field(default=None, description="Noise of the actual velocity, rpm (linear motor: mm/s).")
    current: Annotated[
        float | str | None, PlainValidator(_amount("current_noise", "A")), _amount_schema("current_noise")
    ] = Field(default=None, description="Noise of the actual current, A; that of the torque follows from it.")
    position: Annotated[
        float | str | None, PlainValidator(_amount("position_noise", "rev")), _amount_schema("position_noise")
    ] = Field(default=None, description="Noise of the actual position, revolutions (linear motor: mm).")


class BootTime(Section):
    """How long the drive takes from power-on, at the farm's start and after each power cycle."""

    answers: Annotated[int | str | None, PlainValidator(_read_time), _schema(_DURATION_SCHEMA)] = Field(
        default=None, description="Time until it answers on the network."
    )
    ready: Annotated[int | str | None, PlainValidator(_read_time), _schema(_DURATION_SCHEMA)] = Field(
        default=None, description="Time until S1; left out, the model's `boot_time_ns`."
    )


def _open_noise(value: Any) -> Any:
    if (word := _switch(value)) is not None:
        return {"velocity": word, "current": word, "position": word}
    if isinstance(value, (dict, Noise)):
        return value
    raise Problem(f"is {shown(value)}", "on, off, or a mapping such as {velocity: 2.0, current: 0.05}")


def _open_boot_time(value: Any) -> Any:
    if isinstance(value, (dict, BootTime)):
        return value
    if _switch(value) is None and not isinstance(value, str):
        raise Problem(f"is {shown(value)}", "a duration such as 8s, on, off, or a mapping such as {answers: 8s}")
    both = _read_time(value)
    return BootTime.model_construct(answers=both, ready=both)


class Realism(Section):
    """Noise, latency, boot time and clock drift; each key is a figure, `on` (the model's figure) or `off`."""

    noise: Annotated[Noise, BeforeValidator(_open_noise)] = Field(
        default_factory=Noise, description="Noise of the measured velocity, current and position."
    )
    parameter_latency: Annotated[
        tuple[float, float] | str | None, PlainValidator(_read_latency), _range_schema(_DURATION_SCHEMA)
    ] = Field(
        default=None,
        description="Time until the answer to a parameter request can be read; two durations are a range, from "
        "which each request gets its own.",
        examples=["20ms", ["5ms", "40ms"]],
    )
    boot_time: Annotated[BootTime, BeforeValidator(_open_boot_time)] = Field(
        default_factory=BootTime,
        description="Time from power-on until it answers and until S1; one duration is for both.",
    )
    clock_drift: Annotated[
        tuple[float, float] | str | None,
        PlainValidator(_read_drift),
        _range_schema({"type": "number", "minimum": -BOUNDS["clock_drift"], "maximum": BOUNDS["clock_drift"]}),
    ] = Field(
        default=None,
        description="Drift of the drive's clock, ppm, above 0 faster; two numbers are a range, from which each "
        "drive gets its own.",
        examples=[30, [-50, 50]],
    )
    seed: int = Field(
        default=1,
        ge=0,
        le=(1 << 64) - 1,
        description="Seed of the random values, to repeat a run; drives differ by their names.",
    )


def _everything() -> Realism:
    return Realism.model_construct(
        noise=Noise.model_construct(velocity=ALL, current=ALL, position=ALL),
        parameter_latency=ALL,
        boot_time=BootTime.model_construct(answers=ALL, ready=ALL),
        clock_drift=ALL,
    )


def _open_realism(value: Any) -> Any:
    match _switch(value):
        case "on":
            return _everything()
        case "off":
            return dict.fromkeys(("noise", "parameter_latency", "boot_time", "clock_drift"), OFF)
    if isinstance(value, (dict, Realism)):
        return value
    raise Problem(f"is {shown(value)}", "on, off, or a mapping such as {noise: on, parameter_latency: 20ms}")


#: The key of a drive group.
DriveRealism = Annotated[Realism, BeforeValidator(_open_realism)]


def asked_for(section: Realism) -> Iterator[tuple[tuple[str, ...], str, Any]]:
    """Each figure: its place in the section, its name in the model, its value in the farm file (None: not given)."""
    yield ("noise", "velocity"), "velocity_noise", section.noise.velocity
    yield ("noise", "current"), "current_noise", section.noise.current
    yield ("noise", "position"), "position_noise", section.noise.position
    yield ("parameter_latency",), "parameter_latency_ns", section.parameter_latency
    yield ("boot_time", "answers"), "answer_time_ns", section.boot_time.answers
    yield ("boot_time", "ready"), "ready_time_ns", section.boot_time.ready
    yield ("clock_drift",), "clock_drift", section.clock_drift


def missing_figures(section: Realism, model: Model) -> list[tuple[str, ...]]:
    """Places where the farm file requests a figure that the model does not have."""
    return [place for place, name, given in asked_for(section) if given == ON and f"realism.{name}" not in model.facts]
