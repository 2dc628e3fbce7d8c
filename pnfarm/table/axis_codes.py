"""Codes in the axis' columns, and the sizes of its arrays."""

#: Faults of one situation, and situations kept (AKD PROFINET manual 5.14: eight of eight).
FAULT_SLOTS = 8
WARNING_SLOTS = 8
FAULT_SITUATIONS = 8
#: The number in a fault as it is raised (number | reaction << 24).
NUMBER_MASK = 0xFFFFFF
#: Number of faults that a parameter can keep from being raised (AKD PROFINET manual 5.6: FAULT130.ACTION and 7 more).
FAULT_ACTIONS = 8
#: Fault numbers whose word in the signal FAULT_CODE is the manual's own: 0 to 127.
FAULT_WORDS = 128
#: Number of parts of the jerk time.
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

#: Upper bound of the shaft's speed, rpm: several times that of the fastest spindles.  Where a load outruns
#: every brake, speed and position stay finite.
FASTEST_RPM = 1e6
#: Most revolutions from the start of the farm to a part of the machine.
FARTHEST = 1e9

# Bits of the controller's words that several parts of the firmware use.
CONTROL_BY_PLC = 0x0400  # STW1.10: without it the controller's words are not accepted
MDI_SELECTED = 0x8000  # SATZANW.15, POS_STW1.15; AKTSATZ.15 reports it

# The controller's orders to the power stage (``orders.power``), bit by bit; two of them act when they are cleared.
POWER_ON = 1
POWER_NO_COAST = 2  # 0: off at once
POWER_NO_QUICK_STOP = 4  # 0: along the quick stop ramp, then off
POWER_ENABLE = 8  # operation

# What an enabled drive does on a fault: bits 24..31 of a fault as it is raised.
REACTION_COAST = 0  # power stage off
REACTION_QUICK_STOP = 1  # controlled stop along the quick stop ramp, then off

# Commands of the event loop to the firmware in the ring ``commands.ring``; each is ``code | argument << 8``.
CMD_RAISE_FAULT = 1  # argument: fault number | reaction << 24; its cause is gone at once
CMD_HOLD_FAULT = 2  # same argument; its cause remains until CMD_RELEASE_FAULT
CMD_RELEASE_FAULT = 3  # argument: fault number
CMD_ACKNOWLEDGE = 4  # as the edge of STW1.7
CMD_POWER_ON = 5  # start from boot with a clean state; position and fault history per the model
CMD_SET_POSITION = 6  # the position that homing gives (homing.position), here
CMD_RAISE_WARNING = 7  # argument: warning number
CMD_CLEAR_WARNING = 8  # argument: warning number
CMD_CLEAR_HISTORY = 9  # forget the acknowledged fault situations
CMD_START_TASK = 10  # argument: number of a motion task; as the edge of STW1.6
CMD_HOME = 11  # as STW1.11
CMD_DISABLE = 12  # power stage off by software
CMD_STOP = 13  # stop motion; argument: STOP_* below
CMD_CONTINUE = 14  # continue the task that CMD_STOP halted
CMD_SERVICE = 15  # begin service motion

# How the power stage goes off by software (``drive.disable_method``).
DISABLE_AT_ONCE = 0
DISABLE_STOPPED = 1  # along the quick stop ramp first

# Effect on the running task (``commands.stop``, CMD_STOP).
STOP_HALT = 1  # CMD_CONTINUE continues it
STOP_DROP = 2

# Which set point the telegram brings (``profidrive.velocity_signal``).
VELOCITY_NSOLL_A = 0
VELOCITY_NSOLL_B = 1
VELOCITY_REF_SPEED = 2

# Use of the ramp generator for velocity set points (``ramp.generator``).
RAMP_GENERATED = 0
RAMP_PASSED_BY = 1  # they act at once; STW1.4-6, 8 and 9 keep their meaning
RAMP_ABSENT = 2  # they act at once; STW1.4-6, 8 and 9 have no meaning

# Mode of the profile generator of positioning (``profile.mode``).
PROFILE_STOP = 0  # stop and stay at rest
PROFILE_TARGET = 1  # stop at ``profile.target``
PROFILE_VELOCITY = 2  # run at ``profile.top``, which may be negative

# How bits 9 to 15 of ZSW1 and bits 0 to 7 of ZSW2 are used (``profidrive.status_form``).
STATUS_PROFILE = 0
STATUS_MOOG = 1  # Moog MSD manual, tables 10.8, 10.9, 10.16 and 10.17; the last two with P-1258 = 1 or 3

# What the drive lacks without being faulty (``drive.interlocks``, ``drive.lacks``), bit by bit.
LACKS_ENABLE = 1  # the hardware enable (Moog MSD: ENPO; AKD: DRV.HWENABLE)
LACKS_SUPPLY = 2  # the mains of the DC link
LACKS_RELEASE = 4  # an input asks for a controlled stop

