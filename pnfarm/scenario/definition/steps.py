"""The steps of a scenario: their keys, what each may be, and what it is for; schema and docs are made of it."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.config.values import DURATION_SCHEMA
from pnfarm.vocabulary.conditions import COMPARISONS, CONDITION, ConditionError, parse_condition
from pnfarm.vocabulary.durations import format_duration, read_duration
from pnfarm.vocabulary.globs import GLOBS, GLOBS_SCHEMA, read_globs
from pnfarm.vocabulary.names import is_name
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from pnfarm.vocabulary.issues import Location

__all__ = [
    "ALL_CONNECTED",
    "DEFAULT_WITHIN_NS",
    "MEASURES",
    "POWER",
    "QUANTILES",
    "STEPS",
    "WHOLE",
    "Bound",
    "Key",
    "MetricName",
    "Step",
    "StepKind",
    "read_bound",
    "read_metric_name",
    "read_title",
]

#: ``wait: {until: all-connected}``.
ALL_CONNECTED = "all-connected"
#: ``wait: {until: ...}`` without ``within``.
DEFAULT_WITHIN_NS = 30_000_000_000
#: Keys of an expectation that ask for a quantile of a histogram.
QUANTILES: Mapping[str, float] = {"p50": 0.5, "p90": 0.9, "p99": 0.99}
#: What of a metric is measured.
MEASURES = ("increases", "value", *QUANTILES)
#: What the step `power` does with its drives: switch them off (False) or on, in turn.
POWER: Mapping[str, tuple[bool, ...]] = {"off": (False,), "on": (True,), "cycle": (False, True)}
_BOUND = re.compile(r"(==|!=|<=|>=|<|>)?\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(\S*)")
_METRIC = re.compile(r"(pnfarm_[a-z0-9_]{1,80})(?:\{(.*)\})?")
_LABEL = re.compile(r'\s*([a-zA-Z_]\w*)\s*=\s*"([^"]*)"\s*')


@dataclass(frozen=True, slots=True)
class Bound:
    """A comparison with a number: ``>= 1``, ``< 2ms`` (in seconds), ``0``, which means ``== 0``."""

    sign: str
    value: float
    text: str

    def holds(self, value: float) -> bool:
        """Whether a measured value keeps it; one that is not a number never does."""
        return not math.isnan(value) and COMPARISONS[self.sign](value, self.value)


@dataclass(frozen=True, slots=True)
class MetricName:
    """A metric and the labels that its series must have."""

    name: str
    labels: Mapping[str, str]


def read_bound(value: Any) -> Bound:
    """Raises :class:`Problem`."""
    allowed = "a number, or a comparison such as '>= 1' or '< 2ms'"
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise Problem(f"is {shown(value)}", allowed)
    found = _BOUND.fullmatch(str(value).strip())
    if found is None:
        raise Problem(f"is {shown(value)}", allowed)
    sign, number, unit = found.groups()
    if unit:
        return Bound(sign or "==", read_duration(f"{number.lstrip('+')}{unit}") / 1e9, str(value))
    try:
        return Bound(sign or "==", float(number), str(value))
    except ValueError as error:
        raise Problem(f"is {shown(value)}", allowed) from error


def read_metric_name(value: Any) -> MetricName:
    """Raises :class:`Problem`."""
    allowed = 'a metric such as pnfarm_watchdog_expirations_total, with labels in braces: {drive="axis-01"}'
    found = _METRIC.fullmatch(value.strip()) if isinstance(value, str) else None
    if found is None:
        raise Problem(f"{shown(value)} is not a metric", allowed)
    labels: dict[str, str] = {}
    for part in (found[2] or "").split(",") if found[2] else ():
        label = _LABEL.fullmatch(part)
        if label is None:
            raise Problem(f"{shown(part)} is not a label", allowed)
        labels[label[1]] = label[2]
    return MetricName(found[1], labels)


def _condition(value: Any) -> str:
    if not isinstance(value, str):
        raise Problem(f"is {shown(value)}", CONDITION)
    try:
        parse_condition(value)
    except ConditionError as error:
        raise Problem(f"{shown(value)}, column {error.column}: {error.what}", error.allowed) from error
    return value


def _until(value: Any) -> str:
    return ALL_CONNECTED if value == ALL_CONNECTED else _condition(value)


def read_title(value: Any) -> str:
    """Raises :class:`Problem`."""
    if not isinstance(value, str) or not 0 < len(value) <= 200 or not value.isprintable():
        raise Problem(f"is {shown(value)}", "a text of at most 200 characters")
    return value


def _name_key(allowed: str, doc: str) -> Key:
    def name(value: Any) -> str:
        if not is_name(value):
            raise Problem(f"is {shown(value)}", allowed)
        return value

    return Key(name, doc)


def _count(value: Any) -> int:
    found = re.fullmatch(r"([+-])([0-9]{1,4})", value) if isinstance(value, str) else None
    number = int(value) if found is not None else value
    if isinstance(number, bool) or not isinstance(number, int) or number == 0 or abs(number) > 4094:
        raise Problem(f"is {shown(value)}", "how many drives to switch on or off, such as +8 or -8")
    return number


def _total(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 4094:
        raise Problem(f"is {shown(value)}", "how many drives are on, a whole number from 0 to 4094")
    return value


def _values(value: Any) -> dict[str, int | float | str]:
    allowed = "a mapping of parameters, such as {DRV.OPMODE: 1}"
    if not isinstance(value, dict) or not 0 < len(value) <= 64:
        raise Problem(f"is {shown(value)}", allowed)
    for key, item in value.items():
        if isinstance(item, bool) or not isinstance(item, int):
            raise Problem(f"{key} is {shown(item)}", "a whole number, as `pnfarm param set` takes it")
    return dict(value)


def _signals(value: Any) -> dict[str, dict[str, bool | int | float | str]]:
    """By station."""
    allowed = "a mapping of signals to values, such as {island-1.part_present: true}"
    if not isinstance(value, dict) or not 0 < len(value) <= 64:
        raise Problem(f"is {shown(value)}", allowed)
    found: dict[str, dict[str, bool | int | float | str]] = {}
    for key, item in value.items():
        station, _, signal = str(key).rpartition(".")
        if not station or not signal:
            raise Problem(f"{shown(key)} is not a signal", "STATION.SIGNAL, such as island-1.part_present")
        if not isinstance(item, bool | int | float | str):
            raise Problem(f"{key} is {shown(item)}", "true or false, a number or a text")
        found.setdefault(station, {})[signal] = item
    return found


def _released(value: Any) -> list[str]:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not 0 < len(names) <= 64 or not all(isinstance(n, str) and n for n in names):
        raise Problem(f"is {shown(value)}", "a list of STATION.SIGNAL, or of STATION for all of its signals")
    return names


def _mapping(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise Problem(f"is {shown(value)}", "a mapping such as {kind: f702, on: axis-01, as: trip}")
    return dict(value)


_DURATION_JSON: dict[str, Any] = dict(DURATION_SCHEMA.json_schema or {})
_TEXT: dict[str, Any] = {"type": "string"}
_INTEGER: dict[str, Any] = {"type": "integer"}
_BOUND_JSON: dict[str, Any] = {"type": ["number", "string"]}


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a step: reads a value or raises :class:`Problem`."""

    read: Callable[[Any], Any]
    doc: str
    schema: Mapping[str, Any] = field(default_factory=lambda: dict(_TEXT))


