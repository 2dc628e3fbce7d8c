"""What the engine observes of a drive beside its work: its speed between two scrapes, the controller's reaction.

The speed's extremes are those of two windows, the one before and the present one, so that whoever reads them sees all
extremes of the last :data:`PEAK_WINDOW_NS` at least, however often and by how many they are read.
"""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout

__all__ = ["OBSERVED", "PEAK_WINDOW_NS"]

#: Length of one window of the extremes.
PEAK_WINDOW_NS = 5_000_000_000

OBSERVED = Layout(
    "observed",
    "One row per axis: what the engine observes of it.",
    [
        Field("window_ns", "i8", "ns", "engine", "when the present window began, 0 = none yet"),
        Field("velocity_min", "f8", "rpm", "engine", "smallest speed of the shaft in the present window"),
        Field("velocity_max", "f8", "rpm", "engine", "largest"),
        Field("setpoint_min", "f8", "rpm", "engine", "smallest speed set point in the present window"),
        Field("setpoint_max", "f8", "rpm", "engine", "largest"),
        Field("last_velocity_min", "f8", "rpm", "engine", "the same of the window before"),
        Field("last_velocity_max", "f8", "rpm", "engine", ""),
        Field("last_setpoint_min", "f8", "rpm", "engine", ""),
        Field("last_setpoint_max", "f8", "rpm", "engine", ""),
        Field("stw1", "u2", "", "engine", "control word 1 that the controller sent last"),
        Field("fault_ns", "i8", "ns", "engine", "when the active faults began, 0 = none"),
        Field("changed", "u2", "", "engine", "bits of control word 1 that changed since then"),
    ],
)
