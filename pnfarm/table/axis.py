"""The axis: one row per virtual drive (one drive object with one motor).

States and faults as numbers:

* ``state``: 1..5 for S1..S5 of the PROFIdrive general state machine, 0 while the drive boots.
* fault numbers are the manual's own (AKD: 702 ...); 0 means none;
* names with a star are the constants in :mod:`pnfarm.table.axis_codes` and :mod:`pnfarm.table.axis_readings`.
"""

from __future__ import annotations

from math import inf

from pnfarm.table.axis_readings import READINGS
from pnfarm.table.layout import Field, Layout
from pnfarm.table.signals import SHOWN

__all__ = ["AXIS", "COMMANDS", "FAULT_ACTIONS", "FAULT_SITUATIONS", "FAULT_SLOTS", "FAULT_WORDS", "WARNING_SLOTS"]

#: Faults of one situation, and situations kept (AKD PROFINET manual 5.14: eight of eight).
FAULT_SLOTS = 8
WARNING_SLOTS = 8
FAULT_SITUATIONS = 8
#: Faults that a parameter each may keep from being raised (AKD PROFINET manual 5.6: FAULT130.ACTION and seven more).
FAULT_ACTIONS = 8
#: Fault numbers whose word in the signal FAULT_CODE is the manual's own: 0 to 127.
FAULT_WORDS = 128
#: Pieces of the jerk time.
JERK_TAPS = 16
#: Entries of the command ring from the event loop to the firmware.
COMMANDS = 16

#: Driving sets of a drive (Moog MSD manual 8.2.1), numbered from 0.
DRIVING_SETS = 16

#: Motion tasks that a drive keeps, numbered from 0.
MOTION_TASKS = 129

#: Cams that the machine can have, and digital inputs of a drive whose use is a parameter.
CAMS = 4
USED_INPUTS = 7

