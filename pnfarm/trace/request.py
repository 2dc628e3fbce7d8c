"""A trace as requested: drives, signals, trigger, and times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.errors import FieldsError
from pnfarm.trace.trigger import TRIGGER, Trigger, parse_trigger
from pnfarm.vocabulary.durations import DURATION_PATTERN, format_duration, read_duration
from pnfarm.vocabulary.globs import GLOBS, GLOBS_SCHEMA, read_globs
from pnfarm.vocabulary.names import PATTERN, is_name
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

__all__ = ["MAX_LENGTH_NS", "TraceError", "TraceRequest"]

#: Longest time before, and longest after the trigger.
MAX_LENGTH_NS = 3_600_000_000_000
#: Shortest time between samples.
MIN_INTERVAL_NS = 10_000
MAX_EVERY = 100_000
#: Most entries of the list of signals, and longest of them, characters.
MAX_SIGNALS, MAX_NAME = 256, 100
MAX_KEEP_NS = 86_400_000_000_000

_SIGNALS = "a list of signals such as velocity, stw1.* or island-1.part_present; `pnfarm trace DRIVES --list`"


class TraceError(FieldsError):
    """A request that is not valid."""

    before = "trace."


@dataclass(frozen=True, slots=True)
class TraceRequest:
    """``on``: globs over drives and devices; times in ns.

    A sample is due every ``interval_ns``; None: at every ``every``-th step of the engine, which is every millisecond.
    ``keep_ns``: how long the trace stays while no client asks for it, None for ever.
    """

    on: tuple[str, ...]
    signals: tuple[str, ...]
    trigger: Trigger
    pre_ns: int = 0
    length_ns: int = 1_000_000_000
    every: int = 1
    interval_ns: int | None = None
    name: str | None = None
    keep_ns: int | None = None

    @classmethod
    def parse(cls, data: Mapping[str, Any], *, keep_ns: int | None = None) -> TraceRequest:
        """From plain values, as an API body has them; raises :class:`TraceError` naming every wrong field."""
        issues: list[tuple[str, str, str]] = []
        values: dict[str, Any] = {"keep_ns": keep_ns}
        for key in list(data)[:64]:
            if key not in _FIELDS:
                what = f"is not a field of a trace{did_you_mean(str(key), _FIELDS)}"
                issues.append((str(key)[:60], what, ", ".join(_FIELDS)))
        for key, (attribute, read) in _FIELDS.items():
            if key not in data or (data[key] is None and key not in {"on", "signals"}):
                if key in {"on", "signals"}:
                    issues.append((key, "is missing", GLOBS if key == "on" else _SIGNALS))
                continue
            try:
                values[attribute] = read(data[key])
            except Problem as problem:
                issues.append((key, problem.what, problem.allowed))
        if data.get("every") is not None and data.get("interval") is not None:
            issues.append(("every", "contradicts interval", "one of the two"))
        if issues:
            raise TraceError(issues)
        values.setdefault("trigger", parse_trigger("now"))
        return cls(**values)

    def step_ns(self, tick_ns: int) -> int:
        """Time between samples, for an engine that ticks at the latest every ``tick_ns``."""
        return self.interval_ns or self.every * tick_ns

    def as_dict(self) -> dict[str, Any]:
        """For JSON; :meth:`parse` reads it."""
        return {
            "on": list(self.on),
            "signals": list(self.signals),
            "trigger": self.trigger.text,
            "pre": format_duration(self.pre_ns),
            "length": format_duration(self.length_ns),
            **({"interval": format_duration(self.interval_ns)} if self.interval_ns else {"every": self.every}),
            **({} if self.name is None else {"as": self.name}),
            **({} if self.keep_ns is None else {"keep": format_duration(self.keep_ns)}),
        }

    @staticmethod
    def schema() -> dict[str, Any]:
        """The JSON Schema of what :meth:`parse` takes."""
        duration = {"type": "string", "pattern": DURATION_PATTERN}
        return {
            "title": "TraceSpec",
            "type": "object",
            "additionalProperties": False,
            "required": ["on", "signals"],
            "properties": {
                "on": {
                    **GLOBS_SCHEMA,
                    "description": "Which drives and devices: globs over their names, model:NAME, or all.",
                },
                "signals": {
                    "type": "array",
                    "items": {"type": "string"},
                    "minItems": 1,
                    "maxItems": MAX_SIGNALS,
                    "description": "Signals, globs over them, DEVICE.SIGNAL; GET traces/signals/{name} lists them.",
                },
                "trigger": {"type": "string", "default": "now", "description": f"When time 0 is: {TRIGGER}."},
                "pre": {**duration, "default": "0ns", "description": "How long to record before the trigger."},
                "length": {**duration, "default": "1s", "description": "How long to sample from the trigger on."},
                "every": {
                    "type": "integer",
                    "minimum": 1,
                    "maximum": MAX_EVERY,
                    "default": 1,
                    "description": "A sample every N steps of the engine, which steps every millisecond.",
                },
                "interval": {**duration, "description": "Instead of every: time between samples."},
                "as": {"type": "string", "pattern": PATTERN, "description": "Name to read it by."},
                "keep": {**duration, "description": "How long it is kept while it is not read; default 10min."},
            },
        }


def _duration(least: int, most: int) -> Callable[[object], int]:
    def read(value: object) -> int:
        found = read_duration(value)
        if not least <= found <= most:
            allowed = f"{format_duration(least)} to {format_duration(most)}"
            raise Problem(f"is {shown(value)}", allowed)
        return found

    return read


def _every(value: object) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= MAX_EVERY:
        raise Problem(f"is {shown(value)}", f"a whole number from 1 to {MAX_EVERY}")
    return value


def _signals(value: object) -> tuple[str, ...]:
    names = value.split(",") if isinstance(value, str) else value
    if not isinstance(names, (list, tuple)) or not names or not all(isinstance(n, str) and n.strip() for n in names):
        raise Problem(f"is {shown(value)}", _SIGNALS)
    if len(names) > MAX_SIGNALS or max(map(len, names)) > MAX_NAME:
        raise Problem("is too long", f"at most {MAX_SIGNALS} entries of at most {MAX_NAME} characters")
    return tuple(name.strip() for name in names)


def _called(value: object) -> str:
    if not is_name(value) or value == "signals":
        raise Problem(f"is {shown(value)}", "a name: a-z, 0-9, -, _ and ., at most 64 characters, and not signals")
    return value


#: Field outside -> field here, and its reader, which raises :class:`Problem`.
_FIELDS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "on": ("on", lambda value: tuple(read_globs(value))),
    "signals": ("signals", _signals),
    "trigger": ("trigger", parse_trigger),
    "pre": ("pre_ns", _duration(0, MAX_LENGTH_NS)),
    "length": ("length_ns", _duration(0, MAX_LENGTH_NS)),
    "every": ("every", _every),
    "interval": ("interval_ns", _duration(MIN_INTERVAL_NS, MAX_LENGTH_NS)),
    "as": ("name", _called),
    "keep": ("keep_ns", _duration(1_000_000, MAX_KEEP_NS)),
}
