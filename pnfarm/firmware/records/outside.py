"""Fields of the axis record: what a plant puts on the axis."""

from __future__ import annotations

from pnfarm.table.axis_codes import FARTHEST
from pnfarm.table.layout import Field, subject

__all__ = ["OUTSIDE_RECORD"]

OUTSIDE_RECORD = subject(
    "outside",
    "What the plant puts on the shaft and on the drive's inputs, in the shaft's direction.",
    state=[
        Field("torque", "f8", "N m", "engine", "against the shaft's direction, in addition to the load's"),
        Field("inertia", "f8", "kg m^2", "engine", "in addition to the load's"),
        Field("friction", "f8", "N m", "engine", "dry friction in addition to the load's"),
        Field("holding", "f8", "N m", "engine", "dry friction of a brake of the machine, 0 = none is applied"),
        Field("stop_low", "f8", "rev", "engine", "end stop: the shaft turns no further", default=-FARTHEST),
        Field("stop_high", "f8", "rev", "engine", "end stop: the shaft turns no further", default=FARTHEST),
        Field("place", "f8", "rev", "engine", "where the shaft is held, with leads"),
        Field("speed", "f8", "rad/s", "engine", "speed at which it gets there, with leads"),
        Field("leads", "u1", "", "engine", "1 = the plant moves the shaft, whatever the motor does"),
        Field("inputs", "u4", "", "engine", "digital inputs that it switches on, bit by bit"),
        Field("limits", "u4", "", "engine", "limit switches that it presses: bit 0 low, bit 1 high"),
        Field("brake", "f8", "", "firmware", "1 = the holding brake holds the shaft"),
        Field("shaft", "f8", "rev", "firmware", "where the shaft is, in its own direction, from the farm's start on"),
        Field("shaft_speed", "f8", "rpm", "firmware", "its speed"),
    ],
)
