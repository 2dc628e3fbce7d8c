"""The axis: one row for each virtual drive (one drive object with one motor), put together from its subjects.

Each subject is declared in ``records``, in the file named like the module that writes it; the fields that the event
loop writes are its settings.  Importing this module compiles nothing.

* ``drive.state``: 1..5 for S1..S5 of the PROFIdrive general state machine, 0 while the drive boots.
* fault numbers are the manual's own (AKD: 702 ...); 0 means none;
* names with a star are the constants in :mod:`pnfarm.table.axis_codes` and :mod:`pnfarm.table.axis_readings`.
"""

from __future__ import annotations

from pnfarm.firmware.records.direction import DIRECTION_RECORD
from pnfarm.firmware.records.drive_clock import CLOCK_RECORD
from pnfarm.firmware.records.ethernetip import ETHERNETIP_RECORD
from pnfarm.firmware.records.faults import COMMANDS_RECORD, FAULTS_RECORD
from pnfarm.firmware.records.foldback import FOLDBACK_RECORD
from pnfarm.firmware.records.homing import HOMING_RECORD
from pnfarm.firmware.records.interpolation import INTERPOLATION_RECORD
from pnfarm.firmware.records.jog import JOG_RECORD
from pnfarm.firmware.records.machine import MACHINE_RECORD
from pnfarm.firmware.records.measurement import MEASUREMENT_RECORD
from pnfarm.firmware.records.motor import BRAKE_RECORD, LOAD_RECORD, MOTOR_RECORD
from pnfarm.firmware.records.orders import ORDERS_RECORD
from pnfarm.firmware.records.outside import OUTSIDE_RECORD
from pnfarm.firmware.records.own_warnings import WARNINGS_RECORD
from pnfarm.firmware.records.positioning import POSITIONING_RECORD
from pnfarm.firmware.records.profidrive import PROFIDRIVE_RECORD
from pnfarm.firmware.records.profile_generator import PROFILE_RECORD
from pnfarm.firmware.records.ramp import RAMP_RECORD
from pnfarm.firmware.records.sensor_interface import SENSOR_2_RECORD, SENSOR_RECORD
from pnfarm.firmware.records.service_motion import SERVICE_RECORD
from pnfarm.firmware.records.sign_of_life import LIFE_RECORD
from pnfarm.firmware.records.state_machine import DRIVE_RECORD
from pnfarm.firmware.records.supply import SUPPLY_RECORD
from pnfarm.firmware.records.tasks import ASKED_RECORD, DRIVING_SETS_RECORD, MOTION_TASKS_RECORD
from pnfarm.firmware.records.torque_limits import TORQUE_RECORD
from pnfarm.firmware.records.travel import TRAVEL_RECORD
from pnfarm.table.layout import Field, Layout

__all__ = ["AXIS"]

AXIS = Layout(
    "axis",
    "One virtual drive: its configuration, what its firmware computes, and the state of its motor.",
    [
        Field("front", "u1", "", "station", "front that controls it: FIRMWARE_*; 0 = row unused"),
        Field("powered", "u1", "", "station", "1 while the control supply is on"),
        Field("each_tick", "u1", "", "engine", "1 while it has work in ticks in which it makes no step"),
        Field("step_ns", "i8", "ns", "station", "longest time between two firmware steps"),
        Field("longest_ns", "i8", "ns", "engine", "most that a step covers with a plant that moves it, 0 = a second"),
        Field("boot_time_ns", "i8", "ns", "station", "from switching on to S1"),
        Field("last_ns", "i8", "ns", "firmware", "time of the last step"),
        Field("boot_ns", "i8", "ns", "firmware", "when the drive was switched on"),
    ],
    (
        DRIVE_RECORD,
        ORDERS_RECORD,
        CLOCK_RECORD,
        COMMANDS_RECORD,
        FAULTS_RECORD,
        WARNINGS_RECORD,
        PROFIDRIVE_RECORD,
        ETHERNETIP_RECORD,
        LIFE_RECORD,
        DIRECTION_RECORD,
        MACHINE_RECORD,
        OUTSIDE_RECORD,
        LOAD_RECORD,
        MOTOR_RECORD,
        BRAKE_RECORD,
        SUPPLY_RECORD,
        FOLDBACK_RECORD,
        TORQUE_RECORD,
        RAMP_RECORD,
        TRAVEL_RECORD,
        JOG_RECORD,
        ASKED_RECORD,
        POSITIONING_RECORD,
        PROFILE_RECORD,
        HOMING_RECORD,
        INTERPOLATION_RECORD,
        SERVICE_RECORD,
        SENSOR_RECORD,
        SENSOR_2_RECORD,
        MEASUREMENT_RECORD,
        DRIVING_SETS_RECORD,
        MOTION_TASKS_RECORD,
    ),
    # a tick reads the first line of each row, and of most rows nothing else
    cache_lines=True,
)
