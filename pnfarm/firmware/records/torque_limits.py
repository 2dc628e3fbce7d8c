"""Fields of the axis record: torque."""

from __future__ import annotations

from math import inf

from pnfarm.table.layout import Field, subject

__all__ = ["TORQUE_RECORD"]

TORQUE_RECORD = subject(
    "torque",
    "Torque set points, and torque limits besides the motor's peak current.",
    settings=[
        Field("rated", "f8", "N m", "station", "100 % of the torque limits, 0 = the model has none"),
        Field("limit_positive", "f8", "N m", "parameter", "highest torque forwards, inf = no limit", default=inf),
        Field("limit_negative", "f8", "N m", "parameter", "highest torque backwards, inf = no limit", default=inf),
        Field("scale", "f8", "", "parameter", "part of the peak torque that is allowed", default=1.0),
        Field("shares", "f8", "", "parameter", "part of scale allowed forwards and backwards", (2,), default=1.0),
        Field("command", "f8", "N m", "parameter", "torque set point by parameter (IL.CMDU)"),
        Field("additive", "f8", "N m", "parameter", "added to the torque of the controllers"),
        Field("speed_limited", "u1", "", "parameter", "1 = the speed limits hold in torque control"),
    ],
    state=[
        Field("setpoint", "f8", "N m", "firmware", "torque that the controller requests"),
        Field("added", "f8", "N m", "firmware", "additional torque of the telegram"),
        Field("shares_in_force", "f8", "", "firmware", "shares in force", (2,), default=1.0),
    ],
)
