"""What an axis gives to the plant, and what it takes from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING

from pnfarm.behaviours.declaration import Port, bit, number
from pnfarm.firmware.axis import AXIS
from pnfarm.station.signals import SIGNALS, find_signal
from pnfarm.table.access.places import Place, place_of
from pnfarm.table.axis_codes import MACHINE_STOPS_MOVED
from pnfarm.table.plant import OUTLET_BIT, OUTLET_PLACE, OUTLET_REAL

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.config.axis import Load
    from pnfarm.drives.description.model import Model
    from pnfarm.station.axis import Axis

__all__ = ["GIVEN", "TAKEN", "PlantAxis", "Taken"]

#: Digital inputs of a drive.
INPUTS = 32
#: Dry friction that no motor overcomes, N m: more than inertia and torque of any axis make of a step.
HOLDING = 1e15
_MOVED = MACHINE_STOPS_MOVED


@dataclass(frozen=True, slots=True)
class Taken:
    """Where a value for an axis goes: the field of its record, and the bit of it, or what it has for a value of 1, and
    the least that it can have.

    ``part``: the part of the machine (MACHINE_*) that an axis with a wire to it has.
    """

    port: Port
    form: int
    field: str
    bit: int = 0
    scale: float = 1.0
    part: int = 0
    least: float = -inf


#: What any axis has beside its signals: the shaft as the machine sees it, whatever the drive's home and direction.
GIVEN: Mapping[str, tuple[Port, Place]] = {
    port.name: (port, place_of(AXIS, key))
    for port, key in (
        (number("shaft_position", "the shaft, from the farm's start on", "revolutions"), "outside.shaft"),
        (number("shaft_velocity", "its speed, in its own direction", "rpm"), "outside.shaft_speed"),
        (bit("brake", "the holding brake holds the shaft"), "outside.brake"),
    )
}
TAKEN: Mapping[str, Taken] = {
    one.port.name: one
    for one in (
        Taken(number("load_torque", "against the shaft's direction", "Nm"), OUTLET_REAL, "outside.torque"),
        Taken(number("load_inertia", "in addition to the load's, kg m^2"), OUTLET_REAL, "outside.inertia", least=0.0),
        Taken(number("load_friction", "dry friction in addition", "Nm"), OUTLET_REAL, "outside.friction", least=0.0),
        Taken(number("load_position", "the shaft is held here", "revolutions"), OUTLET_PLACE, "outside.place"),
        Taken(number("stop_low", "end stop: no further down"), OUTLET_REAL, "outside.stop_low", part=_MOVED),
        Taken(number("stop_high", "end stop: no further up"), OUTLET_REAL, "outside.stop_high", part=_MOVED),
        Taken(bit("brake_applied", "a brake of the machine holds it"), OUTLET_REAL, "outside.holding", scale=HOLDING),
        Taken(bit("limit_low", "the low limit switch is pressed"), OUTLET_BIT, "outside.limits", 0),
        Taken(bit("limit_high", "the high limit switch is pressed"), OUTLET_BIT, "outside.limits", 1),
        *(Taken(bit(f"input_{i}", f"digital input {i}"), OUTLET_BIT, "outside.inputs", i) for i in range(INPUTS)),
    )
}


#: The shaft's position as the machine measures it.
PLACE = "place"


@dataclass(frozen=True, slots=True)
class PlantAxis:
    """An axis as the plant sees it: its model, and how many revolutions a ``unit`` of its machine is."""

    model: Model
    unit: str = "revolutions"
    revolutions: float = 1.0

    @classmethod
    def of(cls, model: Model, load: Load) -> PlantAxis:
        """By what the farm file says of the load."""
        is_straight = load.lead is not None or model.pitch > 0.0
        return cls(model, "mm" if is_straight else "revolutions", load.revolutions(model.pitch))

    def port(self, name: str) -> Port | None:
        """A signal of the drive as a port, None where the plant cannot read it."""
        if name == PLACE:
            return number(PLACE, "as shaft_position, behind gear and lead", self.unit)
        if name in GIVEN:
            return GIVEN[name][0]
        signal = find_signal(self.model, name)
        if signal is None or not signal.has_place or signal.form in {"text", "state", "fault"}:
            return None
        return Port(name, "bit" if signal.form == "bit" else "number", signal.doc, signal.unit)

    def takes(self, name: str) -> Taken | None:
        """What the plant may give to it; None: no such thing."""
        found = TAKEN.get(name)
        if found is None or found.part != _MOVED:
            return found
        # where the machine has them
        return replace(found, port=replace(found.port, unit=self.unit), scale=self.revolutions)

    @property
    def names(self) -> list[str]:
        """The names of what it gives, without the bits of words."""
        return [PLACE, *GIVEN, *(name for name in SIGNALS if self.port(name) is not None)]

    def place_in(self, axis: Axis, name: str) -> Place | None:
        """Where the engine finds a signal of this axis; None: its telegram has no such bit."""
        if name == PLACE:
            return replace(GIVEN["shaft_position"][1].in_row(axis.index), scale=1.0 / self.revolutions)
        if name in GIVEN:
            return GIVEN[name][1].in_row(axis.index)
        signal = find_signal(axis.model, name)
        place = None if signal is None else signal.place(axis)
        return None if place is None else place.in_row(axis.index)
