"""Fields of the axis record: measurement."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["MEASUREMENT_RECORD"]

MEASUREMENT_RECORD = subject(
    "measurement",
    "Noise of the drive's measurements.",
    settings=[
        Field("velocity_noise", "f8", "rpm", "station", "noise of the measured speed, RMS value, 0 = none"),
        Field("current_noise", "f8", "A", "station", "of the measured current, RMS value, 0 = none"),
        Field("position_noise", "f8", "rev", "station", "of the measured position, RMS value, 0 = none"),
        Field("seed", "i8", "", "station", "seed of the noise sequence, 0 = no noise"),
    ],
    state=[
        Field("noise", "i8", "", "firmware", "state of that sequence, 0 = not begun"),
        Field("velocity_deviation", "f8", "rpm", "firmware", "noise of the measured speed in this step"),
        Field("current_deviation", "f8", "A", "firmware", "noise of the measured current in this step"),
        Field("position_deviation", "f8", "rev", "firmware", "noise of the measured position in this step"),
    ],
)
