"""A model of the plant as whatever has signals: its ports are found by ``MODEL.PORT``, in conditions, by ``io``,
in scenarios.

Its inputs may be written, unless a wire writes them, and forced: a force is stronger than a wire.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pnfarm.plant.fmi.planned import FmuModel
from pnfarm.plant.python_file import ModelClass
from pnfarm.signals.layers import EVERY
from pnfarm.signals.refusal import SignalError, all_or_none
from pnfarm.signals.signal import Signal
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shortened, shown
from pnfarm.wire.value_types import BOOL, FLOAT64

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from collections.abc import Set as AbstractSet

    from pnfarm.behaviours.declaration import Port
    from pnfarm.plant.plan import PlannedModel
    from pnfarm.wire.value_types import Value

__all__ = ["PlantPart", "PortSignals", "port_signals"]


class PortSignals:
    """As :class:`pnfarm.station.plain_signals.NamedSignals`; ``values`` are all of the plant, ``wired`` the numbers of
    those that a wire writes; ``hold`` keeps such a wire from writing one, or with None lets it."""

    def __init__(
        self, model: PlannedModel, values: Any, wired: AbstractSet[int], hold: Callable[[int, float | None], None]
    ) -> None:
        self._hold = hold
        self._values = values
        self._numbers = {name: number for name, (_, number) in (*model.inputs.items(), *model.outputs.items())}
        self._wired = {name for name, number in self._numbers.items() if number in wired}
        #: What they have before anybody writes them: an FMU, or a coupling's key, says so.
        self._start = {name: float(values[number]) for name, number in self._numbers.items()}
        self._signals = port_signals(model)
        self._written: dict[str, Value] = {}
        self._forced: dict[str, Value] = {}
        self._seen: tuple[object, ...] = ()
        self._revision = 0
        self._changes = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Inputs, then outputs."""
        return tuple(self._signals)

    @property
    def revision(self) -> int:
        seen = (self._changes, *(float(self._values[number]) for number in self._numbers.values()))
        if seen != self._seen:
            self._seen = seen
            self._revision += 1
        return self._revision

    def signal(self, name: str) -> Signal:
        """One by its name; raises :class:`SignalError`."""
        found = self._signals.get(name)
        if found is None:
            hint = did_you_mean(name, self._signals)
            allowed = "" if hint else shortened(list(self._signals))
            raise SignalError([(shown(name).strip("'"), f"is not a port{hint}", allowed)])
        return found

    def get(self, name: str) -> Value:
        """The present value; raises :class:`SignalError` for an unknown name."""
        is_bit = self.signal(name).type is BOOL
        value = float(self._values[self._numbers[name]])
        return value != 0.0 if is_bit else value

    def is_free(self, name: str) -> bool:
        """Whether it is an input that no wire writes, whatever its owner is now."""
        return self.signal(name).direction == "input" and name not in self._wired

    def number(self, name: str) -> int:
        """The number of its value in the plant."""
        return self._numbers[name]

    def good(self, name: str) -> bool:
        """A port's value is always good; raises :class:`SignalError` for an unknown name."""
        return self.signal(name) is not None

    def readings(self) -> list[tuple[Signal, Value, bool]]:
        """Every port with its value."""
        return [(signal, self.get(name), True) for name, signal in self._signals.items()]

    def set(self, values: Mapping[str, Value]) -> dict[str, str]:
        """Write inputs, all or none; those that are forced, and ``force``.  Raises :class:`SignalError`."""
        self._written |= self._checked(values)
        self._apply(values)
        return {name: "force" for name in values if name in self._forced}

    def force(self, values: Mapping[str, Value | None]) -> dict[str, str]:
        """Over what is written, until a None releases it; ``*``: None releases all."""
        forced = self._checked({name: value for name, value in values.items() if value is not None}, forces=True)
        named = {name for name, value in values.items() if value is None}
        for name in named - {EVERY}:
            self.signal(name)
        released = [name for name in self._forced if name in named or EVERY in named]
        for name in released:
            del self._forced[name]
        self._forced |= forced
        self._apply([*forced, *released])
        return {}

    def owner(self, name: str) -> str:
        """Whose value it has: plant, force, value, default."""
        if self.signal(name).direction == "output":
            return "plant"
        if name in self._forced:
            return "force"
        return "plant" if name in self._wired else "value" if name in self._written else "default"

    @property
    def forced(self) -> Mapping[str, Value]:
        return self._forced

    def state(self) -> dict[str, Any]:
        """What is written and forced, as plain JSON; the values themselves are the plant's."""
        return {"written": dict(self._written), "forced": dict(self._forced)}

    def take_state(self, state: Mapping[str, Any], *, check: bool = False) -> None:
        """What :meth:`state` gave; ``check``: only look whether it fits.  Raises :class:`SignalError`."""
        written, forced = state.get("written"), state.get("forced")
        if not isinstance(written, dict) or not isinstance(forced, dict):
            raise SignalError([("written", "and forced are no mappings of ports", "")])
        written, forced = self._checked(written), self._checked(forced, forces=True)
        if not check:
            self._written, self._forced = written, forced
            for name in self._wired:
                self._hold_wire(name)
            self._changes += 1

    def _apply(self, names: Any) -> None:
        for name in names:
            if name in self._wired:
                self._hold_wire(name)
                continue
            value = self._forced.get(name, self._written.get(name, self._start[name]))
            self._values[self._numbers[name]] = float(value)
        self._changes += 1

    def _hold_wire(self, name: str) -> None:
        self._hold(self._numbers[name], float(self._forced[name]) if name in self._forced else None)

    def _checked(self, values: Mapping[str, Value], *, forces: bool = False) -> dict[str, Value]:
        return all_or_none(values, lambda name, value: self._value(name, value, forces=forces))

    def _value(self, name: str, value: Value, *, forces: bool) -> Value:
        signal = self.signal(name)
        if signal.direction == "output":
            raise Problem("is an output of the plant", "an input")
        if name in self._wired and not forces:
            raise Problem("has a wire, which writes it", "an input without a wire, or a force")
        found = signal.check(value)
        if not isinstance(found, (bool, int, float)) or not math.isfinite(found):
            raise Problem(f"is {shown(value)}", "a finite number")
        if signal.type is BOOL:
            return bool(found)
        return float(found)


class PlantPart:
    """A model; it has power and is connected, as far as a condition asks."""

    powered = connected = True

    def __init__(
        self, model: PlannedModel, values: Any, wired: AbstractSet[int], hold: Callable[[int, float | None], None]
    ) -> None:
        self.configured_name = model.name
        self.signals = PortSignals(model, values, wired, hold)
        self.kinds = model.kinds

    @property
    def device(self) -> PlantPart:
        """What is asked for a connection."""
        return self


def port_signals(model: PlannedModel) -> dict[str, Signal]:
    """The ports of a model as signals: inputs, then outputs."""
    # those of built-in behaviours change with the plant's steps, inside compiled code
    stepped = isinstance(model.what, (ModelClass, FmuModel))
    return {
        **{name: _signal(port, "input", name in model.exported) for name, (port, _) in model.inputs.items()},
        **{name: _signal(port, "output", name in model.exported, stepped) for name, (port, _) in model.outputs.items()},
    }


def _signal(port: Port, direction: Any, exported: bool, stepped: bool = False) -> Signal:
    kind = BOOL if port.form == "bit" else FLOAT64
    return Signal(port.name, direction, 0, 0, 0, kind, None, port.unit, 1.0, "little", exported, stepped)