# What a quick stop does (``drive.quick_stop_option``; Moog MSD manual, table 10.3, codes + 1).
QUICK_STOP_PROFILE = 0  # PROFIdrive: along the quick stop ramp, then off
QUICK_STOP_COAST = 1
QUICK_STOP_RAMP = 2  # along the deceleration ramp, then off
QUICK_STOP_QUICK = 3  # along the quick stop ramp, then off
QUICK_STOP_CURRENT = 4  # as fast as the motor can, then off
QUICK_STOP_STAYS = 4  # above this: as four below, but the power stage stays on

# How jogging follows its bits (``jog.form``).
JOG_LEVELS = 0  # STW1.8 selects the first velocity, STW1.9 the second, both together none
JOG_SEQUENCES = 1  # Moog MSD manual, tables 10.10 and 10.11: firmware/jog.py

# What the telegram's control word is of (``profidrive.object``).
OBJECT_AXIS = 0
OBJECT_ENCODER = 1  # STW2_ENC
OBJECT_CONTROL_UNIT = 2  # CU_STW1
OBJECT_INFEED = 3  # E_STW1

# Which signals bring traversing tasks (``profidrive.task_form``).
TASKS_NONE = 0
TASKS_MDI = 1  # SATZANW.15 and MDI_*: telegram 9 of the profile
TASKS_POS_STW = 2  # POS_STW1.15, POS_STW1.8 and MDI_*: telegram 111
TASKS_TARPOS = 3  # a target position, STW1.12 for a relative one, STW1.13 for no handshake, STW1.14 for endless motion
TASKS_TABLE = 4  # as before, and the target is the driving set that SATZANW names

# How STW1 is read in position mode (``asked.control_config``; bits of P-1267, Moog MSD manual 10.2.2).
CONFIG_RISING_EDGE = 0x0040  # a task starts with the rising edge of STW1.6 only; else with both, each toggling ZSW1.12
CONFIG_PROFILE_JOG = 0x0100  # jogging needs STW1.4 to 6 = 0

# What a motion task is (``motion_tasks.kind``).
TASK_DEFINED = 1
TASK_RELATIVE = 2
TASK_CHAINED = 4  # another follows
TASK_FROM_COMMAND = 8  # a distance counts from the commanded position
TASK_FROM_TARGET = 16  # a distance counts from the last target
TASK_FROM_ACTUAL = 32  # a distance counts from the actual position
TASK_PASSING = 64  # the next one begins at the target without a stop
#: A running task whose data the controller brings (``positioning.task``).
TASK_MDI = -1

# Course of service motion (``service.mode``): what an AKD's SM.MODE has for velocity mode.
SERVICE_CONSTANT = 2
SERVICE_ALTERNATING = 3

# States of positioning that others look at (``positioning.state``).
MOTION_TASK = 2  # a task runs
MOTION_INTERMEDIATE_STOP = 3  # it waits
MOTION_HALTED = 7  # it waits to be continued by a parameter

# Requested jogging (``jog.asked``).
JOG_NONE = 0
JOG_PLUS = 1  # at the first jogging velocity
JOG_MINUS = 2  # at the second
JOG_REAL_TIME = 3  # at the task's own velocity
JOG_SEQUENCE = 4  # at ``jog.speed``
JOG_STILL = 5  # standstill: both directions at once

# Homing methods (``homing.method``), numbered as HOME.MODE of the Kollmorgen AKD; the others are in firmware/homing.py.
HOME_AT_ONCE = 0  # the present position
HOME_MARK = 11  # the next zero mark of the encoder

# Software limits as a telegram switches them (``travel.switched``).
SWITCHED_NOT = 0  # by ``travel.software_limits``
SWITCHED_OFF = 1
SWITCHED_ON = 2

# Parts of the machine (``machine.parts``), bit by bit.
MACHINE_SWITCH_LOW = 0x01
MACHINE_SWITCH_HIGH = 0x02
MACHINE_STOP_LOW = 0x04
MACHINE_STOP_HIGH = 0x08
MACHINE_CAMS = 0x10
MACHINE_STOPS_MOVED = 0x20  # the plant says where end stops are

# Use of a digital input (``machine.input_modes``): DINx.MODE of the AKD parameter reference.
INPUT_HOME_SWITCH = 11
INPUT_CONTROLLED_STOP = 13
INPUT_LIMIT_HIGH = 18
INPUT_LIMIT_LOW = 19

# Whether too many signs of life failed since cyclic data began (``life.failed``).
LIFE_GOOD = 0
LIFE_FAILED = 1  # and the step raises the fault
LIFE_TOLD = 2  # and it has raised it

# Where functions 1 to 4 of the sensor interface find their reference mark (``sensor.marks``), and its edge.
MARK_NONE = 0
MARK_PROBE_1 = 1
MARK_PROBE_2 = 2
MARK_ZERO = 3  # the encoder's own, once in a revolution
EDGE_RISING = 0
EDGE_FALLING = 1

#: State SD12 of the sensor interface (``sensor.state``).
SENSOR_PARKING = 12

# Firmware variants (``front``).
FIRMWARE_NONE = 0
FIRMWARE_PROFIDRIVE = 1
FIRMWARE_ETHERNETIP = 2  # assemblies of the position controller (AKD EtherNet/IP manual 6.2)
