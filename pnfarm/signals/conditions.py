"""Conditions: the names and units of a parsed condition checked against the signals of a drive's model, and of devices.

``bind("state == S4 and velocity > 1000", model)`` gives a :class:`Condition` whose :meth:`~Condition.holds` reads one
drive.  The words of a state need no quotes; a fault is compared with its number, name or cause (``fault == 702``,
``fault == "32-1"``, ``fault == undervoltage``); a number beside a signal may have a unit (``velocity > 1000 rpm``).
``island-1.part_present`` is a signal of a device (:mod:`pnfarm.signals.device_signal`).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from pnfarm.errors import ConfigError
from pnfarm.signals.device_signal import FACTS, DeviceFact, DeviceSignal, find_in, split_name
from pnfarm.station.signals import STATES, WORDS, DriveSignal, find_parameter, find_signal, signal_names
from pnfarm.vocabulary.conditions import (
    Both,
    Comparison,
    ConditionError,
    Either,
    Name,
    Not,
    Number,
    Text,
    comparisons_in,
    evaluate,
    names_in,
    parse_condition,
)
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quantities import in_unit, show_quantity
from pnfarm.vocabulary.quoting import did_you_mean, shortened, shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.drives.description.model import Model
    from pnfarm.signals.device_signal import KnownDevices, LiveDevices
    from pnfarm.station.axis import Axis
    from pnfarm.vocabulary.conditions import Operand, Tree, Value

__all__ = ["Condition", "bind"]

AnySignal: TypeAlias = DriveSignal | DeviceSignal | DeviceFact

_EQUAL = frozenset({"==", "!="})


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition on a drive of one model, on devices, or on both; without a drive, its ``station`` is None."""

    text: str
    tree: Tree
    signals: Mapping[str, AnySignal]

    def read(self, name: str, station: Axis | None, devices: LiveDevices) -> Value:
        """The present value of one of its signals."""
        signal = self.signals[name]
        if not isinstance(signal, DriveSignal):
            return signal.read(devices)
        assert station is not None
        return signal.now(station)

    def holds(self, station: Axis | None, devices: LiveDevices, known: Mapping[str, Value] | None = None) -> bool:
        """Whether it holds; ``known`` are values of signals at the moment of an event."""

        def value_of(operand: Operand) -> Value:
            if not isinstance(operand, Name):
                return operand.value
            if known is not None and operand.name in known:
                return known[operand.name]
            return self.read(operand.name, station, devices)

        return evaluate(self.tree, value_of)

    def values(self, station: Axis | None, devices: LiveDevices) -> dict[str, Any]:
        """The present value of each of its signals, for a report; a state's word, numbers in the signal's unit."""
        return {name: self.read(name, station, devices) for name in self.signals}

    def shown(self, values: Mapping[str, Any]) -> dict[str, str]:
        """Values as of :meth:`values` for people: with units, and as many digits as its comparisons need."""
        beside: dict[str, list[float]] = {}
        for one in comparisons_in(self.tree):
            for side, other in ((one.left, one.right), (one.right, one.left)):
                if isinstance(side, Name):
                    number = values.get(other.name) if isinstance(other, Name) else other.value
                    if isinstance(number, (int, float)):
                        beside.setdefault(side.name, []).append(number)
        return {
            name: show_quantity(value, self.signals[name].unit, beside.get(name, ())) for name, value in values.items()
        }


def bind(text: str, model: Model | None, devices: KnownDevices | None = None, own: str = "") -> Condition:
    """A condition as drives of ``model`` understand it, None: no drive.  Raises :class:`ConditionError`.

    ``own``: the device whose signals need no station in their names.
    """
    return _Binder(model, devices or {}, own).bind(text, parse_condition(text))