AXIS = Layout(
    "axis",
    "One virtual drive: what it was configured with, what its firmware computes, what its motor does.",
    [
        # set up
        Field("firmware", "u1", "", "station", "firmware variant, 0 = row unused"),
        Field("powered", "u1", "", "station", "1 while the control supply is on"),
        Field("step_ns", "i8", "ns", "station", "longest time between two firmware steps"),
        Field("inertia", "f8", "kg m^2", "station", "motor and load"),
        Field("friction", "f8", "N m", "station", "dry friction, opposes motion"),
        Field("damping", "f8", "N m s/rad", "station", "viscous friction"),
        Field("load_torque", "f8", "N m", "station", "torque that the machine puts on the shaft"),
        Field("torque_constant", "f8", "N m/A", "station", "torque per ampere"),
        Field("peak_current", "f8", "A", "station", "DRV.IPEAK: 100 % of the current signals"),
        Field(
            "velocity_time_constant",
            "f8",
            "s",
            "station",
            "closed velocity loop that the controller is tuned for",
        ),
        Field("max_velocity", "f8", "rpm", "station", "limit of the velocity command"),
        Field("brake_damping", "f8", "N m s/rad", "station", "dynamic brake of a power stage that is off, 0 = none"),
        Field("fault_words", "u2", "", "station", "signal FAULT_CODE by fault number", (FAULT_WORDS,)),
        # parameters that the firmware reads
        Field("opmode", "u1", "", "parameter", "0 torque, 1 velocity, 2 position (DRV.OPMODE)"),
        Field("velocity_step", "f8", "rpm", "parameter", "one increment of NSOLL_A and NIST_A"),
        Field(
            "velocity_step_b",
            "f8",
            "rpm",
            "parameter",
            "one increment of NSOLL_B and NIST_B, 0 = a 65536th of velocity_step",
        ),
        Field("velocity_signal", "u1", "", "parameter", "which set point the telegram brings: VELOCITY_*"),
        Field("ramp_generator", "u1", "", "parameter", "what becomes of velocity set points: RAMP_*"),
        Field("acceleration", "f8", "rpm/s", "parameter", "ramp up (DRV.ACC)"),
        Field("deceleration", "f8", "rpm/s", "parameter", "ramp down (DRV.DEC)"),
        Field("acceleration_step", "f8", "rpm/s", "parameter", "one increment of DRV_ACC and DRV_DEC (PN.ACCSCALING)"),
        Field("quick_stop_deceleration", "f8", "rpm/s", "parameter", "quick stop ramp (CS.DEC)"),
        Field("velocity_window", "f8", "rpm", "parameter", "ZSW1.8 and ZSW1.10: how near is on target"),
        Field("standstill", "f8", "rpm", "parameter", "below this the axis stands (CS.VTHRESH)"),
        Field("position_step", "f8", "rev", "parameter", "one increment of the position signals"),
        Field(
            "loss_fault",
            "u4",
            "",
            "parameter",
            "fault raised when cyclic data is lost (number | reaction << 24), 0 = none",
        ),
        Field(
            "stop_fault", "u4", "", "parameter", "fault raised when the controller goes to STOP, coded alike, 0 = none"
        ),
        Field(
            "loss_delay_ns",
            "i8",
            "ns",
            "parameter",
            "how long cyclic data may stay away before loss_fault; 0 = no time",
        ),
        Field("fault_places", "u1", "", "parameter", "faults that the buffer keeps of a situation, 0 = FAULT_SLOTS"),
        Field(
            "fault_stays",
            "u1",
            "",
            "parameter",
            "1 = the buffer begins with the newest situation, 0 = with the active one",
        ),
        Field(
            "ignored_faults", "u4", "", "parameter", "numbers of faults that are not raised, 0 = none", (FAULT_ACTIONS,)
        ),
        Field("jog_velocity", "f8", "rpm", "parameter", "jogging set points 1 and 2 (PNU 1004, 1005)", (2,)),
        Field("jog_acceleration", "f8", "rpm/s", "parameter", "PNU 1006; 0 = as acceleration"),
        Field("jog_deceleration", "f8", "rpm/s", "parameter", "PNU 1007; 0 = as deceleration"),
        Field("velocity_limit", "f8", "rpm", "parameter", "limit of the velocity command beside the motor's, 0 = none"),
        Field("sensor_step", "f8", "rev", "parameter", "one increment of G1_XIST1, 0 = no such signal"),
        Field("sensor_step_2", "f8", "rev", "parameter", "one increment of G1_XIST2, 0 = no such signal"),
        Field("coast_method", "u1", "", "parameter", "dynamic brake: 0 always, 1 until standstill, 2 never"),
        Field("life", "u1", "", "parameter", "1 = sign of life in STW2 and ZSW2"),
        Field("life_tolerance", "u2", "", "parameter", "failed signs of life that are too many (PNU 925), 65535 = all"),
        Field("life_fault", "u4", "", "parameter", "fault raised then (number | reaction << 24), 0 = none"),
        Field("pulses_enabled", "u2", "", "parameter", "bit of ZSW2 while pulses are enabled, 0 = no such bit"),
        Field("command", "i8", "", "station", "ring of commands to the firmware", (COMMANDS,)),
        Field("command_head", "u4", "", "station", "commands written so far"),
        Field("command_tail", "u4", "", "firmware", "commands taken so far"),
        # state of the firmware
        Field("last_ns", "i8", "ns", "firmware", "time of the last step"),
        Field("state", "u1", "", "firmware", "S1..S5 as 1..5, 0 while booting"),
        Field("stop", "u1", "", "firmware", "why S5 stops: 0 not, 1 ramp stop, 2 quick stop, 3 fault"),
        Field("zsw1", "u2", "", "firmware", "status word 1"),
        Field("stw1", "u2", "", "firmware", "control word 1 in force (with bit 10 honoured)"),
        Field("stw1_seen", "u2", "", "firmware", "control word 1 as it came in last, for edges"),
        Field("stw1_changed", "u2", "", "firmware", "bits that differ from that in the word that is taken over now"),
        Field("ramp_up", "f8", "rpm/s", "firmware", "acceleration in force: DRV_ACC of the telegram, or DRV.ACC"),
        Field("ramp_down", "f8", "rpm/s", "firmware", "deceleration in force: DRV_DEC of the telegram, or DRV.DEC"),
        Field("setpoint", "f8", "rpm", "firmware", "velocity that the controller asks for"),
        Field("ramp", "f8", "rpm", "firmware", "velocity command behind the ramp generator (VL.CMD)"),
        Field("fault_code", "u4", "", "firmware", "active faults, oldest first, 0 = none", (FAULT_SLOTS,)),
        Field("fault_held", "u4", "", "firmware", "faults whose cause is there, with reaction", (FAULT_SLOTS,)),
        Field(
            "fault_buffer", "u4", "", "firmware", "PNU 947: situations, newest first", (FAULT_SLOTS * FAULT_SITUATIONS,)
        ),
        Field("fault_counter", "u4", "", "firmware", "PNU 944: situations since power-on"),
        Field("fault_kept", "u2", "", "firmware", "situations that the fault buffer held at power-on"),
        Field("fault_changes", "u2", "", "firmware", "changes of the fault buffer since power-on"),
        Field("fault_ends", "u2", "", "firmware", "situations that ended"),
        Field("boot_ns", "i8", "ns", "firmware", "when the drive was switched on"),
        Field("boot_time_ns", "i8", "ns", "station", "from then to S1"),
        Field(
            "telegram_ns", "i8", "ns", "firmware", "when cyclic data was there last, 0 = not yet, or its loss was told"
        ),
        Field("image_valid", "u1", "", "firmware", "validity of the set points as the last step saw it"),
        Field("fault_ns", "i8", "ns", "firmware", "when the active situation began, 0 = none"),
        Field("reacted", "u1", "", "firmware", "1 once the controller withdrew the enable after a fault"),
        Field("warning_code", "u4", "", "firmware", "the first of warnings, 0 = none"),
        Field(
            "warnings", "u4", "", "firmware", "active warnings: raised ones, then its own; 0 = none", (WARNING_SLOTS,)
        ),
        Field("warning_raised", "u4", "", "firmware", "warnings by command, newest first, 0 = none", (WARNING_SLOTS,)),
        # sign of life
        Field("life_frames", "u4", "", "firmware", "set point frames seen so far"),
        Field("life_seen", "u1", "", "firmware", "the controller's last count, 0 = none"),
        Field("life_run", "u1", "", "firmware", "frames in sequence, 15 = the controller is watched"),
        Field("life_sent", "u1", "", "firmware", "the drive's own count, 1..15, 0 = none yet"),
        Field("life_count", "u4", "", "firmware", "error counter: 10 up on a failure, 1 down on a good frame"),
        Field("life_failed", "u1", "", "firmware", "too many failed: LIFE_*"),
        Field("life_errors", "i8", "", "firmware", "failed signs of life"),
        # the motor
        Field("velocity", "f8", "rpm", "firmware", "shaft speed (VL.FB)"),
        Field("position", "f8", "rev", "firmware", "shaft position since power-on (PL.FB)"),
        Field("current", "f8", "A", "firmware", "torque-building current (IL.FB)"),
        Field("torque", "f8", "N m", "firmware", "motor torque"),
        Field("following_error", "f8", "rev", "firmware", "commanded minus actual position (PL.ERR)"),
        Field("commanded_position", "f8", "rev", "firmware", "integral of the velocity command while enabled (PL.CMD)"),
        Field("motion_status", "u4", "", "firmware", "DRV.MOTIONSTAT"),
        # positioning: set up
        Field("jog_mirrored", "u1", "", "parameter", "1 = the second jogging velocity is the first one, backwards"),
        Field(
            "position_stop_deceleration",
            "f8",
            "rpm/s",
            "parameter",
            "quick stop ramp in position mode, 0 = as quick_stop_deceleration",
        ),
        Field("task_form", "u1", "", "parameter", "which signals bring traversing tasks: TASKS_*"),
        Field("target_step", "f8", "rev", "parameter", "one increment of a target position, 0 = position_step"),
        Field("task_velocity_step", "f8", "rpm", "parameter", "one increment of a task's velocity"),
        Field(
            "task_acceleration_step",
            "f8",
            "rpm/s",
            "parameter",
            "one increment of a task's acceleration, 0 = a 16384th of jog_acceleration",
        ),
        Field(
            "task_deceleration_step", "f8", "rpm/s", "parameter", "one increment of a task's deceleration, 0 = alike"
        ),
        Field("control_config", "u2", "", "parameter", "how STW1 is read in position mode: CONFIG_*"),
        Field("task_active", "u2", "", "parameter", "bit of ZSW1 while a task is active, 0 = no such bit"),
        Field("task_ramps_scaled", "u1", "", "parameter", "1 = a task's ramps count in acceleration_step"),
        Field("spare_acceleration", "u2", "", "parameter", "MDI_ACC where the telegram's is 0, 0 = none"),
        Field("task_velocity_unsigned", "u1", "", "parameter", "1 = a task's velocity in the telegram has no sign"),
        Field(
            "real_time_jog", "u1", "", "parameter", "STW1.12 jogs with the data of the task: REAL_TIME_JOG_*, 0 = not"
        ),
        Field("home_required", "u1", "", "parameter", "1 = tasks need the home position"),
        Field("home_method", "u1", "", "parameter", "how the axis finds its home: HOME_*, and homing"),
        Field("home_velocity", "f8", "rpm", "parameter", "of homing"),
        Field("home_acceleration", "f8", "rpm/s", "parameter", "of homing"),
        Field("home_deceleration", "f8", "rpm/s", "parameter", "of homing"),
        Field("home_direction", "f8", "", "parameter", "of homing: above 0 forwards"),
        Field("home_position", "f8", "rev", "parameter", "position that the mark gets"),
        Field("home_distance", "f8", "rev", "parameter", "way from the mark to where homing ends"),
        Field("home_share", "f8", "", "parameter", "part of home_velocity for what follows the search", (), 1.0),
        Field("home_current", "f8", "A", "parameter", "limit while homing looks for an end stop, 0 = none"),
        Field("home_lag", "f8", "rev", "parameter", "following error that tells an end stop, 0 = none does"),
        Field("home_farthest", "f8", "rev", "parameter", "longest search of homing, 0 = no bound"),
        Field(
            "input_modes",
            "u2",
            "",
            "parameter",
            "use of the first digital inputs: INPUT_*",
            (USED_INPUTS,),
        ),
        Field("input_inverted", "u1", "", "parameter", "1 = such an input is used upside down", (USED_INPUTS,)),
        Field(
            "software_limits", "u1", "", "parameter", "limits that count, once the axis is homed: bit 0 low, bit 1 high"
        ),
        Field("home_signals", "u1", "", "parameter", "what the telegram brings: bit 0 HOME_MODE, bit 1 HOME_DIST"),
        Field("limit_low", "f8", "rev", "parameter", "lowest position"),
        Field("limit_high", "f8", "rev", "parameter", "highest position"),
        Field("fault_limits", "u1", "", "fault", "limit switches that faults press: bit 0 low, bit 1 high"),
        Field("limit_switch", "u1", "", "firmware", "limit switches that are reached, alike"),
        Field("position_gain", "f8", "1/s", "parameter", "proportional position controller"),
        Field("following_window", "f8", "rev", "parameter", "ZSW1.8 in position mode"),
        Field("following_limit", "f8", "rev", "parameter", "following error that is a fault, 0 = none"),
        Field("following_fault", "u4", "", "parameter", "that fault, number | reaction << 24"),
        Field("target_window", "f8", "rev", "parameter", "ZSW1.10 in position mode"),
        # positioning: what is asked for, and what becomes of it
        Field("asked", "u1", "", "firmware", "1 in the step that sees a task begin"),
        Field("pos_stw2", "u2", "", "firmware", "POS_STW2 of the last step, for edges"),
        Field("asked_task", "i2", "", "firmware", "number of the motion task, TASK_MDI = the data are the telegram's"),
        Field("task", "i2", "", "firmware", "the running one, alike"),
        Field("task_command", "u2", "", "firmware", "motion task that a command starts, plus 1; 0 = none"),
        Field("home_command", "u1", "", "firmware", "1 = a command starts homing"),
        Field("over_ns", "i8", "ns", "firmware", "since when a chained task waits for its dwell, 0 = it runs"),
        Field("asked_home_method", "u2", "", "firmware", "how homing goes: of the telegram, or home_method"),
        Field("asked_home_distance", "f8", "rev", "firmware", "alike, or home_distance"),
        Field("home_brought", "u1", "", "firmware", "which of these are of the telegram, as home_signals"),
        Field("home_switch", "u1", "", "firmware", "1 = a digital input that is used as home switch is on"),
        Field("home_way", "f8", "", "firmware", "direction of the search, 1 forwards, -1 backwards"),
        Field("home_start", "f8", "rev", "firmware", "where homing began"),
        Field("home_held", "f8", "A", "firmware", "current limit of homing at this moment, 0 = none"),
        Field("mdi", "u1", "", "firmware", "1 = the controller brings the task's data itself"),
        Field("asked_position", "f8", "rev", "firmware", "target, or way"),
        Field("asked_relative", "u1", "", "firmware", "1 = a way"),
        Field("asked_velocity", "f8", "rpm", "firmware", "of the task"),
        Field("asked_acceleration", "f8", "rpm/s", "firmware", "of the task"),
        Field("asked_deceleration", "f8", "rpm/s", "firmware", "of the task"),
        Field("asked_backwards", "u1", "", "firmware", "direction of real-time jogging"),
        Field("override", "f8", "", "firmware", "velocity override, 1 = 100 %"),
        Field("jog", "u1", "", "firmware", "jogging that is asked for: JOG_*"),
        Field("motion", "u1", "", "firmware", "state of positioning, see firmware/positioning.py; 0 = none"),
        Field("motion_seen", "u2", "", "firmware", "STW1 of the last step, for edges"),
        Field("acknowledged", "u1", "", "firmware", "ZSW1.12"),
        Field("homed", "u1", "", "firmware", "1 = the home position is known"),
        Field("home_leg", "u1", "", "firmware", "part of homing that goes on, as numbered there"),
        Field("origin", "f8", "rev", "firmware", "where position 0 of the machine lies on the shaft"),
        Field("target_reached", "u1", "", "firmware", "the last task ended in its target"),
        # the profile of positioning
        Field("profile", "u1", "", "firmware", "what the profile generator is about: PROFILE_*"),
        Field("target", "f8", "rev", "firmware", "where PROFILE_TARGET leads to"),
        Field("task_top", "f8", "rpm", "firmware", "velocity of the task at hand at an override of 100 %"),
        Field("task_velocity", "f8", "rpm", "firmware", "of the task at hand, override taken into account"),
        Field("task_acceleration", "f8", "rpm/s", "firmware", "of the task at hand"),
        Field("task_deceleration", "f8", "rpm/s", "firmware", "of the task at hand"),
        Field("profile_velocity", "f8", "rpm", "firmware", "of commanded_position while a profile moves it"),
        Field("raw_position", "f8", "rev", "firmware", "the trapezoid, before the jerk time"),
        Field("raw_velocity", "f8", "rev/s", "firmware", "the trapezoid's velocity"),
        Field("jerk_time", "f8", "s", "parameter", "how long the trapezoid is averaged, 0 = not at all"),
        Field("jerk_ring", "f8", "rev/s", "firmware", "its last mean velocities, tap by tap", (JERK_TAPS,)),
        Field("jerk_next", "u1", "", "firmware", "the oldest of these"),
        Field("jerk_end", "f8", "rev/s", "firmware", "their mean: the velocity at the end of the tap at hand"),
        Field("jerk_left", "f8", "s", "firmware", "what is left of that tap"),
        # control of speed and current, DC link, motor and load: set up
        Field("motor_step_ns", "i8", "ns", "station", "longest step of controllers and motor, 0 = 1 ms"),
        Field("speed_gain", "f8", "N m s/rad", "parameter", "speed controller, 0 = inertia / velocity_time_constant"),
        Field("speed_integral_time", "f8", "s", "parameter", "speed controller, 0 = four times velocity_time_constant"),
        Field(
            "speed_feed_forward", "f8", "", "parameter", "part of a profile's speed that is fed forward", default=1.0
        ),
        Field(
            "acceleration_gain",
            "f8",
            "",
            "parameter",
            "torque feed-forward of profiles, 1 = all that inertia asks",
        ),
        Field("current_time_constant", "f8", "s", "station", "closed current loop, first order, 0 = at once"),
        Field("winding_resistance", "f8", "ohm", "station", "of one phase"),
        Field("winding_inductance", "f8", "H", "station", "of one phase"),
        Field("bus_nominal", "f8", "V", "station", "DC link as the mains hold it, 0 = voltage limits nothing"),
        Field("bus_capacitance", "f8", "F", "station", "of the DC link, 0 = its voltage is constant"),
        Field("bus_load", "f8", "W", "station", "what the drive itself takes from the DC link"),
        Field("bus_brake", "f8", "V", "station", "where the braking resistor holds the DC link, 0 = there is none"),
        Field("bus_limit", "f8", "V", "station", "DC link voltage that is a fault, 0 = none"),
        Field("overvoltage_fault", "u4", "", "parameter", "that fault, number | reaction << 24, 0 = none"),
        Field("continuous_current", "f8", "A", "station", "current that the motor bears for ever, 0 = any"),
        Field("thermal_time", "f8", "s", "station", "thermal time constant of the motor, 0 = it stays cool"),
        Field("overload_fault", "u4", "", "parameter", "fault of a motor that is too hot, coded alike, 0 = none"),
        Field("overspeed", "f8", "rpm", "parameter", "shaft speed that is a fault, 0 = none"),
        Field("overspeed_fault", "u4", "", "parameter", "that fault, coded alike, 0 = none"),
        Field("encoder_steps", "f8", "1/rev", "station", "increments of the encoder, 0 = infinitely many"),
        Field("holding_brake", "f8", "N m", "station", "torque of the holding brake, 0 = there is none"),
        Field("brake_release", "f8", "s", "station", "until the holding brake is open"),
        Field("brake_apply", "f8", "s", "station", "until the holding brake holds"),
        Field("added_inertia", "f8", "kg m^2", "fault", "beside what the drive was tuned for"),
        Field("added_friction", "f8", "N m", "fault", "dry friction beside that of the machine"),
        Field("added_torque", "f8", "N m", "fault", "torque on the shaft beside load_torque"),
        # and what becomes of it
        Field("speed_integral", "f8", "N m", "firmware", "integral part of the speed controller"),
        Field("fed_speed", "f8", "rpm", "firmware", "speed set point of the last step, for the feed-forward"),
        Field("measured_position", "f8", "rev", "firmware", "shaft position as the encoder tells it"),
        Field("encoder_low", "f8", "rev", "firmware", "slow part of the encoder's error"),
        Field("bus_voltage", "f8", "V", "firmware", "DC link (VBUS.VALUE)"),
        Field("thermal_load", "f8", "", "firmware", "the motor's heat, 1 = as much as it bears (I2t)"),
        Field("brake_asked", "u1", "", "firmware", "1 = the holding brake is told to open"),
        Field("brake_open", "u1", "", "firmware", "1 = the holding brake is open"),
        Field("brake_left", "f8", "s", "firmware", "until it is as it is told"),
        # motion tasks, by number; last, because few drives use them
        Field("mt_position", "f8", "rev", "parameter", "target, or way", (MOTION_TASKS,)),
        Field("mt_velocity", "f8", "rpm", "parameter", "of each task", (MOTION_TASKS,)),
        Field("mt_acceleration", "f8", "rpm/s", "parameter", "of each task", (MOTION_TASKS,)),
        Field("mt_deceleration", "f8", "rpm/s", "parameter", "of each task", (MOTION_TASKS,)),
        Field("mt_dwell_ns", "i8", "ns", "parameter", "before the next one begins", (MOTION_TASKS,)),
        Field("mt_flags", "u1", "", "parameter", "what each task is: TASK_*", (MOTION_TASKS,)),
        Field("mt_next", "u1", "", "parameter", "the next one of a chained task", (MOTION_TASKS,)),
        # torque limits by parameters, beside the motor's peak current
        Field("rated_torque", "f8", "N m", "station", "100 % of the torque limits, 0 = the model has none"),
        Field("torque_limit_positive", "f8", "N m", "parameter", "most torque forwards, inf = no limit", default=inf),
        Field("torque_limit_negative", "f8", "N m", "parameter", "most torque backwards, alike", default=inf),
        # of the telegram's words
        Field("message_warnings", "u4", "", "station", "warnings that MELDW.6 and 7 tell of, 0 = none", (2,)),
        Field("task_ramps_signed", "u1", "", "parameter", "1 = MDI_ACC and MDI_DEC have a sign; below 0 is no ramp"),
        Field("brake_released", "u1", "", "firmware", "1 = the axis came to rest since its power stage went off"),
        # departures from the profile's state machine and words
        Field("hindrances", "u1", "", "fault", "what the drive lacks: LACKS_*"),
        Field("status_form", "u1", "", "parameter", "how the status words are used: STATUS_*"),
        Field("profile_mode", "u2", "", "parameter", "1 or 3 = status words as in the profile's class 4 (P-1258)"),
        Field("pulses_choice", "u2", "", "parameter", "signal and bit for enabled pulses, STATUS_MOOG (P-0924)", (2,)),
        Field("ready_with_on", "u1", "", "parameter", "1 = S1 is left with STW1.0 set, too"),
        Field("enable_by_edge", "u1", "", "parameter", "1 = S3 is left when STW1.0 and 3 rise, not while they are set"),
        Field("enable_acknowledges", "u1", "", "parameter", "1 = the hardware enable acknowledges when it comes"),
        Field("quick_stop_option", "u1", "", "parameter", "what a quick stop does: QUICK_STOP_*"),
        Field("control_location", "u2", "", "parameter", "who controls the drive; only bus_location hears STW1"),
        Field("bus_location", "u2", "", "parameter", "the controller as control_location"),
        Field("reference_source", "u2", "", "parameter", "whose set points count; the controller's with bus_source"),
        Field("bus_source", "u2", "", "parameter", "the controller as reference_source"),
        Field("lacked", "u1", "", "firmware", "what the drive lacks, by faults and inputs: LACKS_*"),
        Field("stop_input", "u1", "", "firmware", "1 = an input that is used for controlled stops is on"),
        Field("enable_rose", "u1", "", "firmware", "1 = STW1.0 and 3 rose since the drive got ready"),
        Field("generator", "u1", "", "firmware", "profile generator: 0 at rest, 1 up, 2 constant, 3 down"),
        Field("generator_speed", "f8", "rpm", "firmware", "its speed at the last step"),
        Field("home_by_edge", "u1", "", "parameter", "1 = homing begins with the edge of STW1.11, not while it is set"),
        # jogging by sequences
        Field("jog_form", "u1", "", "parameter", "which word jogging follows: JOG_*"),
        Field("jog_sequence", "u1", "", "firmware", "state of jogging, 0 = none; firmware/jog.py"),
        Field("jog_signals", "u1", "", "parameter", "bits 0 and 1: the telegram brings jogging set points 1 and 2"),
        Field("jog_asked", "f8", "rpm", "firmware", "jogging set points as they count", (2,)),
        Field("jog_speed", "f8", "rpm", "firmware", "of the jog at hand"),
        # driving sets and tasks without an end
        Field("set_position", "f8", "", "parameter", "target or way of each set, in position steps", (DRIVING_SETS,)),
        Field("asked_endless", "u1", "", "firmware", "1 = the task asked for has no target"),
        Field("asked_still", "u1", "", "firmware", "1 = its velocity may be 0"),
        Field("task_new", "u1", "", "firmware", "1 = a change that takes no handshake (STW1.13) has yet to begin"),
        Field("feed_free", "u1", "", "firmware", "1 = STW1.5 means nothing"),
        Field("task_endless", "u1", "", "firmware", "1 = the task at hand runs at its velocity until it is ended"),
        # set points of each cycle: positions (class 5) and dynamic servo control (class 4)
        Field("task_backwards", "u1", "", "firmware", "1 = and it runs backwards"),
        Field("servo_control", "u1", "", "parameter", "1 = the telegram brings XERR and KPC"),
        # parts of the most torque, as parameters or the telegram have them at the moment
        Field("torque_scale", "f8", "", "parameter", "part of the peak torque that is allowed", default=1.0),
        Field("torque_shares", "f8", "", "parameter", "part of that forwards and backwards", (2,), default=1.0),
        Field("torque_signals", "u1", "", "parameter", "bits 0 and 1: the telegram brings these parts instead"),
        Field("torque_asked", "f8", "", "firmware", "these parts as they count", (2,), default=1.0),
        Field("speed_override", "f8", "", "parameter", "part of every speed that is asked for", default=1.0),
        Field("frames_taken", "u4", "", "firmware", "set point frames that interpolation or servo control has taken"),
        Field("frames_ns", "i8", "ns", "firmware", "when it took the last one, 0 = none yet"),
        Field("cyclic_start", "f8", "rev", "firmware", "where the curve at hand begins"),
        Field("cyclic_speed", "f8", "rev/s", "firmware", "velocity there"),
        Field("cyclic_end", "f8", "rev", "firmware", "where it ends: the last set point"),
        Field("cyclic_end_speed", "f8", "rev/s", "firmware", "velocity there"),
        Field("cyclic_time", "f8", "s", "firmware", "how long it takes"),
        Field("cyclic_elapsed", "f8", "s", "firmware", "how much of that is over"),
        Field("frames_told", "u4", "", "firmware", "actual value frames seen to leave"),
        Field("servo_shown", "f8", "rev", "firmware", "position in the last one that left"),
        Field("servo_target", "f8", "rev", "firmware", "where dynamic servo control leads to"),
        Field("servo_gain", "f8", "1/s", "firmware", "KPC, 0 = NSOLL_B alone"),
        # sensor interface of encoder 1
        Field("sensor_bits", "u2", "", "parameter", "bits of G1_STW that mean something, 0 = no sensor interface"),
        Field("sensor_refused", "u2", "", "parameter", "those of them that ask for what the drive does not have"),
        Field("sensor_status_bits", "u2", "", "parameter", "bits of G1_ZSW that mean something"),
        Field("sensor_shows", "u1", "", "parameter", "1 = G1_XIST2 is the position while nothing else is asked for"),
        Field(
            "sensor_marks",
            "u1",
            "",
            "parameter",
            "places 0..3: where functions 1 to 4 find their mark, MARK_*; 4..7: its edge, EDGE_*; 8..11: nothing",
            (12,),
        ),
        Field("probe_inputs", "u4", "", "parameter", "bit of digital_inputs that is probe 1 or 2, 0 = none", (2,)),
        Field("probe_mode", "u2", "", "parameter", "0 = the probes measure"),
        Field("sensor_fault", "u4", "", "parameter", "the encoder's fault, number | reaction << 24, 0 = none"),
        Field("fault_inputs", "u4", "", "fault", "digital inputs that faults put on, bit by bit"),
        Field("digital_inputs", "u4", "", "firmware", "levels of the drive's digital inputs, bit by bit"),
        # the machine
        Field("machine", "u1", "", "station", "which parts it has: MACHINE_*"),
        Field("switch_low", "f8", "rev", "station", "the low limit switch is pressed from here downwards"),
        Field("switch_high", "f8", "rev", "station", "the high limit switch is pressed from here upwards"),
        Field("stop_low", "f8", "rev", "station", "end stop: the shaft turns no further"),
        Field("stop_high", "f8", "rev", "station", "end stop: the shaft turns no further"),
        Field("cam_inputs", "u4", "", "station", "bit of digital_inputs that a cam puts on, 0 = no such cam", (CAMS,)),
        Field("cam_low", "f8", "rev", "station", "where a cam begins", (CAMS,)),
        Field("cam_high", "f8", "rev", "station", "where a cam ends", (CAMS,)),
        Field("switch_warnings", "u4", "", "station", "warning at the low and the high limit switch, 0 = none", (2,)),
        Field("sensor_state", "u1", "", "firmware", "SD1 to SD12 as 1..12, 0 = not yet; firmware/sensor_interface.py"),
        Field("sensor_stw", "u2", "", "firmware", "G1_STW in force, without bits that mean nothing"),
        Field("sensor_error", "u2", "", "firmware", "code of the sensor error, 0 = none"),
        Field("sensor_active", "u1", "", "firmware", "functions that wait for their mark or edge: G1_ZSW.0 to 3"),
        Field("sensor_found", "u1", "", "firmware", "functions whose value is there: G1_ZSW.4 to 7"),
        Field("sensor_probing", "u1", "", "firmware", "1 = what is active or found are measurements on the fly"),
        Field("sensor_read", "u1", "", "firmware", "function whose value is read, 1 to 4"),
        Field("sensor_value", "f8", "rev", "firmware", "position at each function's mark or edge", (4,)),
        Field("sensor_position", "f8", "rev", "firmware", "shaft position at the last step"),
        Field("sensor_inputs", "u4", "", "firmware", "digital_inputs at the last step"),
        Field("sensor_faulty", "u1", "", "firmware", "1 = the encoder's fault was there at the last step"),
        # cyclic words beside set points and actual values
        Field("parameter_channel", "u1", "", "parameter", "1 = the telegram has a parameter channel"),
        Field(
            "shows",
            "u1",
            "",
            "parameter",
            "what the telegram shows beside actual values: bit 0 set points as they came, bit 1 stored parameters",
        ),
        Field("shown", "i4", "", "parameter", "raw numbers of the stored parameters that it shows", (SHOWN,)),
        # foldback of motor and drive, in this order, and the DC link's levels
        Field("foldback_delay", "f8", "s", "station", "how long the peak current is there, then its limit falls", (2,)),
        Field("foldback_time", "f8", "s", "station", "time constant with which it falls, 0 = it does not", (2,)),
        Field("foldback_fault_level", "f8", "A", "parameter", "limit below which it is a fault (IL.FOLDFTHRESHU)"),
        Field("foldback_warning_level", "f8", "A", "parameter", "limit below which it is a warning, 0 = none"),
        Field("foldback_warning", "u4", "", "parameter", "that warning, 0 = none", (2,)),
        Field("drive_overload_fault", "u4", "", "parameter", "fault of the drive's limit, number | reaction << 24"),
        Field("foldback_used", "f8", "A", "firmware", "how far each limit is below where it began", (2,)),
        Field("foldback_limit", "f8", "A", "firmware", "each limit, inf = there is none", (2,), default=inf),
        Field("foldback_current", "f8", "A", "firmware", "the lower one (IL.IFOLD)", default=inf),
        Field("bus_levels", "f8", "V", "parameter", "DC link voltage below and above which it warns, 0 = none", (2,)),
        Field("bus_warning", "u4", "", "parameter", "these warnings, 0 = none", (2,)),
        Field("undervoltage_limit", "f8", "V", "parameter", "DC link voltage below which it is a fault, 0 = none"),
        Field("undervoltage_mode", "u1", "", "parameter", "1 = only while the power stage is on (VBUS.UVMODE)"),
        Field("undervoltage_fault", "u4", "", "parameter", "that fault, number | reaction << 24, 0 = none"),
        # sense of direction
        Field("direction", "u1", "", "parameter", "1 = the drive counts the other way than the shaft (DRV.DIR)"),
        Field("turned", "u1", "", "firmware", "1 = it does"),
        # warnings of its own
        Field("thermal_warning", "f8", "", "station", "thermal_load above which the I2t warning shows, 0 = none"),
        # what single models add
        *READINGS,
        Field("rest_without_task", "u1", "", "parameter", "1 = ZSW1.13 stands only while no task is active, too"),
        Field("reached_without_task", "u1", "", "parameter", "ZSW1.10 in position mode: REACHED_*"),
        Field("velocity_limit_positive", "f8", "rpm", "parameter", "most speed forwards, inf = no limit", default=inf),
        Field("velocity_limit_negative", "f8", "rpm", "parameter", "most speed backwards, alike", default=inf),
        Field("disable_method", "u1", "", "parameter", "how the power stage goes off by software: DISABLE_*"),
        Field(
            "setpoint_ignored",
            "u1",
            "",
            "parameter",
            "1 = set points of the telegram are not followed, but torque_command is; 2 = neither",
        ),
        Field("feedrate_signal", "u1", "", "parameter", "1 = MT_FEEDRATE is brought, in percent"),
        Field("target_velocity_window", "f8", "rpm", "parameter", "how near a task's velocity counts as reached"),
        Field("sto_fault", "u4", "", "parameter", "fault whose cause is that the torque is safely off, 0 = none"),
        Field("limit_warning", "u4", "", "parameter", "warning at the low and the high software limit, 0 = none", (2,)),
        Field("service_mode", "u1", "", "parameter", "course of service motion: SERVICE_*"),
        Field("service_velocity", "f8", "rpm", "parameter", "of its first and its second leg", (2,)),
        Field("service_time", "f8", "s", "parameter", "of these, 0 = the first one never ends", (2,)),
        Field("service", "u1", "", "firmware", "leg of the service motion that runs, 0 = none"),
        Field("service_command", "u1", "", "firmware", "1 = service motion shall begin"),
        Field("service_ns", "i8", "ns", "firmware", "when its leg began"),
        Field("jogging", "u1", "", "firmware", "1 = a jog of velocity mode runs, or brakes"),
        Field("home_seen", "u1", "", "firmware", "1 = STW1.11 has started homing and still stands"),
        Field("home_error", "u1", "", "firmware", "1 = the last homing was not carried out"),
        Field(
            "task_error", "u1", "", "firmware", "1 = the last task could not be started, 2 = nor the one behind a task"
        ),
        Field("task_warning", "u4", "", "parameter", "warning of each of these errors, 0 = none", (2,)),
        Field("asked_base", "u1", "", "firmware", "what a way counts from: TASK_FROM_*, 0 = the last target"),
        Field("disable_command", "u1", "", "firmware", "1 = the power stage shall go off"),
        Field("stop_command", "u1", "", "firmware", "what runs shall end: STOP_*, 0 = not"),
        Field("continue_command", "u1", "", "firmware", "1 = a halted task shall go on"),
        Field("cycle_ns", "i8", "ns", "station", "cycle of the connection that brings set points, 0 = not known"),
        Field("cyclic_pause", "f8", "s", "firmware", "time between the last two positions of each cycle, 0 = none yet"),
        Field("telegram_frames", "u4", "", "firmware", "set point frames taken when cyclic data was there last"),
        # torque control, and what is added to the set points of speed and torque
        Field("torque_step", "f8", "N m", "parameter", "one increment of torque signals, 0 = a 16384th of the peak"),
        Field("torque_command", "f8", "N m", "parameter", "torque set point of a parameter (IL.CMDU)"),
        Field("torque_speed_limited", "u1", "", "parameter", "1 = the speed limits hold in torque control"),
        Field("additive_torque", "f8", "N m", "parameter", "added to the torque that the controllers ask for"),
        Field("additive_speed", "f8", "rpm", "parameter", "added to the speed set point in operation"),
        Field("torque_setpoint", "f8", "N m", "firmware", "torque that the controller asks for"),
        Field("speed_reference", "f8", "rpm", "firmware", "ramp, and what is added to it: the set point of the speed"),
        # what the drive measures, and its clock
        Field("velocity_noise", "f8", "rpm", "station", "noise of the measured speed, effective value, 0 = none"),
        Field("current_noise", "f8", "A", "station", "of the measured current, alike"),
        Field("position_noise", "f8", "rev", "station", "of the measured position, alike"),
        Field("noise_seed", "i8", "", "station", "begins the sequence of noise, 0 = there is none"),
        Field("noise_state", "i8", "", "firmware", "where in that sequence it is, 0 = not begun"),
        Field("velocity_deviation", "f8", "rpm", "firmware", "what noise adds to the measured speed in this step"),
        Field("current_deviation", "f8", "A", "firmware", "to the measured current, alike"),
        Field("position_deviation", "f8", "rev", "firmware", "to the measured position, alike"),
        Field(
            "clock_drift", "f8", "", "station", "how much faster the drive's clock runs: 1e-6 = 1 ppm; 0 = as time does"
        ),
        Field("clock_start_ns", "i8", "ns", "station", "when it showed the time as it is"),
        Field("life_told", "u4", "", "firmware", "frames sent that its own sign of life has counted"),
    ],
)
