"""Fields of the axis record: ramp."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["RAMP_RECORD"]

RAMP_RECORD = subject(
    "ramp",
    "The ramp generator: from the speed set point to the reference of the speed controller.",
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
        Field("standstill", "f8", "rpm", "parameter", "below this the axis is at rest (CS.VTHRESH)"),
        Field("velocity_window", "f8", "rpm", "parameter", "window of ZSW1.8 and ZSW1.10"),
        Field("additive_speed", "f8", "rpm", "parameter", "added to the speed set point in operation"),
        Field("speed_override", "f8", "", "parameter", "factor of every requested speed", default=1.0),
        Field("slowness", "f8", "", "fault", "by how much longer ramps take than asked: 1 = twice the time"),
        Field("generator_set", "u4", "", "parameter", "how often a parameter has set generator"),
        Field("generator", "u1", "", "parameter", "use of the ramp generator: RAMP_*"),
        Field("off_at_once", "u1", "", "parameter", "1 = STW1.4 = 0 makes the set point zero at once, not by a ramp"),
    ],
    state=[
        Field("setpoint", "f8", "rpm", "firmware", "velocity that the controller requests"),
        Field("command", "f8", "rpm", "firmware", "velocity command after the ramp generator (VL.CMD)"),
        Field(
            "reference", "f8", "rpm", "firmware", "command plus what is added to it: the speed controller's set point"
        ),
        Field("up", "f8", "rpm/s", "firmware", "acceleration in force: DRV_ACC of the telegram, or DRV.ACC"),
        Field("down", "f8", "rpm/s", "firmware", "deceleration in force: DRV_DEC of the telegram, or DRV.DEC"),
        Field(
            "generator_left",
            "u4",
            "",
            "firmware",
            "generator_set plus 1 when homing left the interpolating mode; 0 = it did not",
        ),
        Field("jogging", "u1", "", "firmware", "1 = a jog of velocity mode runs or is braking"),
    ],
)
