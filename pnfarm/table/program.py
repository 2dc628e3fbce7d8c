"""A controller's axis program: what the built-in PLC does with one drive.  Row *i* uses image row *i*."""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout

__all__ = ["PROGRAM"]

# What an enabled axis runs (``kind``).
IDLE = 0  # enabled, at zero speed
CONSTANT = 1
RAMP = 2  # triangle between +speed and -speed
SINE = 3
POSITIONS = 4  # homes the axis and takes it from target to target, position mode
PYTHON = 5  # a program of the user's writes the set points

#: Targets of a program.
TARGETS = 8

# Where a program of positions is (``leg``).
LEG_HOMING = 0  # STW1.11 is set until ZSW1.11 is
LEG_LOADING = 1  # the target is in the telegram, STW1.6 is at rest
LEG_STARTED = 2  # STW1.6 changed, no acknowledgement yet
LEG_MOVING = 3  # acknowledged
LEG_DWELLING = 4  # ZSW1.10: the target is reached

# Where the handshake of a command is (``loading``), of a drive whose commands are loaded.
LOAD_NONE = 0  # no command is to be loaded
LOAD_LOW = 1  # the command is in the assembly, Load/Start is low until the drive has seen that
LOAD_HIGH = 2  # Load/Start is high, no answer yet
LOAD_DONE = 3  # Load Complete was seen
LOAD_REFUSED = 4  # the drive answered with an error

# Where the program is (``phase``).
OFFLINE = 0  # no valid data from the drive
SWITCHING_ON = 1  # walking S1, S2, S3
RUNNING = 2  # S4, following the set point
FAULTED = 3  # fault seen, enable withdrawn, waiting before the acknowledgement
ACKNOWLEDGING = 4  # STW1.7 set
STOPPED = 5  # not enabled by the user

PROGRAM = Layout(
    "program",
    "One axis of the built-in controller.",
    [
        Field("active", "u1", "", "station", "row in use"),
        Field("front", "u1", "", "station", "whose words it uses: FIRMWARE_* of the axis"),
        Field("kind", "u1", "", "station", "IDLE .. PYTHON"),
        Field("enable", "u1", "", "station", "1 = switch the drive on, 0 = leave it ready"),
        Field("speed", "f8", "rpm", "station", "speed, or amplitude"),
        Field("period_ns", "i8", "ns", "station", "of ramp and sine"),
        Field("velocity_step", "f8", "rpm", "station", "one increment of NSOLL_A"),
        Field("velocity_step_b", "f8", "rpm", "station", "one increment of NSOLL_B, 0 = a 65536th of velocity_step"),
        Field("targets", "f8", "rev", "station", "of a program of positions", (TARGETS,)),
        Field("target_count", "u1", "", "station", "how many of them"),
        Field("acceleration", "f8", "rpm/s", "station", "of tasks, both ways"),
        Field("dwell_ns", "i8", "ns", "station", "how long the axis stays at a target"),
        Field("task_form", "u1", "", "station", "how the telegram brings tasks: TASKS_* of the axis"),
        Field("control_config", "u2", "", "station", "how the drive reads STW1: CONFIG_* of the axis"),
        Field("moving_bit", "u1", "", "station", "1 = ZSW1.13 means that the axis moves, not that it is at rest"),
        Field("target_step", "f8", "rev", "station", "one increment of a target position"),
        Field("task_velocity_step", "f8", "rpm", "station", "one increment of a task's velocity"),
        Field("task_acceleration_step", "f8", "rpm/s", "station", "one increment of a task's acceleration"),
        Field("task_deceleration_step", "f8", "rpm/s", "station", "one increment of a task's deceleration"),
        Field("task_ramps_signed", "u1", "", "station", "1 = MDI_ACC and MDI_DEC have a sign"),
        Field("real_tasks", "u1", "", "station", "1 = the data of a task are float32: degrees, degrees/s, percent"),
        Field("ramp_step", "f8", "rpm/s", "station", "one increment of DRV_ACC and DRV_DEC"),
        Field("speed_up", "f8", "rpm/s", "station", "acceleration of a command that brings a speed"),
        Field("speed_down", "f8", "rpm/s", "station", "its deceleration"),
        Field("clear_number", "u2", "", "station", "instance of the parameter that clears faults"),
        Field("object", "u1", "", "station", "what the telegram's control word is of: OBJECT_* of the axis"),
        Field("life", "u1", "", "station", "1 = send a running sign of life in STW2"),
        Field(
            "acknowledge_after_ns",
            "i8",
            "ns",
            "station",
            "wait between seeing a fault and acknowledging it; negative: never",
        ),
        Field("phase", "u1", "", "program", "OFFLINE .. STOPPED"),
        Field("phase_ns", "i8", "ns", "program", "when the phase began"),
        Field("run_ns", "i8", "ns", "program", "when RUNNING began, start of ramp and sine"),
        Field("asked_ns", "i8", "ns", "program", "when the control word changed last, 0 = answered"),
        Field("reaction_ns", "i8", "ns", "program", "from a new control word to the drive's changed status, last"),
        Field("reaction_max_ns", "i8", "ns", "program", "the longest of these"),
        Field("fault_ns", "i8", "ns", "program", "when the present fault was seen, 0 = none"),
        Field("recovery_ns", "i8", "ns", "program", "from seeing a fault to operation again, last"),
        Field("leg", "u1", "", "program", "LEG_HOMING .. LEG_DWELLING"),
        Field("leg_ns", "i8", "ns", "program", "when the leg began, or the axis moved last in it"),
        Field("target_index", "u1", "", "program", "index of the current target"),
        Field("start_bit", "u2", "", "program", "STW1.6 as it was sent last"),
        Field("acknowledged", "u2", "", "program", "ZSW1.12 before the task was started"),
        Field("loading", "u1", "", "program", "handshake of the command: LOAD_NONE .. LOAD_REFUSED"),
        Field("loading_ns", "i8", "ns", "program", "when that began"),
        Field("command", "u1", "", "program", "type of the command that is loaded"),
        Field("mode_set", "u1", "", "program", "1 = the drive took the operating mode in this connection"),
        Field("homing_set", "u1", "", "program", "1 = homing was started"),
        Field("speed_set", "u1", "", "program", "1 = speed_units were taken"),
        Field("speed_units", "i4", "", "program", "speed of the command that was loaded last, profile units"),
        Field("refused", "i8", "", "program", "commands that the drive refused"),
        Field("error", "u2", "", "program", "the last refusal: general status, additional code above it"),
        Field("moves", "i8", "", "program", "targets reached"),
        Field("faults", "i8", "", "program", "faults seen"),
        Field(
            "zsw1",
            "u2",
            "",
            "program",
            "status word that was seen last; of an assembly words 1 and 2, the second above",
        ),
        Field("stw1", "u2", "", "program", "control word sent; of an assembly the type of its command above it"),
    ],
)
