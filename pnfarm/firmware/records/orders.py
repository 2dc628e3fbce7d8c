"""Fields of the axis record: orders."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["ORDERS_RECORD"]

ORDERS_RECORD = subject(
    "orders",
    "The controller's requests in this step, independent of the bus: written by the axis' front.",
    state=[
        Field("power", "u1", "", "firmware", "for the power stage: POWER_*"),
        Field("power_changed", "u1", "", "firmware", "bits of power that changed in this step"),
        Field("led", "u1", "", "firmware", "1 = a controller sends requests"),
        Field("ramp", "u1", "", "firmware", "0 = the ramp generator gives zero"),
        Field("ramp_runs", "u1", "", "firmware", "0 = the ramp generator holds its output"),
        Field("setpoint", "u1", "", "firmware", "0 = the set point of the speed is zero"),
        Field("reject", "u1", "", "firmware", "1 = the present task ends"),
        Field("pause", "u1", "", "firmware", "1 = the present task waits"),
        Field("start", "u1", "", "firmware", "1 = the start of tasks is set"),
        Field("start_changed", "u1", "", "firmware", "1 = start changed in this step"),
        Field("home", "u1", "", "firmware", "1 = homing"),
        Field("home_changed", "u1", "", "firmware", "1 = home changed in this step"),
        Field("jog", "u1", "", "firmware", "jogging at the first or second set point: bits 0 and 1"),
        Field(
            "halt",
            "u1",
            "",
            "firmware",
            "1 = the axis comes to rest along the ramp and stays enabled, in torque control, too",
        ),
        Field("jog_barred", "u1", "", "firmware", "1 = other requests keep a jog from beginning"),
    ],
)
