"""Of the axis record: measurement."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["MEASUREMENT_RECORD"]

MEASUREMENT_RECORD = subject(
    "measurement",
    "What the drive measures beside the truth.",
    settings=[
        Field("velocity_noise", "f8", "rpm", "station", "noise of the measured speed, effective value, 0 = none"),
        Field("current_noise", "f8", "A", "station", "of the measured current, alike"),
        Field("position_noise", "f8", "rev", "station", "of the measured position, alike"),
        Field("seed", "i8", "", "station", "begins the sequence of noise, 0 = there is none"),
    ],
    state=[
        Field("noise", "i8", "", "firmware", "where in that sequence it is, 0 = not begun"),
        Field("velocity_deviation", "f8", "rpm", "firmware", "what noise adds to the measured speed in this step"),
        Field("current_deviation", "f8", "A", "firmware", "to the measured current, alike"),
        Field("position_deviation", "f8", "rev", "firmware", "to the measured position, alike"),
    ],
)
