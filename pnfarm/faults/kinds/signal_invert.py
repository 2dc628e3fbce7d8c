"""signal-invert: an input of the controller is the opposite of what it should be."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.kind import HELD, InjectionKind
from pnfarm.faults.signals import SIGNAL, TO_CONTROLLER, SignalEffect

if TYPE_CHECKING:
    from pnfarm.wire.value_types import Value

__all__ = ["KIND"]


class Inverted(SignalEffect):
    """Of a bit."""

    def prepare(self) -> None:
        super().prepare()
        self.needs_bit()

    def shaped(self, value: Value) -> Value:
        return not value


KIND = InjectionKind(
    "signal-invert",
    "signals",
    "A bit of a device reaches the controller inverted: a normally closed contact in place of a normally open one.",
    "the inversion",
    Inverted,
    {"signal": SIGNAL},
    takes=HELD,
    place=30,
    wire=TO_CONTROLLER,
    reports="The bus reports nothing.",
)
