"""Of the axis record: ramp."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["RAMP_RECORD"]

RAMP_RECORD = subject(
    "ramp",
    "The ramp generator: from the set point of the speed to the speed controller's.",
    settings=[
        Field("acceleration", "f8", "rpm/s", "parameter", "ramp up (DRV.ACC)"),
        Field("deceleration", "f8", "rpm/s", "parameter", "ramp down (DRV.DEC)"),
        Field("quick_stop_deceleration", "f8", "rpm/s", "parameter", "quick stop ramp (CS.DEC)"),
        Field(
            "position_stop_deceleration",
            "f8",
            "rpm/s",
            "parameter",
            "quick stop ramp in position mode, 0 = as quick_stop_deceleration",
        ),
        Field("standstill", "f8", "rpm", "parameter", "below this the axis stands (CS.VTHRESH)"),
        Field("velocity_window", "f8", "rpm", "parameter", "ZSW1.8 and ZSW1.10: how near is on target"),
        Field("additive_speed", "f8", "rpm", "parameter", "added to the speed set point in operation"),
        Field("speed_override", "f8", "", "parameter", "part of every speed that is asked for", default=1.0),
        Field("generator_set", "u4", "", "parameter", "how often a parameter set it"),
        Field("generator", "u1", "", "parameter", "what becomes of velocity set points: RAMP_*"),
        Field("off_at_once", "u1", "", "parameter", "1 = STW1.4 = 0 makes the set point zero at once, not by a ramp"),
    ],
    state=[
        Field("setpoint", "f8", "rpm", "firmware", "velocity that the controller asks for"),
        Field("command", "f8", "rpm", "firmware", "velocity command behind the ramp generator (VL.CMD)"),
        Field("reference", "f8", "rpm", "firmware", "ramp, and what is added to it: the set point of the speed"),
        Field("up", "f8", "rpm/s", "firmware", "acceleration in force: DRV_ACC of the telegram, or DRV.ACC"),
        Field("down", "f8", "rpm/s", "firmware", "deceleration in force: DRV_DEC of the telegram, or DRV.DEC"),
        Field(
            "generator_left",
            "u4",
            "",
            "firmware",
            "ramp_generator_set plus 1, as homing left the interpolating mode; 0 = it did not",
        ),
        Field("jogging", "u1", "", "firmware", "1 = a jog of velocity mode runs, or brakes"),
    ],
)