class _Binder:
    def __init__(self, model: Model | None, devices: KnownDevices, own: str) -> None:
        self._model = model
        self._devices = devices
        self._own = own
        self._signals: dict[str, AnySignal] = {}

    def bind(self, text: str, tree: Tree) -> Condition:
        bound = self._tree(tree)
        if not names_in(bound):
            raise ConditionError("names no signal, so that it is always the same", 1)
        return Condition(text, bound, self._signals)

    def _tree(self, tree: Tree) -> Tree:
        match tree:
            case Comparison():
                return self._comparison(tree)
            case Not():
                return Not(self._tree(tree.inner))
            case Both():
                return Both(tuple(map(self._tree, tree.parts)))
            case Either():
                return Either(tuple(map(self._tree, tree.parts)))
            case Name():
                name, signal = self._known(tree)
                if signal.form != "bit":
                    raise ConditionError(f"{name.name} is no yes or no", tree.column, f"such as `{_example(signal)}`")
                return name
            case _:
                raise ConditionError("is a value, not a condition", tree.column)

    def _comparison(self, tree: Comparison) -> Comparison:
        left, right = tree.left, tree.right
        if isinstance(left, Name) and self._find(left) is not None:
            name, signal = self._known(left)
            if isinstance(right, Name) and self._find(right) is not None:
                other, second = self._known(right)
                if second.form != signal.form or second.unit != signal.unit:
                    what = f"{name.name} is compared with {other.name}, which is of another kind"
                    raise ConditionError(what, tree.column, "two signals of the same unit")
                self._check_sign(tree.sign, signal, tree.column)
                return dataclasses.replace(tree, left=name, right=other)
            return dataclasses.replace(tree, left=name, right=self._value(signal, right, tree))
        if isinstance(right, Name) and self._find(right) is not None:
            name, signal = self._known(right)
            return dataclasses.replace(tree, left=self._value(signal, left, tree), right=name)
        for side in (left, right):
            if isinstance(side, Name):
                self._known(side)
        raise ConditionError("compares two values", tree.column, "a signal on one side")

    def _find(self, name: Name) -> AnySignal | None:
        if not name.parameter:
            station, signal = split_name(name.name)
            if (station or self._own) in self._devices:
                return find_in(self._devices, station or self._own, signal)
        if self._model is None:
            return None
        return (find_parameter if name.parameter else find_signal)(self._model, name.name)

    def _known(self, name: Name) -> tuple[Name, AnySignal]:
        signal = self._find(name)
        if signal is None:
            what, allowed = self._unknown(name)
            raise ConditionError(what, name.column, allowed)
        self._signals[signal.name] = signal
        return Name(signal.name, name.column, name.parameter), signal

    def _unknown(self, name: Name) -> tuple[str, str]:
        """What is wrong with a name, and what is allowed."""
        station, signal = split_name(name.name)
        known = None if name.parameter else self._devices.get(station or self._own)
        if known is not None:
            what = f"{station or self._own} has no signal {shown(signal)}{did_you_mean(signal, (*known, *FACTS))}"
            return what, shortened([*known, *FACTS])
        if not name.parameter and station and station not in WORDS and (self._devices or self._model is None):
            hint = did_you_mean(station, self._devices)
            return f"there is no device {shown(station)}{hint}", shortened(list(self._devices)) or "none"
        if self._model is None:
            return f"{shown(name.name)} is no signal of a device", "STATION.SIGNAL, such as island-1.part_present"
        if name.parameter:
            hint = did_you_mean(name.name, self._model.parameter_names)
            what = f"{self._model.name} has no parameter {shown(name.name)}{hint}"
            return what, f"a name or number of `pnfarm models {self._model.name}`"
        names = signal_names(self._model)
        what = f"{self._model.name} has no signal {shown(name.name)}{did_you_mean(name.name, names)}"
        return what, _allowed(name.name, names)

    def _check_sign(self, sign: str, signal: AnySignal, column: int) -> None:
        if sign not in _EQUAL and signal.form in {"bit", "state", "fault", "text"}:
            raise ConditionError(f"{signal.name} has no order, and {sign} compares one", column, "== or !=")

    def _value(self, signal: AnySignal, side: Operand, tree: Comparison) -> Operand:
        self._check_sign(tree.sign, signal, tree.column)
        match signal:
            case DeviceSignal():
                return self._of_device(signal, side, tree.sign)
            case DriveSignal(form="state"):
                return self._state(signal, side)
            case DriveSignal(form="fault"):
                return self._fault(side)
            case _:
                return self._number(signal, side)

    def _of_device(self, signal: DeviceSignal, side: Operand, sign: str) -> Operand:
        try:
            if signal.form != "text":
                number = self._number(signal, side)
                return Number(signal.number(number.value, exactly=sign in _EQUAL), "", side.column, number.written)
            if not isinstance(side, Text):
                raise ConditionError(
                    f"{signal.name} is of type {signal.signal.type.name}", side.column, "a text in quotes"
                )
            return Text(signal.text(side.value), side.column)
        except Problem as problem:
            raise ConditionError(f"{signal.name}: {problem.what}", side.column, problem.allowed) from problem

    def _state(self, signal: DriveSignal, side: Operand) -> Operand:
        word = side.name if isinstance(side, Name) else side.value if isinstance(side, Text) else side.written
        if isinstance(side, Number) and side.value in {1.0, 2.0, 3.0, 4.0, 5.0} and not side.unit:
            word = f"S{side.value:.0f}"
        found = next((state for state in STATES if state.lower() == str(word).lower()), None)
        if found is None:
            what = f"{signal.name} is never {shown(str(word))}{did_you_mean(str(word), STATES)}"
            raise ConditionError(what, side.column, ", ".join(STATES))
        return Text(found, side.column)

    def _fault(self, side: Operand) -> Operand:
        assert self._model is not None
        word = side.name if isinstance(side, Name) else side.value if isinstance(side, Text) else side.written
        if word in {"0", "none"}:
            return Number(0.0, "", side.column, "0")
        try:
            return Number(float(self._model.fault(str(word)).number), "", side.column, str(word))
        except ConfigError as error:
            known = [text for fault in self._model.faults.values() for text in (fault.label, fault.name, fault.cause)]
            hint = did_you_mean(str(word), known)
            what = f"{self._model.name} has no fault {shown(str(word))}{hint}"
            raise ConditionError(
                what, side.column, "0, or a fault of `pnfarm models`: number, name or cause"
            ) from error

    def _number(self, signal: AnySignal, side: Operand) -> Number:
        if not isinstance(side, Number):
            if isinstance(side, Name):
                self._known(side)
            raise ConditionError(f"{signal.name} is a number", side.column, _example(signal))
        if signal.form == "bit" and (side.unit or side.value not in {0.0, 1.0}):
            raise ConditionError(f"{signal.name} is never {side.written}", side.column, "0, 1, true or false")
        try:
            return Number(in_unit(side.value, side.unit, signal.unit), "", side.column, side.written)
        except Problem as problem:
            raise ConditionError(f"{signal.name} {problem.what}", side.column, problem.allowed) from problem


def _example(signal: AnySignal) -> str:
    match signal.form:
        case "state":
            return "state == S4"
        case "fault":
            return f"{signal.name} == 0"
        case "bit":
            return signal.name
        case "text":
            return f'{signal.name} == ""'
        case _:
            return f"{signal.name} > 0"


def _allowed(wanted: str, known: list[str]) -> str:
    """The names near to the one that is wanted: the bits of its word, else those of any drive."""
    word, dot, _ = wanted.lower().partition(".")
    inside = [name for name in known if dot and name.startswith(f"{word}.")]
    return ", ".join(inside or [name for name in known if "." not in name]) + ("" if inside else ', param("NAME")')
