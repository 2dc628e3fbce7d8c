"""The step `find`: tries values in turn and finds the last one that holds; the search without a clock.

A trial holds if each of its expectations does.  Which value is next depends on what the trials before showed:

- ``first``: from the first value on, up to the first that does not hold;
- ``bisect``: halves what is left, for values that hold up to some point and not beyond;
- ``all``: every value, so that a plot shows what lies beyond the limit.

What is found is the last value before the first that did not hold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.scenario.definition.steps import (
    MEASURES,
    Key,
    MetricName,
    StepKind,
    read_bound,
    read_metric_name,
    read_title,
)
from pnfarm.vocabulary.durations import format_duration, read_duration
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.scenario.definition.steps import Bound

__all__ = ["FIND", "WAYS", "Measure", "Search", "number_of", "read_range"]

#: Ways to go through the values.
WAYS = ("first", "bisect", "all")


@dataclass(frozen=True, slots=True)
class Measure:
    """A metric that is measured over each trial, and what of it."""

    metric: MetricName
    asked: str

    @property
    def text(self) -> str:
        """As axis of a plot."""
        return f"{self.metric.name} {self.asked}"


def _way(value: Any) -> str:
    if value not in WAYS:
        raise Problem(f"is {shown(value)}", ", ".join(WAYS))
    return str(value)


def _measure(value: Any) -> Measure:
    allowed = "{metric: NAME, of: " + ", ".join(MEASURES) + "}"
    if not isinstance(value, dict) or set(value) != {"metric", "of"} or value["of"] not in MEASURES:
        raise Problem(f"is {shown(value)}", allowed)
    return Measure(read_metric_name(value["metric"]), value["of"])


FIND = StepKind(
    "Find the last of a variable's values for which the steps' expectations hold, and report it: a test case with a "
    "number, and a plot.",
    {
        "for": Key(
            lambda value: value,
            "One variable and its values, from those that hold to those that do not: {late: {from: 4ms, to: 96ms}}.",
            {"type": "object", "minProperties": 1, "maxProperties": 1},
        ),
        "by": Key(_way, "first: up to the first that fails; bisect: halve what is left; all: every value.",
                  {"enum": list(WAYS)}),
        "steps": Key(lambda value: value, "A trial; its own faults end with it.", {"type": "array"}),
        "then": Key(lambda value: value, "Steps after each trial, whatever it showed; their expectations are test "
                    "cases.", {"type": "array"}),
        "measure": Key(_measure, "What a trial also measures, for the plot: {metric: NAME, of: p99}.",
                       {"type": "object"}),
        "is": Key(read_bound, "What the value must be: '>= 20ms', 41; left out, it is only measured.",
                  {"type": ["number", "string"]}),
        "name": Key(read_title, "Title in reports.", {"type": "string"}),
    },
    required=("for", "steps"),
    example="find: {for: {n: {from: 1, to: 12}}, steps: [...], is: '>= 2'}",
)  # fmt: skip


def number_of(value: Any) -> float:
    """A value as a number, of a duration its seconds.  Raises :class:`Problem`."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise Problem(f"is {shown(value)}", "a number, or a duration such as 4ms")
    try:
        return read_duration(value) / 1e9 if isinstance(value, str) else float(value)
    except OverflowError as error:
        raise Problem(f"is {shown(value)}", "a number that is not so large") from error


def read_range(values: dict[str, Any], most: int) -> list[Any] | None:
    """``{from: 1, to: 6}`` and ``{from: 4ms, to: 96ms, step: 4ms}`` as a list; None for anything else.

    Without ``step`` whole numbers count by one, durations by ``from``.
    """
    if not {"from", "to"} <= set(values) <= {"from", "to", "step"}:
        return None
    first, last = values["from"], values["to"]
    step = values.get("step", first if isinstance(first, str) else 1)
    is_time = isinstance(first, str)
    try:
        numbers = [read_duration(item) if is_time else item for item in (first, last, step)]
    except Problem:
        return None
    if any(isinstance(item, bool) or not isinstance(item, int) for item in numbers) or numbers[2] <= 0:
        return None
    begin, end, pace = numbers
    # not by the length of the range, which fails for what is far too long
    if not 0 < (end - begin) // pace + 1 <= most:
        return None
    found = range(begin, end + 1, pace)
    return [format_duration(item) for item in found] if is_time else list(found)


@dataclass(slots=True)
class Search:
    """Which value is tried next, and what was found.  ``held`` and ``measured`` by the value's place in the list."""

    values: Sequence[Any]
    by: str
    held: dict[int, bool] = field(default_factory=dict)
    tries: list[dict[str, Any]] = field(default_factory=list)

    @property
    def _low(self) -> int:
        """Place of the last value known to hold, -1 for none."""
        return max((place for place, held in self.held.items() if held and place < self._high), default=-1)

    @property
    def _high(self) -> int:
        """Place of the first value known not to hold, one past the last for none."""
        return min((place for place, held in self.held.items() if not held), default=len(self.values))

    def next(self) -> int | None:
        """Place of the value to try, None at the end."""
        if self.by == "bisect":
            return (self._low + self._high) // 2 if self._high - self._low > 1 else None
        place = len(self.held)
        done = place == len(self.values) or (self.by == "first" and self._high < place)
        return None if done else place

    def note(self, place: int, *, held: bool, message: str, measured: float | None, at_seconds: float) -> None:
        """What a trial showed."""
        self.held[place] = held
        value = self.values[place]
        number = None if measured is None or not math.isfinite(measured) else measured
        self.tries.append(
            {"value": value, "number": number_of(value), "held": held, "message": message, "measured": number,
             "began_seconds": at_seconds}
        )  # fmt: skip

    @property
    def found(self) -> Any:
        """The last value that held before the first that did not, None if the first one did not."""
        return self.values[self._low] if self._low >= 0 else None

    @property
    def beyond(self) -> Any:
        """The first value that did not hold, None if all that were tried did."""
        return self.values[self._high] if self._high < len(self.values) else None

    def verdict(self, bound: Bound | None) -> tuple[bool, str]:
        """Whether what was found is as wanted, and a sentence."""
        found, beyond = self.found, self.beyond
        if found is None:
            text = f"does not hold at {beyond}, the first value"
        elif beyond is None:
            text = f"holds at {found}, the last value: the limit lies beyond"
        else:
            text = f"holds at {found}, not at {beyond}"
        if bound is None:
            return found is not None, text
        return found is not None and bound.holds(number_of(found)), f"{text}; wanted {bound.text}"
