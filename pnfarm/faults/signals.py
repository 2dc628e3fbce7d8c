"""A station's signals, as injections see them: what goes to the controller of an input that is written."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, TypeAlias

from pnfarm.faults.effects.confirmed import StandingEffect
from pnfarm.faults.effects.parts import DrivePart, Part
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import ParamSpec
from pnfarm.signals.refusal import SignalError
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.signals.signal import Signal
    from pnfarm.station.plain_signals import PlainSignals
    from pnfarm.wire.value_types import Value

__all__ = ["SIGNAL", "SIGNALS", "TO_CONTROLLER", "Report", "SignalEffect", "Signals"]

SIGNAL = ParamSpec("text", "An input of the controller.", required=True, other="a name of the device's signals")
#: Part of what such a kind has on the wire.
TO_CONTROLLER = "The signal's octets in the device's cyclic data, with status GOOD."


#: Lets a report appear and disappear; the time is given to each.
Report: TypeAlias = "tuple[Callable[[int], None], Callable[[int], None]]"


class Signals(DrivePart):
    """Shapes of inputs, the latest last.

    ``wire_break``: how the bus reports a broken wire of an input on a channel; None where the device does not.
    """

    def __init__(
        self, station: PlainSignals, wire_break: Callable[[Signal, int], Report | None] = lambda *_: None
    ) -> None:
        self._station = station
        self.wire_break = wire_break
        #: Put a shape over an input, undo one, let one change its mind.
        self.put, self.take, self.apply = station.put_shape, station.take_shape, station.apply

    def in_force(self) -> list[Any]:
        return list(self._station.shaped)

    def input(self, name: str) -> Signal:
        """An input by its name; raises :class:`InjectionError`."""
        try:
            signal: Signal = self._station.signal(name)
        except SignalError as exc:
            issues = [("params.signal", f"{where} {what}", allowed) for where, what, allowed in exc.issues]
            raise InjectionError(issues) from exc
        if signal.direction == "output":
            raise InjectionError([("params.signal", f"{name} is an output, which the controller writes", "an input")])
        return signal


SIGNALS: Part[Signals] = Part("signals")


class SignalEffect(StandingEffect):
    """A shape over one input from start to end."""

    signals = SIGNALS

    def prepare(self) -> None:
        self.signal = self.signals.input(self.values["signal"])

    @abstractmethod
    def shaped(self, value: Value) -> Value:
        """What the controller gets of a value."""

    def put(self) -> None:
        self.signals.put(self.signal, self.shaped)

    def take(self) -> None:
        self.signals.take(self.signal, self.shaped)

    def value_of(self, text: str) -> Value:
        """A value of the signal; raises :class:`InjectionError`."""
        try:
            return self.signal.check(text)
        except Problem as problem:
            raise InjectionError([("params.value", problem.what, problem.allowed)]) from problem

    def needs_bit(self) -> None:
        """Raises :class:`InjectionError` for a signal that is not a bit."""
        if self.signal.type.kind != "bool":
            what = f"{self.signal.name} is of type {self.signal.type.name}"
            raise InjectionError([("params.signal", what, "a signal of type bool")])
