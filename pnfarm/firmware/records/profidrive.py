"""Fields of the axis record: profidrive."""

from __future__ import annotations

from pnfarm.table.axis_codes import FAULT_WORDS
from pnfarm.table.layout import Field, subject
from pnfarm.table.signals import SHOWN

__all__ = ["PROFIDRIVE_RECORD"]

PROFIDRIVE_RECORD = subject(
    "profidrive",
    "PROFIdrive's words: the scaling of the telegram's signals, and the control and status words.",
    settings=[
        Field("velocity_step", "f8", "rpm", "parameter", "one increment of NSOLL_A and NIST_A"),
        Field(
            "velocity_step_b",
            "f8",
            "rpm",
            "parameter",
            "one increment of NSOLL_B and NIST_B, 0 = a 65536th of velocity_step",
        ),
        Field("acceleration_step", "f8", "rpm/s", "parameter", "one increment of DRV_ACC and DRV_DEC (PN.ACCSCALING)"),
        Field("torque_step", "f8", "N m", "parameter", "one increment of torque signals, 0 = a 16384th of the peak"),
        Field("target_step", "f8", "rev", "parameter", "one increment of a target position, 0 = travel.position_step"),
        Field("task_velocity_step", "f8", "rpm", "parameter", "one increment of a task's velocity"),
        Field(
            "task_acceleration_step",
            "f8",
            "rpm/s",
            "parameter",
            "one increment of a task's acceleration, 0 = a 16384th of jog.acceleration",
        ),
        Field(
            "task_deceleration_step",
            "f8",
            "rpm/s",
            "parameter",
            "one of a task's deceleration, 0 = a 16384th of jog.deceleration",
        ),
        Field("pulses_enabled", "u2", "", "parameter", "bit of ZSW2 while pulses are enabled, 0 = no such bit"),
        Field("pulses_choice", "u2", "", "parameter", "signal and bit for enabled pulses, STATUS_MOOG (P-0924)", (2,)),
        Field("profile_mode", "u2", "", "parameter", "1 or 3 = status words as in the profile's class 4 (P-1258)"),
        Field("task_active", "u2", "", "parameter", "bit of ZSW1 while a task is active, 0 = no such bit"),
        Field("spare_acceleration", "u2", "", "parameter", "MDI_ACC where the telegram's is 0, 0 = none"),
        Field(
            "control_location",
            "u2",
            "",
            "parameter",
            "who controls the drive; STW1 counts only if equal to bus_location",
        ),
        Field("bus_location", "u2", "", "parameter", "value of control_location that means the controller"),
        Field(
            "reference_source", "u2", "", "parameter", "whose set points count: the controller's if equal to bus_source"
        ),
        Field("bus_source", "u2", "", "parameter", "value of reference_source that means the controller"),
        Field("velocity_signal", "u1", "", "parameter", "which set point the telegram brings: VELOCITY_*"),
        Field("task_form", "u1", "", "parameter", "which signals bring traversing tasks: TASKS_*"),
        Field("status_form", "u1", "", "parameter", "how the status words are used: STATUS_*"),
        Field("task_ramps_scaled", "u1", "", "parameter", "1 = a task's ramps are in units of acceleration_step"),
        Field("task_ramps_signed", "u1", "", "parameter", "1 = MDI_ACC and MDI_DEC have a sign; below 0 is no ramp"),
        Field("task_velocity_unsigned", "u1", "", "parameter", "1 = a task's velocity in the telegram has no sign"),
        Field("home_signals", "u1", "", "parameter", "what the telegram brings: bit 0 HOME_MODE, bit 1 HOME_DIST"),
        Field("jog_signals", "u1", "", "parameter", "bits 0 and 1: the telegram brings jogging set points 1 and 2"),
        Field("torque_signals", "u1", "", "parameter", "bits 0 and 1: the telegram brings torque.shares 1 and 2"),
        Field("feedrate_signal", "u1", "", "parameter", "1 = the telegram brings MT_FEEDRATE, in percent"),
        Field("parameter_channel", "u1", "", "parameter", "1 = the telegram has a parameter channel"),
        Field("without_control", "u1", "", "parameter", "set points without STW1.10: WITHOUT_CONTROL_*"),
        Field("without_run", "u1", "", "parameter", "set points while the controller is in STOP: WITHOUT_RUN_*"),
        Field(
            "acknowledges_by_level", "u1", "", "parameter", "1 = STW1.7 acknowledges while it is set, not with its edge"
        ),
        Field("control_shown", "u1", "", "parameter", "1 = ZSW1.9 shows STW1.10, not that the drive asks for control"),
        Field("speed_error_bit", "u1", "", "parameter", "ZSW1.8 in speed control: SPEED_*"),
        Field("speed_reached_bit", "u1", "", "parameter", "ZSW1.10 in speed control: SPEED_*"),
        Field("following_error_bit", "u1", "", "parameter", "1 = ZSW1.8 in position mode reports a following error"),
        Field("moving_bit", "u1", "", "parameter", "1 = ZSW1.13 means that the axis moves, not that it is at rest"),
        Field("reached_without_task", "u1", "", "parameter", "ZSW1.10 in position mode: REACHED_*"),
        Field(
            "shows",
            "u1",
            "",
            "parameter",
            "what the telegram shows besides actual values: bit 0 received set points, bit 1 stored parameters",
        ),
        Field("shown", "i4", "", "parameter", "raw numbers of the stored parameters that it shows", (SHOWN,)),
        Field("fault_words", "u2", "", "station", "signal FAULT_CODE by fault number", (FAULT_WORDS,)),
    ],
    state=[
        Field(
            "telegram_ns",
            "i8",
            "ns",
            "firmware",
            "when cyclic data was received last, 0 = not yet, or its loss was reported",
        ),
        Field("telegram_frames", "u4", "", "firmware", "image.frames when cyclic data was received last"),
        Field("motion_status", "u4", "", "firmware", "DRV.MOTIONSTAT"),
        Field("generator_speed", "f8", "rpm", "firmware", "speed of the profile generator at the last step"),
        Field("stw1", "u2", "", "firmware", "control word 1 in force (with bit 10 honoured)"),
        Field("stw1_before", "u2", "", "firmware", "control word 1 in force in the last step"),
        Field("stw1_seen", "u2", "", "firmware", "control word 1 as received last, for edges"),
        Field("stw1_changed", "u2", "", "firmware", "bits of the accepted control word 1 that differ from stw1_seen"),
        Field("zsw1", "u2", "", "firmware", "status word 1"),
        Field("image_valid", "u1", "", "firmware", "validity of the set points as the last step saw it"),
        Field("setpoints", "u1", "", "firmware", "what the set points are in this step: SETPOINTS_*"),
        Field("generator", "u1", "", "firmware", "profile generator: 0 at rest, 1 up, 2 constant, 3 down"),
    ],
)
