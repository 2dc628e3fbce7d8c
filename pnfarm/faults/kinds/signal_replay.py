"""signal-replay: an input of the controller has given values, one after the other."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING, Any

from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec, by_values
from pnfarm.faults.signals import SIGNAL, TO_CONTROLLER, SignalEffect
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.samples import read_samples

if TYPE_CHECKING:
    from pnfarm.faults.kind import Misfits
    from pnfarm.wire.value_types import Value

__all__ = ["KIND"]

#: Between two rounds at the least.
_SHORTEST_NS = 10_000_000


class Replayed(SignalEffect):
    """Each value is an occurrence; before the first one the input is as it is written."""

    def prepare(self) -> None:
        super().prepare()
        self._times: list[int] = []
        self._values: list[Value] = []
        for number, (time, text) in enumerate(read_samples(self.values["values"]), start=1):
            try:
                self._values.append(self.signal.check(text))
            except Problem as problem:
                raise InjectionError(
                    [("params.values", f"sample {number}: {problem.what}", problem.allowed)]
                ) from problem
            self._times.append(time)
        self._every: int | None = self.values["every"]
        self._next = 0
        self._present: Value | None = None

    def begin(self, now: int) -> None:
        self._begun = now
        self.put()
        self.check(now)

    def shaped(self, value: Value) -> Value:
        return value if self._present is None else self._present

    def check(self, now: int) -> None:
        self._look(now)
        if self._every is not None and now >= self._begun + self._every:
            # rounds that a busy machine missed are left out
            self._begun += (now - self._begun) // self._every * self._every
            self._next = 0
        # of those that a busy machine missed the last one counts
        passed = bisect_right(self._times, now - self._begun)
        if passed > self._next:
            self._next, self._present = passed, self._values[passed - 1]
            self.signals.apply()
            self._occurred(now)
        following = [self._begun + self._times[passed]] if passed < len(self._times) else []
        following += [self._begun + self._every] if self._every is not None else []
        self._due = min((due for due in (*following, self._due) if due is not None), default=None)


@by_values
def _misfits(values: dict[str, Any]) -> Misfits:
    if values["every"] is None or values["values"] is None:
        return
    if values["every"] < read_samples(values["values"])[-1][0] + _SHORTEST_NS:
        yield "params.every", Problem("is too short", "the last time and 10ms at the least")


KIND = InjectionKind(
    "signal-replay",
    "signals",
    "An input of a device has given values over time, as a recording has them.  The last one stays until this ends.",
    "a value",
    Replayed,
    {
        "signal": SIGNAL,
        "values": ParamSpec(
            "samples",
            "TIME:VALUE, times in seconds or as 500ms from the start on, up to 10,000.  On a command line, "
            "in a farm file or a scenario, and in Python also a CSV file, a saved trace for instance: `@FILE`, or "
            "`@FILE#COLUMN` by the number or the title of one of several columns of values.",
            required=True,
        ),
        "every": ParamSpec("duration", "Begin again after this time; left out, once."),
    },
    takes=HELD,
    place=50,
    wire=TO_CONTROLLER,
    reports="The bus reports nothing.",
    misfits=_misfits,
)
