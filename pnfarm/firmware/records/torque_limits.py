"""Of the axis record: torque."""

from __future__ import annotations

from math import inf

from pnfarm.table.layout import Field, subject

__all__ = ["TORQUE_RECORD"]

TORQUE_RECORD = subject(
    "torque",
    "Torque that is asked for, and its limits beside the motor's peak current.",
    settings=[
        Field("rated", "f8", "N m", "station", "100 % of the torque limits, 0 = the model has none"),
        Field("limit_positive", "f8", "N m", "parameter", "most torque forwards, inf = no limit", default=inf),
        Field("limit_negative", "f8", "N m", "parameter", "most torque backwards, alike", default=inf),
        Field("scale", "f8", "", "parameter", "part of the peak torque that is allowed", default=1.0),
        Field("shares", "f8", "", "parameter", "part of that forwards and backwards", (2,), default=1.0),
        Field("command", "f8", "N m", "parameter", "torque set point of a parameter (IL.CMDU)"),
        Field("additive", "f8", "N m", "parameter", "added to the torque that the controllers ask for"),
        Field("speed_limited", "u1", "", "parameter", "1 = the speed limits hold in torque control"),
    ],
    state=[
        Field("setpoint", "f8", "N m", "firmware", "torque that the controller asks for"),
        Field("shares_in_force", "f8", "", "firmware", "these parts as they count", (2,), default=1.0),
    ],
)