@dataclass(frozen=True, slots=True)
class StepKind:
    """``short``: the key that a value which is no mapping stands for.  ``one_of``: exactly one of these is needed."""

    doc: str
    keys: Mapping[str, Key]
    required: Sequence[str] = ()
    one_of: Sequence[str] = ()
    short: str = ""
    example: str = ""


@dataclass(frozen=True, slots=True)
class Step:
    """A step as it runs: its values are read; ``loop`` are the values of the repetitions around it."""

    kind: str
    values: Mapping[str, Any]
    location: Location
    line: int
    loop: Mapping[str, Any] = field(default_factory=dict)
    branches: tuple[tuple[Step, ...], ...] = ()
    #: Inside of a `find`: ``trial``, whose expectations decide it, or ``then``, whose expectations are cases if it ran.
    part: str = ""

    def get(self, key: str, default: Any = None) -> Any:
        """The value of a key, read."""
        return self.values.get(key, default)

    def one_of(self, keys: Iterable[str]) -> str:
        """Which of these keys it has; empty for none."""
        return next((key for key in keys if key in self.values), "")

    @property
    def watches(self) -> bool:
        """Whether it watches conditions while time passes."""
        return "until" in self.values or "that" in self.values

    @property
    def title(self) -> str:
        """A line for people: the step's own name, else what it does."""
        name = self.values.get("name") or self._described()
        inside = ", ".join(f"{key}={value}" for key, value in self.loop.items())
        return f"{name} [{inside}]" if inside else str(name)

    @property
    def allowed(self) -> str:
        """What an expectation, or a wait for a condition, allows; empty for other steps."""
        values = self.values
        if asked := self.one_of(MEASURES):
            bound = values[asked]
            over = f" over {format_duration(values['for'])}" if "for" in values else ""
            sign = "" if bound.text.lstrip().startswith(tuple("=!<>")) else "== "
            return f"{asked} {sign}{bound.text}{over}"
        if "that" not in values and "until" not in values:
            return ""
        within = values.get("within", DEFAULT_WITHIN_NS if "until" in values else 0)
        hold = f", then for {format_duration(values['for'])}" if "for" in values else ""
        return (f"within {format_duration(within)}" if within else "at once") + hold

    def _described(self) -> str:
        values = self.values
        drives = " ".join(values.get("drive", ()))
        match self.kind:
            case "wait" if "until" in values:
                return f"wait until {values['until']}"
            case "wait":
                return f"wait {format_duration(values['for'])}"
            case "fault":
                on = values["spec"].get("on", "")
                return f"fault {values['spec'].get('kind')} on {on if isinstance(on, str) else ' '.join(on)}"
            case "clear":
                return f"clear {values['fault']}"
            case "expect" if "metric" in values:
                asked = self.one_of(MEASURES)
                return f"{values['metric'].name} {asked} {values[asked].text}"
            case "expect":
                return f"{drives}: {values['that']}" if drives else str(values["that"])
            case "restore":
                return f"restore {values['state']}"
            case "find":
                return f"find {values['variable']}"
            case "load":
                return f"load {values['drives']:+d} drives" if "drives" in values else f"load {values['total']} drives"
            case "power":
                word = self.one_of(POWER)
                return f"power {word} {' '.join(values[word])}"
            case "release":
                return f"release {', '.join(values['signals'])}"
            case "set" | "force":
                every = [(f"{s}.{n}", v) for s, values in values["signals"].items() for n, v in values.items()]
                return f"{self.kind} " + ", ".join(f"{name} = {shown(value)}" for name, value in every)
            case "param":
                return f"param {drives}: " + ", ".join(f"{name} = {value}" for name, value in values["set"].items())
            case _:
                return self.kind


