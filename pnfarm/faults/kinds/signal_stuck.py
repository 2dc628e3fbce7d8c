"""signal-stuck: an input of the controller does not change."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec
from pnfarm.faults.signals import SIGNAL, TO_CONTROLLER, SignalEffect

if TYPE_CHECKING:
    from pnfarm.wire.value_types import Value

__all__ = ["KIND"]


class Stuck(SignalEffect):
    """At its value when this begins, or at a given one."""

    def prepare(self) -> None:
        super().prepare()
        text = self.values["value"]
        self._value = None if text is None else self.value_of(text)

    def shaped(self, value: Value) -> Value:
        if self._value is None:
            self._value = value
        return self._value


KIND = InjectionKind(
    "signal-stuck",
    "signals",
    "An input of a device stays as it is, or has a given value: a sensor that sticks, a bridged contact.  What is "
    "written meanwhile goes to the controller when this ends.",
    "the value that stays",
    Stuck,
    {
        "signal": SIGNAL,
        "value": ParamSpec("text", "Left out, the present one.", other="a value of the signal's type"),
    },
    takes=HELD,
    place=10,
    wire=TO_CONTROLLER,
    reports="The bus reports nothing.",
)
