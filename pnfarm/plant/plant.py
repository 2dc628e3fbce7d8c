"""A farm's plant: its values by name, the inputs of stations that it writes, and its models in Python."""

from __future__ import annotations

from functools import partial
from math import nan
from typing import TYPE_CHECKING, Any

from pnfarm.plant.events import PlantStepsLeftOut
from pnfarm.plant.fmi.models import FmuModels
from pnfarm.plant.fmi.planned import FmuModel
from pnfarm.plant.part import PlantPart
from pnfarm.plant.plan import StationEnd
from pnfarm.plant.python_file import ModelClass
from pnfarm.plant.python_models import PythonModels
from pnfarm.plant.table import PlantTable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pnfarm.engine.columns import Columns
    from pnfarm.plant.plan import PlantPlan
    from pnfarm.signals.signal import Signal
    from pnfarm.station.axis import Axis
    from pnfarm.station.event import Event
    from pnfarm.station.plain_signals import PlainSignals
    from pnfarm.wire.value_types import Value

__all__ = ["Plant"]

#: Between two checks of the steps that were left out.
LOOK_NS = 1_000_000_000


class Plant:
    """``signals``: those of devices, by the devices' names; ``note`` records an event, with its time first.

    ``late``: in real time, takes how late a model in Python or an FMU was; None in virtual time.
    """

    def __init__(
        self,
        plan: PlantPlan,
        axes: Mapping[str, Axis],
        signals: Mapping[str, PlainSignals],
        columns: Columns,
        note: Callable[[int, Event], object],
        *,
        late: Callable[[int, int], object] | None = None,
    ) -> None:
        self.plan = plan
        self._signals = signals
        self._note = note
        #: In real time: carries an event of a model's thread to where the log is.
        self.carry: Callable[[Callable[[], object]], object] | None = None
        self._engine = columns.engine[0]
        self._left_out = 0
        self._look_ns = 0
        self._in_real_time = late is not None
        #: Its rows, for a saved state.
        self.table = PlantTable(plan, axes, signals, columns)
        self._axes = axes
        #: Telegrams of the axes of which wires read bits.
        self._telegrams = {name: axes[name].store.telegram_number for name in self.table.bits}
        python = [model for model in plan.models.values() if isinstance(model.what, ModelClass)]
        self.python = PythonModels(python, self.table.values, self._carried, late=late)
        fmus = [model for model in plan.models.values() if isinstance(model.what, FmuModel)]
        self.fmus = FmuModels(fmus, self.table.values, self._carried, late=late)
        #: By station: inputs, the numbers of their values, and what was written last.
        self._written: dict[str, list[tuple[Signal, int]]] = {}
        self._given: dict[str, list[float]] = {}
        wired: set[int] = set()
        for wire in plan.wires:
            end = wire.target
            if not isinstance(end, StationEnd):
                wired.add(end)
            elif not end.is_axis:
                signal = signals[end.station].signal(end.signal)
                number = self.table.outlets[end.station, end.signal]
                self._written.setdefault(end.station, []).append((signal, number))
        #: The models, by name.
        self.parts = {
            name: PlantPart(model, self.table.values, wired, self.table.hold) for name, model in plan.models.items()
        }

    @property
    def row(self) -> Any:
        """Its row of :data:`pnfarm.table.plant.PLANT`."""
        return self.table.row[0]

    @property
    def steps(self) -> int:
        """Steps so far."""
        return int(self.row.steps)

    @property
    def fmu_names(self) -> list[str]:
        """Models that are FMUs: what is inside them is in processes of their own."""
        return [name for name, model in self.plan.models.items() if isinstance(model.what, FmuModel)]

    def start(self, now: int) -> None:
        """Have the engine step it from its next tick on.

        In real time its grid is that of its step, as the frames' grids have the same origin: so a step is part of a
        tick that sends, and no tick of its own just before one.
        """
        if self._in_real_time:
            self._engine.plant_due_ns = now - now % self.plan.step_ns
        self.python.start(now)
        self.fmus.start(now)
        self.table.attach()

    def _carried(self, now: int, event: Event) -> None:
        """An event of a model in Python."""
        if self.carry is None:
            self._note(now, event)
        else:
            self.carry(partial(self._note, now, event))

    def next_deadline(self) -> int | None:
        """When a model in Python or an FMU is due; in real time they have threads of their own, and the log is due."""
        if self._in_real_time:
            return self._look_ns
        return min((due for one in (self.python, self.fmus) if (due := one.next_deadline()) is not None), default=None)

    def service(self, now: int) -> None:
        """Make the steps of models in Python and of FMUs that are due; in real time report those that were left out."""
        if not self._in_real_time:
            self.python.service(now)
            self.fmus.service(now)
        elif now >= self._look_ns:
            self._look_ns = now + LOOK_NS
            left_out = int(self._engine.plant_late)
            if left_out != self._left_out:
                self._note(now, PlantStepsLeftOut(left_out - self._left_out))
                self._left_out = left_out

    def close(self) -> None:
        """End the models in Python and the FMUs, unless these have threads, which end them."""
        if not self._in_real_time:
            self.python.close()
            self.fmus.close()

    def settled(self, axes: Iterable[str]) -> None:
        """Something happened to the station of these axes: its controller may have chosen another telegram."""
        for name in axes:
            if name in self._telegrams and self._telegrams[name] != (now := self._axes[name].store.telegram_number):
                self._telegrams[name] = now
                self.table.follow_telegram(name)

    def changed(self) -> None:
        """The engine reported that inputs of stations changed: write them."""
        row = self.row
        # before the values are read: what changes from now on is reported again
        row.taken = row.reported
        for station, written in self._written.items():
            found = self.table.values[[number for _, number in written]].tolist()
            before = self._given.get(station, [nan] * len(found))
            if found != before:
                self._given[station] = found
                changes = zip(written, found, before, strict=True)
                self._signals[station].take({s.name: _fitting(s, new) for (s, _), new, old in changes if new != old})


def _fitting(signal: Signal, value: float) -> Value:
    """A number as a signal has it: what is beyond its type is at the limit, as an analogue input's."""
    if signal.type.kind == "bool":
        return value != 0.0
    limits = signal.type.limits
    # a limit of 64 bits that is multiplied is none of its type
    low, high = limits if signal.scale == 1 else sorted(limit * signal.scale for limit in limits)
    value = min(max(value, low), high)
    return round(value) if signal.scale == 1 and signal.type.kind != "float" else value
