"""The plant's rows: made of its plan, found by the engine through their addresses."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pnfarm.behaviours.catalogue import behaviour_number
from pnfarm.behaviours.declaration import Behaviour
from pnfarm.engine.gap import between_ticks
from pnfarm.engine.plant.step import take_step
from pnfarm.firmware.axis import AXIS
from pnfarm.plant.coupling_kinds import CouplingKind
from pnfarm.plant.plan import StationEnd
from pnfarm.signals.places import plain_place
from pnfarm.table.access.places import Place, place_of
from pnfarm.table.compiling.by_pointer import address_of
from pnfarm.table.plant import (
    BEHAVIOUR,
    COUPLING,
    OUTLET,
    OUTLET_REAL,
    OUTLET_STATION,
    PLANT,
    WIRE,
    WIRE_BIT,
    WIRE_EARLY,
    WIRE_HELD,
    WIRE_INVERTED,
    WIRE_NUMBER,
)
from pnfarm.table.trace import PROBE, SOURCE_AXIS_INTEGER

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.engine.columns import Columns
    from pnfarm.plant.plan import PlannedModel, PlannedWire, PlantPlan
    from pnfarm.station.axis import Axis
    from pnfarm.station.plain_signals import PlainSignals

__all__ = ["PlantCopies", "PlantTable"]

_FORMS = {"number": WIRE_NUMBER, "bit": WIRE_BIT, "inverted": WIRE_INVERTED}
#: What is 0 always.
_NOWHERE = Place(SOURCE_AXIS_INTEGER, 0, 0, mask=0)


class PlantCopies(NamedTuple):
    """Copies of the arrays that steps change, and the time of the last step."""

    values: Any
    memory: Any
    behaviours: Any
    couplings: Any
    last_ns: int


class PlantTable:
    """Rows for a plan.

    The engine steps the plant from :meth:`attach` on.
    """

    def __init__(
        self, plan: PlantPlan, axes: Mapping[str, Axis], signals: Mapping[str, PlainSignals], columns: Columns
    ) -> None:
        self._axes = axes
        self._plan = plan
        self._signals = signals
        self._columns = columns
        self.row = PLANT.allocate(1)
        ends = [wire.source for wire in plan.wires if isinstance(wire.source, StationEnd)]
        sources = dict.fromkeys((end.station, end.signal) for end in ends)
        #: Signals of stations that wires read, each once, and the numbers of their values.
        self.probed = {source: number for number, source in enumerate(sources, plan.values)}
        targets = [wire.target for wire in plan.wires if isinstance(wire.target, StationEnd)]
        #: Ends of wires at stations, and the numbers of their values.
        first = plan.values + len(self.probed)
        self.outlets = {(end.station, end.signal): first + i for i, end in enumerate(targets)}
        self.values = np.zeros(max(1, first + len(targets)))
        self._wires = WIRE.allocate(max(1, len(plan.wires)))
        self._outlets = OUTLET.allocate(max(1, len(targets)))
        self._probes = PROBE.allocate(max(1, len(self.probed)))
        behaviours = [one for one in plan.models.values() if isinstance(one.what, Behaviour)]
        couplings = [one for one in plan.models.values() if isinstance(one.what, CouplingKind)]
        self._behaviours = BEHAVIOUR.allocate(max(1, len(behaviours)))
        self._couplings = COUPLING.allocate(max(1, len(couplings)))
        self.memory = np.zeros(max(1, sum(_memory_of(one) for one in behaviours)))
        #: Rows of the wires to models, by the numbers of the inputs.
        self._targets = {wire.target: row for row, wire in enumerate(plan.wires) if isinstance(wire.target, int)}
        self._fill_wires(plan.wires)
        #: By axis, the bits of words that wires read: where these are depends on the telegram.
        self.bits: dict[str, list[tuple[Any, str]]] = {}
        for row, (station, signal) in zip(self._probes, self.probed, strict=False):
            self._place(station, signal).fill(row)
            if station in axes and "." in signal:
                self.bits.setdefault(station, []).append((row, signal))
        for row, end in zip(self._outlets, targets, strict=False):
            self._fill_outlet(row, end)
        place = 0
        for row, model in zip(self._behaviours, behaviours, strict=False):
            place = self._fill_behaviour(row, model, place)
        for row, model in zip(self._couplings, couplings, strict=False):
            self._fill_coupling(row, model)
        counts = {
            "value": (self.values, len(self.values)),
            "memory": (self.memory, len(self.memory)),
            "wire": (self._wires, len(plan.wires)),
            "behaviour": (self._behaviours, len(behaviours)),
            "coupling": (self._couplings, len(couplings)),
            "outlet": (self._outlets, len(targets)),
            "probe": (self._probes, len(self.probed)),
            "axis": (columns.axis, len(columns.axis)),
            "image": (columns.image, len(columns.image)),
            "provided": (columns.provided.rows, len(columns.provided.rows)),
            "provided_octets": (columns.provided.octets, len(columns.provided.octets)),
            "consumed": (columns.consumed.rows, len(columns.consumed.rows)),
            "consumed_octets": (columns.consumed.octets, len(columns.consumed.octets)),
            "event": (columns.events, len(columns.events)),
        }
        for name, (array, count) in counts.items():
            self.row[0][name] = array.ctypes.data
            self.row[0][f"{name}_count"] = count
        self.row[0].engine = columns.engine.ctypes.data
        self.row[0].probed = plan.values
        self._step_ns = plan.step_ns
        # compiled here, if it is not cached: half a minute, before the farm's time begins
        self._call = address_of(take_step, PLANT)

    def attach(self) -> None:
        """Have the engine step it."""
        engine = self._columns.engine[0]
        engine.plant_row = self.row.ctypes.data
        engine.plant_step_ns = self._step_ns
        # set last: from now on the engine looks at the others
        engine.plant_call = self._call

    def follow_telegram(self, axis: str) -> None:
        """Another telegram of an axis is in force, which has its bits elsewhere."""
        for row, signal in self.bits[axis]:
            # 0 until it is set again, whatever the engine reads meanwhile
            row.mask = 0
            self._place(axis, signal).fill(row)

    # -- its state

    def copies(self) -> PlantCopies:
        """All that steps change, copied; to be called between two steps."""
        return PlantCopies(
            self.values.copy(),
            self.memory.copy(),
            self._behaviours.copy(),
            self._couplings.copy(),
            int(self.row[0].last_ns),
        )

    def put_back(self, copies: PlantCopies) -> None:
        """Copies that were changed; to be called between two steps."""
        self.values[:], self.memory[:] = copies.values, copies.memory
        self._behaviours[:], self._couplings[:] = copies.behaviours, copies.couplings
        # all inputs of stations are reported again
        self._outlets["seen"] = 0

    def hold(self, number: int, value: float | None) -> None:
        """Have the input with this number keep a value, whatever its wire brings; None: the wire writes it again.

        Raises :class:`EnvironmentError_` where the engine comes to no rest.
        """

        def write() -> None:
            self._wires[self._targets[number]].late = WIRE_EARLY if value is None else WIRE_HELD
            if value is not None:
                self.values[number] = value

        between_ticks(self._columns, write)

    def _place(self, station: str, signal: str) -> Place:
        axis = self._axes.get(station)
        if axis is None:
            signals = self._signals[station]
            found = signals.signal(signal)
            place = plain_place(found, *signals.whereabouts(signal))
            # plain_place gives the octet of a bit
            return place if found.bit is None else replace(place, shift=found.bit, mask=1)
        # a bit that the telegram in force does not have is 0
        return self._plan.axes[station].place_in(axis, signal) or _NOWHERE

    def _fill_wires(self, wires: tuple[PlannedWire, ...]) -> None:
        for row, wire in zip(self._wires, wires, strict=False):
            source, target = wire.source, wire.target
            row.form = _FORMS[wire.form]
            row.source = self.probed[source.station, source.signal] if isinstance(source, StationEnd) else source
            row.target = self.outlets[target.station, target.signal] if isinstance(target, StationEnd) else target
            row.late = isinstance(target, StationEnd)
            row.scale, row.offset = wire.scale, wire.offset

    def _fill_outlet(self, row: Any, end: StationEnd) -> None:
        row.value = self.outlets[end.station, end.signal]
        if not end.is_axis:
            row.form = OUTLET_STATION
            return
        taken, axis = self._plan.axes[end.station].takes(end.signal), self._axes[end.station]
        assert taken is not None
        axis.handle.axis.machine.settings.parts |= taken.part
        place = place_of(AXIS, taken.field).in_row(axis.index)
        row.form, row.word, row.axis = taken.form, place.word, axis.index
        row.scale, row.least = taken.scale, taken.least
        row.shift = 0 if taken.form == OUTLET_REAL else place.shift + taken.bit

    def _fill_behaviour(self, row: Any, model: PlannedModel, place: int) -> int:
        """A behaviour's row and its memory from ``place`` on; returns where it ends."""
        kind = model.what
        assert isinstance(kind, Behaviour)
        row.kind, row.step_ns = behaviour_number(kind.name), model.step_ns
        row.value, row.values = model.first, len(kind.ports)
        row.memory, row.parameters, row.state = place, len(kind.parameters), kind.state
        for number, parameter in enumerate(kind.parameters):
            self.memory[place + number] = model.parameters[parameter.name]
        return place + _memory_of(model)

    def _fill_coupling(self, row: Any, model: PlannedModel) -> None:
        kind, given = model.what, model.parameters
        assert isinstance(kind, CouplingKind)
        axes = [self._axes[name].index for name in given["axes"]]
        row.kind, row.value = kind.code, model.first
        row.first, row.second = axes[0], axes[1] if len(axes) > 1 else -1
        row.ratio = given.get("ratio", 1.0)
        row.inertia, row.damped = given.get("inertia", 0.0), given.get("friction", 0.0)
        row.stiffness, row.damping = given.get("stiffness", 0.0), given.get("damping", 0.0)
        row.gap = given.get("backlash", 0.0) * pi / 180.0
        self.values[model.first] = given["offset"]


def _memory_of(model: PlannedModel) -> int:
    """Numbers that a behaviour has in memory."""
    kind = model.what
    assert isinstance(kind, Behaviour)
    return len(kind.parameters) + kind.state
