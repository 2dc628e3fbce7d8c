"""Of the axis record: orders."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["ORDERS_RECORD"]

ORDERS_RECORD = subject(
    "orders",
    "What the controller asks of the axis in this step, whatever the words of its bus: written by the axis' front.",
    state=[
        Field("power", "u1", "", "firmware", "of the power stage: POWER_*"),
        Field("power_changed", "u1", "", "firmware", "those of them that changed in this step"),
        Field("led", "u1", "", "firmware", "1 = somebody asks for anything at all"),
        Field("ramp", "u1", "", "firmware", "0 = the ramp generator gives zero"),
        Field("ramp_runs", "u1", "", "firmware", "0 = the ramp generator stands still at what it gives"),
        Field("setpoint", "u1", "", "firmware", "0 = the set point of the speed is zero"),
        Field("reject", "u1", "", "firmware", "1 = the task at hand ends"),
        Field("pause", "u1", "", "firmware", "1 = the task at hand waits"),
        Field("start", "u1", "", "firmware", "1 = what starts tasks is set"),
        Field("start_changed", "u1", "", "firmware", "1 = and it changed in this step"),
        Field("home", "u1", "", "firmware", "1 = homing"),
        Field("home_changed", "u1", "", "firmware", "1 = and that changed in this step"),
        Field("jog", "u1", "", "firmware", "jogging at the first or second set point: bits 0 and 1"),
        Field("jog_barred", "u1", "", "firmware", "1 = what else is asked for keeps a jog from beginning"),
    ],
)
