"""Fields of the axis that readings of open points set (``behaviour.toml`` of the models), and what their numbers mean.

The default of each is what the PROFIdrive profile has, or what a drive of no manual does.
"""

from __future__ import annotations

from pnfarm.table.layout import Field

__all__ = ["READINGS"]

# What becomes of the controller's words without STW1.10, control by PLC (``without_control``).
WITHOUT_CONTROL_HOLD = 0  # the words that were taken over last stay in force
WITHOUT_CONTROL_NOTHING = 1  # as if nobody sent any
WITHOUT_CONTROL_TAKEN = 2  # they are taken over all the same

# What becomes of them while the controller is in STOP or calls its data bad (``without_run``).
WITHOUT_RUN_NOTHING = 0  # as if nobody sent any
WITHOUT_RUN_OFF = 1  # as with STW1.0 = 0
WITHOUT_RUN_HOLD = 2  # the words that were taken over last stay in force

# What a frame's set points are in this step (``setpoints``).
SETPOINTS_NONE = 0  # nobody sends any that count
SETPOINTS_HELD = 1  # those that were taken over last stay in force
SETPOINTS_TAKEN = 2

# Both jog bits at once (``both_jog_bits``).
BOTH_STAND = 0  # standstill
BOTH_FIRST_SPEED = 1  # as STW1.8 alone
BOTH_KEEP = 2  # as the one that came first, alone

# Bits of ZSW1 that compare a speed (``speed_error_bit``, ``speed_reached_bit``).
SPEED_ERROR_OF_RAMP = 0  # against the speed behind the ramp generator
SPEED_ERROR_OF_SETPOINT = 1  # against the controller's set point
SPEED_REACHED_WINDOW = 0  # within the window around the set point
SPEED_REACHED_OR_EXCEEDED = 1  # or beyond it
SPEED_BIT_ZERO = 2  # both: the bit stays 0

# ZSW1.10 in position mode (``reached_without_task``).
REACHED_TARGET = 0  # in the target of the last task
REACHED_NO_MOTION = 1  # whenever no motion is active
REACHED_TASK_ACTIVE = 2  # while a task is active

# Real-time jogging (``real_time_jog``).
REAL_TIME_JOG_FREE = 1  # whatever STW1.4 is
REAL_TIME_JOG_WITH_TASKS = 2  # STW1.4 = 0 rejects it, too

READINGS = [
    Field("without_control", "u1", "", "parameter", "set points without STW1.10: WITHOUT_CONTROL_*"),
    Field("without_run", "u1", "", "parameter", "set points while the controller is in STOP: WITHOUT_RUN_*"),
    Field("setpoints", "u1", "", "firmware", "what the set points are in this step: SETPOINTS_*"),
    Field("acknowledges_by_level", "u1", "", "parameter", "1 = STW1.7 acknowledges while it is set, not with its edge"),
    Field("control_shown", "u1", "", "parameter", "1 = ZSW1.9 shows STW1.10, not that the drive asks for control"),
    Field("on_by_enable", "u1", "", "parameter", "1 = STW1.3 leads to S3 as STW1.0 does; both lead to S4"),
    Field("off_at_once", "u1", "", "parameter", "1 = STW1.0 = 0 in operation switches off without a ramp"),
    Field("life_isochronous", "u1", "", "parameter", "1 = the controller's sign of life is not watched without IRT"),
    Field("both_jog_bits", "u1", "", "parameter", "what both jog bits at once ask for: BOTH_*"),
    Field("jog_bits", "u1", "", "firmware", "STW1.8 and 9 as they count, bits 0 and 1"),
    Field("jog_first", "u1", "", "firmware", "the one of them that came first, 0 = none"),
    Field("jog_begun_lasts", "u1", "", "parameter", "1 = STW1.4 to 6 = 0 is asked for when a jog begins only"),
    Field("jog_needs_its_bit", "u1", "", "parameter", "1 = JOG_SEQUENCES: a jog ends with the bit that began it"),
    Field("ramp_off_at_once", "u1", "", "parameter", "1 = STW1.4 = 0 makes the set point zero at once, not by a ramp"),
    Field("speed_error_bit", "u1", "", "parameter", "ZSW1.8 in speed control: SPEED_*"),
    Field("speed_reached_bit", "u1", "", "parameter", "ZSW1.10 in speed control: SPEED_*"),
    Field("following_error_bit", "u1", "", "parameter", "1 = ZSW1.8 in position mode tells a following error"),
    Field("moving_bit", "u1", "", "parameter", "1 = ZSW1.13 tells that the axis moves, not that it stands"),
    Field("relative_base", "u1", "", "parameter", "what a way of the telegram counts from: TASK_FROM_*, or 0"),
    Field(
        "resume_first", "u1", "", "parameter", "1 = the task that waits goes before one whose edge comes with STW1.5"
    ),
    Field("mdi_rejects", "u1", "", "parameter", "1 = a task of MDI ends when MDI is deselected"),
    Field("feedrate_whole", "f8", "", "parameter", "MT_FEEDRATE of 100 %", default=100.0),
    Field("interpolation_by_edge", "u1", "", "parameter", "1 = interpolation begins with the edge of STW1.6"),
    Field("history_lost", "u1", "", "parameter", "1 = the fault buffer is empty after power on"),
    Field("home_stays", "u1", "", "parameter", "1 = the home position outlasts a power cycle"),
]
