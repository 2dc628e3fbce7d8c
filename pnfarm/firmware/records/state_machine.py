"""Fields of the axis record: drive."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["DRIVE_RECORD"]

DRIVE_RECORD = subject(
    "drive",
    "The drive as a whole: its state, and what keeps it from operation.",
    settings=[
        Field("opmode", "u1", "", "parameter", "0 torque, 1 velocity, 2 position (DRV.OPMODE)"),
        Field("interlocks", "u1", "", "fault", "what the drive lacks: LACKS_*"),
        Field("quick_stop_option", "u1", "", "parameter", "what a quick stop does: QUICK_STOP_*"),
        Field("disable_method", "u1", "", "parameter", "how the power stage goes off by software: DISABLE_*"),
        Field("enable_acknowledges", "u1", "", "parameter", "1 = the rising hardware enable acknowledges faults"),
        Field("ready_with_on", "u1", "", "parameter", "1 = S1 may be left with STW1.0 set"),
        Field("enable_by_edge", "u1", "", "parameter", "1 = S3 is left when STW1.0 and 3 rise, not while they are set"),
        Field("on_by_enable", "u1", "", "parameter", "1 = STW1.3 leads to S3 as STW1.0 does; both lead to S4"),
        Field("off_at_once", "u1", "", "parameter", "1 = STW1.0 = 0 in operation switches off without a ramp"),
        Field(
            "setpoint_ignored",
            "u1",
            "",
            "parameter",
            "1 = set points of the telegram are ignored, torque.command is used; 2 = both are ignored",
        ),
    ],
    state=[
        Field("state", "u1", "", "firmware", "S1..S5 as 1..5, 0 while booting"),
        Field("stop", "u1", "", "firmware", "reason for S5: 0 none, 1 ramp stop, 2 quick stop, 3 fault"),
        Field("lacks", "u1", "", "firmware", "what the drive lacks, by faults and inputs: LACKS_*"),
        Field("enable_rose", "u1", "", "firmware", "1 = STW1.0 and 3 rose since the drive became ready"),
    ],
)
