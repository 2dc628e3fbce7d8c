"""signal-flicker: an input of the controller alternates between two values."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec
from pnfarm.faults.signals import SIGNAL, TO_CONTROLLER, SignalEffect

if TYPE_CHECKING:
    from pnfarm.wire.value_types import Value

__all__ = ["KIND"]

_SHORTEST_NS = 10_000_000


class Flickering(SignalEffect):
    """Away from its value in each second half of the period; each time that it goes is an occurrence."""

    _away = False

    def prepare(self) -> None:
        super().prepare()
        text = self.values["value"]
        self._other = None if text is None else self.value_of(text)
        if self._other is None:
            self.needs_bit()
        self._half: int = self.values["period"] // 2

    def shaped(self, value: Value) -> Value:
        if not self._away:
            return value
        return self._other if self._other is not None else not value

    def begin(self, now: int) -> None:
        self._away = True
        self._next = now + self._half
        super().begin(now)
        self._wake()

    def check(self, now: int) -> None:
        self._look(now)
        if now >= self._next:
            # halves that a busy machine missed are left out
            self._next += (1 + (now - self._next) // self._half) * self._half
            self._away = not self._away
            self.signals.apply()
            if self._away:
                self._occurred(now)
        self._wake()

    def _wake(self) -> None:
        self._due = self._next if self._due is None else min(self._due, self._next)


KIND = InjectionKind(
    "signal-flicker",
    "signals",
    "An input of a device alternates between two values: a loose contact, a part at the edge of a sensor's range.",
    "a change away from the value",
    Flickering,
    {
        "signal": SIGNAL,
        "period": ParamSpec(
            "duration", "Of one change to the other value and back.", default="100ms", low=_SHORTEST_NS
        ),
        "value": ParamSpec(
            "text", "What it changes to; left out, the opposite of a bit.", other="a value of the signal's type"
        ),
    },
    takes=HELD,
    place=40,
    wire=TO_CONTROLLER,
    reports="The bus reports nothing.",
)
