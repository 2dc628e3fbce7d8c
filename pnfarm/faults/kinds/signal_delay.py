"""signal-delay: changes of an input reach the controller late."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec
from pnfarm.faults.signals import SIGNAL, TO_CONTROLLER, SignalEffect

if TYPE_CHECKING:
    from pnfarm.wire.value_types import Value

__all__ = ["KIND"]

#: How often the signal is read, and the changes at most that are under way.
_SAMPLE_NS = 5_000_000
_MOST_CHANGES = 1_000
_LONGEST_NS = 60_000_000_000


class Delayed(SignalEffect):
    """Each change is an occurrence; when this ends, those under way arrive at once."""

    def prepare(self) -> None:
        super().prepare()
        self._delay: int = self.values["delay"]
        self._changes: deque[tuple[int, Value]] = deque(maxlen=_MOST_CHANGES)
        self._present: Value | None = None

    def begin(self, now: int) -> None:
        self.put()
        self._due = now + _SAMPLE_NS

    def shaped(self, value: Value) -> Value:
        self._given = value
        if self._present is None:
            self._present = self._latest = value
        return self._present

    def check(self, now: int) -> None:
        self._look(now)
        if self._given != self._latest:
            self._latest = self._given
            self._changes.append((now + self._delay, self._given))
        arrived = False
        while self._changes and self._changes[0][0] <= now:
            self._present = self._changes.popleft()[1]
            arrived = True
        if arrived:
            self.signals.apply()
            self._occurred(now)
        self._due = now + _SAMPLE_NS


KIND = InjectionKind(
    "signal-delay",
    "signals",
    "Each change of an input of a device reaches the controller late, as through a long filter time.  The signal is "
    "read every 5 ms; a shorter pulse is lost.",
    "a change that arrives late",
    Delayed,
    {"signal": SIGNAL, "delay": ParamSpec("duration", "How late.", default="500ms", high=_LONGEST_NS)},
    takes=HELD,
    place=20,
    wire=TO_CONTROLLER,
    reports="The bus reports nothing.",
)
