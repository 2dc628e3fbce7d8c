"""Codes of fields of the axis that are set by readings of open points (``behaviour.toml`` of the models).

The default of each is that of the PROFIdrive profile, or of a drive without a manual.
"""

from __future__ import annotations

# Use of the controller's words without STW1.10, control by PLC (``profidrive.without_control``).
WITHOUT_CONTROL_HOLD = 0  # the words accepted last stay in force
WITHOUT_CONTROL_NOTHING = 1  # as if none were sent
WITHOUT_CONTROL_TAKEN = 2  # they are accepted nevertheless

# Use of them while the controller is in STOP or marks its data as bad (``profidrive.without_run``).
WITHOUT_RUN_NOTHING = 0  # as if none were sent
WITHOUT_RUN_OFF = 1  # as with STW1.0 = 0
WITHOUT_RUN_HOLD = 2  # the words accepted last stay in force

# State of the set points in this step (``profidrive.setpoints``).
SETPOINTS_NONE = 0  # no valid ones are sent
SETPOINTS_HELD = 1  # those accepted last stay in force
SETPOINTS_TAKEN = 2

# Both jog bits at once (``jog.both_bits``).
BOTH_STAND = 0  # standstill
BOTH_FIRST_SPEED = 1  # as STW1.8 alone
BOTH_KEEP = 2  # as the bit that came first, alone

# Bits of ZSW1 that compare a speed (``profidrive.speed_error_bit``, ``profidrive.speed_reached_bit``).
SPEED_ERROR_OF_RAMP = 0  # against the speed after the ramp generator
SPEED_ERROR_OF_SETPOINT = 1  # against the controller's set point
SPEED_REACHED_WINDOW = 0  # within the window around the set point
SPEED_REACHED_OR_EXCEEDED = 1  # or beyond it
SPEED_BIT_ZERO = 2  # both: the bit stays 0

# ZSW1.10 in position mode (``profidrive.reached_without_task``).
REACHED_TARGET = 0  # at the target of the last task
REACHED_NO_MOTION = 1  # whenever no motion is active
REACHED_TASK_ACTIVE = 2  # while a task is active

# Real-time jogging (``jog.real_time``).
REAL_TIME_JOG_FREE = 1  # whatever STW1.4 is
REAL_TIME_JOG_WITH_TASKS = 2  # STW1.4 = 0 rejects it, too
