"""A farm's plant: its values by name, the inputs of stations that it writes, and its models in Python."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.plant.events import PlantStepsLeftOut
from pnfarm.plant.plan import StationEnd
from pnfarm.plant.python_file import ModelClass
from pnfarm.plant.python_models import PythonModels
from pnfarm.plant.table import PlantTable
from pnfarm.vocabulary.quoting import did_you_mean, shortened, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.behaviours.declaration import Port
    from pnfarm.engine.columns import Columns
    from pnfarm.plant.plan import PlantPlan
    from pnfarm.signals.signal import Signal
    from pnfarm.station.axis import Axis
    from pnfarm.station.event import Event
    from pnfarm.station.plain_signals import PlainSignals
    from pnfarm.wire.value_types import Value

__all__ = ["Plant"]


class Plant:
    """``signals``: those of devices, by the devices' names; ``note`` records an event, with its time first."""

    def __init__(
        self,
        plan: PlantPlan,
        axes: Mapping[str, Axis],
        signals: Mapping[str, PlainSignals],
        columns: Columns,
        note: Callable[[int, Event], object],
        *,
        in_real_time: bool,
    ) -> None:
        self.plan = plan
        self._signals = signals
        self._note = note
        self._engine = columns.engine[0]
        self._left_out = 0
        self._in_real_time = in_real_time
        self._table = PlantTable(plan, axes, signals, columns)
        python = [model for model in plan.models.values() if isinstance(model.what, ModelClass)]
        self.python = PythonModels(python, self._table.values, note, in_real_time=in_real_time)
        #: Inputs of stations, and the numbers of their values.
        self._written: dict[str, list[tuple[Signal, int]]] = {}
        self._targets: set[int] = set()
        for wire in plan.wires:
            end = wire.target
            if not isinstance(end, StationEnd):
                self._targets.add(end)
            elif not end.is_axis:
                signal = signals[end.station].signal(end.signal)
                number = self._table.outlets[end.station, end.signal]
                self._written.setdefault(end.station, []).append((signal, number))
        self._ports: dict[str, tuple[Port, int]] = {
            f"{model.name}.{name}": place
            for model in plan.models.values()
            for name, place in (*model.inputs.items(), *model.outputs.items())
        }
        self._inputs = {f"{model.name}.{name}" for model in plan.models.values() for name in model.inputs}

    def start(self, now: int) -> None:
        """Have the engine step it from its next tick on."""
        self.python.start(now)
        self._table.attach()

    def next_deadline(self) -> int | None:
        """When a model in Python is due, unless these have a thread of their own."""
        return None if self._in_real_time else self.python.next_deadline()

    def service(self, now: int) -> None:
        """Make the steps of models in Python that are due, unless these have a thread of their own."""
        if not self._in_real_time:
            self.python.service(now)

    def changed(self, now: int) -> None:
        """The engine reported that inputs of stations changed: write them."""
        row = self._table.row[0]
        # before the values are read: what changes from now on is reported again
        row.taken = row.reported
        values = self._table.values
        for station, written in self._written.items():
            self._signals[station].take({signal.name: _fitting(signal, float(values[n])) for signal, n in written})
        left_out = int(self._engine.plant_late)
        if left_out != self._left_out:
            self._note(now, PlantStepsLeftOut(left_out - self._left_out))
            self._left_out = left_out

    # -- values by name

    @property
    def names(self) -> tuple[str, ...]:
        """``MODEL.PORT`` of all models, in the order of the file."""
        return tuple(self._ports)

    def get(self, name: str) -> float | bool:
        """A port's value; raises :class:`ConfigError` for an unknown name."""
        port, number = self._port(name)
        value = float(self._table.values[number])
        return value != 0.0 if port.form == "bit" else value

    def set(self, values: Mapping[str, float | bool]) -> None:
        """Set inputs that no wire writes, all or none; raises :class:`ConfigError`."""
        found = []
        for name, value in values.items():
            port, number = self._port(name)
            if name not in self._inputs:
                raise ConfigError(f"{name} is an output of the plant")
            if number in self._targets:
                raise ConfigError(f"{name} has a wire, which writes it in each step")
            if port.form == "bit":
                if not isinstance(value, bool) and value not in {0, 1}:
                    raise ConfigError(f"{name} is a switch, and cannot be {shown(value)}")
            elif isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                raise ConfigError(f"{name} is a number, and cannot be {shown(value)}")
            found.append((number, float(value)))
        for number, one in found:
            self._table.values[number] = one

    def readings(self) -> dict[str, tuple[Port, float | bool, bool]]:
        """Each port with its value, and whether it may be set."""
        return {
            name: (port, self.get(name), name in self._inputs and number not in self._targets)
            for name, (port, number) in self._ports.items()
        }

    def _port(self, name: str) -> tuple[Port, int]:
        found = self._ports.get(name)
        if found is None:
            hint = did_you_mean(name, self._ports)
            raise ConfigError(f"the plant has no port {shown(name)}{hint}; it has {shortened(list(self._ports))}")
        return found


def _fitting(signal: Signal, value: float) -> Value:
    """A number as a signal has it: what is beyond its type is at the limit, as an analogue input's."""
    if signal.type.kind == "bool":
        return value != 0.0
    low, high = sorted(limit * signal.scale for limit in signal.type.limits)
    value = min(max(value, low), high)
    return round(value) if signal.scale == 1 and signal.type.kind != "float" else value