def _duration_key(doc: str) -> Key:
    return Key(read_duration, doc, _DURATION_JSON)


def _drives_key(doc: str) -> Key:
    return Key(read_globs, f"{doc}: {GLOBS}.", GLOBS_SCHEMA)


_TITLE = Key(read_title, "Title in reports.")

#: Steps whose content is the value of one key.
WHOLE: Mapping[str, str] = {"fault": "spec", "set": "signals", "force": "signals", "release": "signals"}

_SIGNALS_JSON: dict[str, Any] = {"type": "object", "additionalProperties": {"type": ["boolean", "number", "string"]}}

#: Steps that only act or check; `parallel` and `repeat` hold others and are read by
#: :mod:`pnfarm.scenario.definition.file`.
STEPS: Mapping[str, StepKind] = {
    "wait": StepKind(
        "Let time pass, or wait until a condition holds on all drives at once; one that does not come true ends the "
        "scenario.",
        {
            "for": _duration_key("How long."),
            "until": Key(_until, "A condition, or all-connected."),
            "drive": _drives_key("Drives on which it must hold; left out, all"),
            "within": _duration_key("Longest wait for the condition; left out, 30s."),
            "name": _TITLE,
        },
        one_of=("for", "until"),
        short="for",
        example="wait: {until: all-connected, within: 20s}",
    ),
    "fault": StepKind(
        "Put a fault in force, with the keys of `pnfarm fault kinds` and a name (`as`) to clear it by.",
        {"spec": Key(_mapping, "kind, on, params and the other keys of a fault.", {"type": "object"})},
        required=("spec",),
        example="fault: {kind: f702, on: axis-03, as: trip}",
    ),
    "clear": StepKind(
        "End a fault of this scenario, or all of its faults.",
        {"fault": _name_key("all, or the name that a fault got by `as`", "Name that the fault got by `as`, or all.")},
        required=("fault",),
        short="fault",
        example="clear: trip",
    ),
    "expect": StepKind(
        "A check, and a test case in the report: of drives (`drive`, `that`), of devices (`that: island-1.valve`) or "
        "of a metric.  `within`: it becomes true on each drive in this time.  `for`: it then stays true this long; of "
        "a metric, the period that is measured.",
        {
            "drive": _drives_key("Drives; left out where the condition is about signals of devices alone"),
            "that": Key(_condition, "The condition."),
            "within": _duration_key("It becomes true in this time; left out, it is true at once."),
            "for": _duration_key("It stays true, or the metric is measured, for this long."),
            "metric": Key(read_metric_name, 'A metric, with labels in braces if wanted: {drive="axis-01"}.'),
            "increases": Key(read_bound, "By how much it increases: 0, '>= 1'.", _BOUND_JSON),
            "value": Key(read_bound, "Its value at the end: '< 5'; series are added up.", _BOUND_JSON),
            **{
                name: Key(read_bound, f"The {name[1:]} % quantile of a histogram: '< 2ms'.", _BOUND_JSON)
                for name in QUANTILES
            },
            "name": _TITLE,
        },
        one_of=("that", "metric"),
        example="expect: {drive: axis-03, that: state == S4, within: 5s, name: PLC brings it back}",
    ),
    "load": StepKind(
        "Switch on drives of the farm that are off (or off again, last first), spread over a time.",
        {
            "drives": Key(_count, "How many: +64, -64.", {"type": ["integer", "string"]}),
            "total": Key(_total, "How many are on afterwards; drives are switched on or off to get there.", _INTEGER),
            "over": _duration_key("Spread over this time; left out, at once."),
            "on": _drives_key("Drives to choose from; left out, all"),
        },
        one_of=("drives", "total"),
        short="drives",
        example="load: {drives: +64, over: 30s}",
    ),
    "power": StepKind(
        "Switch drives off, on, or off and on.",
        {word: _drives_key(f"Drives to switch {word}") for word in POWER},
        one_of=tuple(POWER),
        example="power: {off: axis-01}",
    ),
    "set": StepKind(
        "Write signals of devices, as `pnfarm io` does: of each device all at once, or none.",
        {"signals": Key(_signals, "STATION.SIGNAL: its new value.", _SIGNALS_JSON)},
        required=("signals",),
        example="set: {island-1.part_present: true, island-1.pressure: 6.5}",
    ),
    "force": StepKind(
        "Force signals of devices: the controller gets these values, whatever is written, until they are released, at "
        "the latest when the scenario ends.  A fault is stronger.",
        {"signals": Key(_signals, "STATION.SIGNAL: its value.", _SIGNALS_JSON)},
        required=("signals",),
        example="force: {island-1.part_present: true}",
    ),
    "release": StepKind(
        "End the forces of signals: what was written meanwhile is in force.",
        {"signals": Key(_released, "STATION.SIGNAL, or STATION for all of its signals.", GLOBS_SCHEMA)},
        required=("signals",),
        example="release: [island-1.part_present]",
    ),
    "restore": StepKind(
        "Put the whole farm into a saved state, as `pnfarm state restore` does: controllers set their connections up "
        "again, and faults of this scenario stay in force.",
        {
            "state": _name_key(
                "the name that a state got by `pnfarm state save`", "Name that the state got by `pnfarm state save`."
            )
        },
        required=("state",),
        short="state",
        example="restore: loaded",
    ),
    "param": StepKind(
        "Write parameters, by number or the maker's name, as `pnfarm param set` does.",
        {
            "drive": _drives_key("Drives"),
            "set": Key(_values, "Parameters and their values.", {"type": "object"}),
        },
        required=("drive", "set"),
        example="param: {drive: axis-01, set: {DRV.OPMODE: 1}}",
    ),
}
