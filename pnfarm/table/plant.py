"""The plant behind the stations: its values, what computes them, and how they reach axes and stations.

Every port of a model, and each signal that a wire reads, is a *value*: a number of double precision in one array; a
bit is 0 or 1.  *Wires* copy values, *behaviours* compute those of built-in models, *couplings* join shafts, *outlets*
take values to the fields of axes, and to the stations, whose inputs the event loop writes.  The engine finds all
arrays by their addresses in one row (:data:`PLANT`), so that a farm without a plant has none of its machine code.
"""

from __future__ import annotations

from math import inf

from pnfarm.table.layout import Field, Layout

__all__ = ["BEHAVIOUR", "COUPLING", "OUTLET", "PLANT", "WIRE"]

# How a wire makes a value of another one (``WIRE.form``).
WIRE_NUMBER = 0  # source * scale + offset
WIRE_BIT = 1  # 1 where the source is not 0
WIRE_INVERTED = 2  # 1 where it is 0

# When a wire copies (``WIRE.late``).
WIRE_EARLY = 0  # before the models' step
WIRE_LATE = 1  # after it, because it ends at an outlet
WIRE_HELD = 2  # not at all: a force holds the input at its end

# Where a value goes to (``OUTLET.form``).
OUTLET_REAL = 0  # a field f8 of an axis
OUTLET_BIT = 1  # a bit of a field u4 of an axis
OUTLET_STATION = 2  # an input of a station, written by the event loop
OUTLET_PLACE = 3  # where the shaft of an axis is held

# What a coupling is (``COUPLING.kind``).
COUPLING_ELASTIC = 1  # a spring between two shafts, or between a shaft and a mass
COUPLING_RIGID = 2  # two shafts that turn as one

WIRE = Layout(
    "wire",
    "A wire of the plant: copies a value in each step.",
    [
        Field("form", "u1", "", "station", "WIRE_*"),
        Field("late", "u1", "", "station", "WIRE_EARLY, WIRE_LATE, or WIRE_HELD"),
        Field("source", "i4", "", "station", "number of the value that is read"),
        Field("target", "i4", "", "station", "number of the value that is written"),
        Field("scale", "f8", "", "station", "factor"),
        Field("offset", "f8", "", "station", "added after it"),
    ],
)

BEHAVIOUR = Layout(
    "behaviour",
    "A built-in model: its ports are values in sequence, inputs first; its parameters and its state are in memory.",
    [
        Field("kind", "u2", "", "station", "its place in the list of all kinds"),
        Field("value", "i4", "", "station", "number of its first value"),
        Field("values", "i4", "", "station", "number of its ports"),
        Field("memory", "i4", "", "station", "its first number in memory: parameters, then state"),
        Field("parameters", "i4", "", "station", "number of its parameters"),
        Field("state", "i4", "", "station", "numbers of its state"),
        Field("step_ns", "i8", "ns", "station", "time between two of its steps"),
        Field("last_ns", "i8", "ns", "engine", "time of its last step, 0 = none yet"),
    ],
)

OUTLET = Layout(
    "outlet",
    "Where a value goes to outside of the plant.",
    [
        Field("form", "u1", "", "station", "OUTLET_*"),
        Field("value", "i4", "", "station", "number of the value"),
        Field("word", "i4", "", "station", "64-bit word of the axis table with the field"),
        Field("axis", "i4", "", "station", "row of the axis that is held"),
        Field("shift", "u1", "bits", "station", "of a bit: its place in the word"),
        Field("scale", "f8", "", "station", "of a field f8: what it has for a value of 1", default=1),
        Field("least", "f8", "", "station", "of a field f8: the least that it can have", default=-inf),
        Field("shown", "f8", "", "engine", "of a station's input: the value that was reported last"),
        Field("seen", "u1", "", "engine", "1 = shown is set"),
    ],
)

COUPLING = Layout(
    "coupling",
    "Two shafts, or a shaft and a mass, and what is between them; torques and angles are those of the first shaft.",
    [
        Field("kind", "u1", "", "station", "COUPLING_*"),
        Field("first", "i4", "", "station", "row of an axis"),
        Field("second", "i4", "", "station", "row of the other axis, -1 = a mass"),
        Field("ratio", "f8", "", "station", "revolutions of the second for one of the first", default=1),
        Field("inertia", "f8", "kg m^2", "station", "of the mass"),
        Field("damped", "f8", "N m s/rad", "station", "viscous friction of the mass"),
        Field("stiffness", "f8", "N m/rad", "station", "of the spring"),
        Field("damping", "f8", "N m s/rad", "station", "beside the spring"),
        Field("gap", "f8", "rad", "station", "backlash, from stop to stop"),
        Field(
            "value", "i4", "", "station", "number of its first value: offset, torque on the mass; then what it gives"
        ),
        Field("angle", "f8", "rad", "engine", "of the mass"),
        Field("speed", "f8", "rad/s", "engine", "of the mass"),
        Field("torque", "f8", "N m", "engine", "that the second shaft puts on the first, against its direction"),
        Field("before", "f8", "rad/s", "engine", "how much faster the first was in the last step"),
        Field("begun", "u1", "", "engine", "1 = there was a step"),
    ],
)


def _array(name: str, what: str) -> list[Field]:
    return [
        Field(name, "i8", "", "station", f"address of {what}"),
        Field(f"{name}_count", "i8", "", "station", "how many there are"),
    ]


PLANT = Layout(
    "plant",
    "One row: where the plant's arrays are, and how far it is.",
    [
        *_array("value", "the values"),
        *_array("memory", "parameters and states of behaviours"),
        *_array("wire", "the wires"),
        *_array("behaviour", "the behaviours"),
        *_array("coupling", "the couplings"),
        *_array("outlet", "the outlets"),
        *_array("probe", "the probes (:data:`pnfarm.table.trace.PROBE`) that read signals of stations"),
        Field("probed", "i8", "", "station", "number of the value of the first probe"),
        *_array("axis", "the axes"),
        *_array("image", "the process images"),
        *_array("provided", "the rows of plain data that stations send"),
        *_array("provided_octets", "the octets of these"),
        *_array("consumed", "the rows of plain data that stations receive"),
        *_array("consumed_octets", "the octets of these"),
        Field("engine", "i8", "", "station", "address of the engine's row"),
        *_array("event", "the ring of events"),
        Field("last_ns", "i8", "ns", "engine", "time of the last step"),
        Field("steps", "i8", "", "engine", "steps so far"),
        Field("reported", "i8", "", "engine", "how often outlets of stations were reported as changed"),
        Field("taken", "i8", "", "station", "how many of these reports the event loop has carried out"),
    ],
)
