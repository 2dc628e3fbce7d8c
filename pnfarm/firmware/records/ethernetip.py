"""Fields of the axis record: ethernetip."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["ETHERNETIP_RECORD", "MAPPED"]

#: Entries of EIP.CMDMAP and EIP.RSPMAP (AKD EtherNet/IP manual 9.1, 9.5).
MAPPED = 16

ETHERNETIP_RECORD = subject(
    "ethernetip",
    "The position controller's assemblies: units, maps, and the command that was loaded last.",
    settings=[
        Field(
            "profile_step", "f8", "rpm", "parameter", "one profile unit: of speed rpm, of ramps rpm/s (EIP.PROFUNIT)"
        ),
        Field(
            "command_map", "u2", "", "parameter", "instances in octets 36 to 63 of the command (EIP.CMDMAP)", (MAPPED,)
        ),
        Field("response_map", "u2", "", "parameter", "the same of the response (EIP.RSPMAP)", (MAPPED,)),
        Field("enable_outlasts_fault", "u1", "", "parameter", "1 = Enable acts after a fault without rising again"),
        Field("loss_stops", "u1", "", "parameter", "1 = without valid data a controlled stop, not coasting"),
        Field("unhomed_fault", "u4", "", "parameter", "fault of a move of an axis that is not homed, 0 = none"),
        # attributes of the position controller that a client writes
        Field("target", "i4", "", "station", "target position by attribute, position units"),
        Field("velocity", "i4", "", "station", "target velocity by attribute, profile units"),
        Field("torque", "i4", "", "station", "torque by attribute, a 3280th of the peak"),
        Field("incremental", "u1", "", "station", "1 = a move by attribute is incremental"),
        Field("targets_set", "u4", "", "station", "how often an attribute wrote target, velocity or incremental"),
        Field("starts", "u4", "", "station", "trajectories started by attribute"),
        Field("enables", "u4", "", "station", "how often an attribute wrote enable"),
        Field("enable", "u1", "", "station", "what it wrote last"),
        # answers to tasks of the front
        Field(
            "answer_status",
            "u2",
            "",
            "station",
            "general status of the answered task, its extended status in bits 8 to 15",
        ),
    ],
    state=[
        Field("torque_command", "f8", "N m", "firmware", "torque in force"),
        Field("speed_command", "f8", "rpm", "firmware", "speed of the running jog in velocity mode"),
        Field("up", "f8", "rpm/s", "firmware", "acceleration in force, 0 = none was loaded"),
        Field("down", "f8", "rpm/s", "firmware", "deceleration in force, 0 = none was loaded"),
        Field("task_value", "i8", "", "firmware", "data of the task that is reported"),
        Field("map_seen", "i8", "", "firmware", "digest of the mapped set points that were reported last"),
        Field("target_units", "i4", "", "firmware", "target position, position units"),
        Field("velocity_units", "i4", "", "firmware", "target velocity, profile units"),
        Field("load_value", "i8", "", "firmware", "data of the loaded command that the event loop carries out"),
        Field("read_value", "i8", "", "firmware", "the value that was read last"),
        Field("tasks", "u4", "", "firmware", "tasks reported so far"),
        Field("targets_seen", "u4", "", "firmware", "targets_set of the last step"),
        Field("starts_seen", "u4", "", "firmware", "starts of the last step"),
        Field("enables_seen", "u4", "", "firmware", "enables of the last step"),
        Field("error", "u2", "", "firmware", "error of the loaded command: code, additional code above it; 0 = none"),
        Field("echo", "u2", "", "firmware", "octets 2 and 3 of the command with that error"),
        Field("status", "u2", "", "firmware", "status word 1, status word 2 above it"),
        Field("load_number", "u2", "", "firmware", "its instance or attribute"),
        Field("load_kind", "u1", "", "firmware", "what it is: TASK_* of firmware/ethernetip/tasks.py"),
        Field("load_write", "u1", "", "firmware", "1 = it writes"),
        Field("posted", "u1", "", "firmware", "1 = a task is to be reported"),
        Field("move", "u1", "", "firmware", "1 = the move that began is to be reported as motion task 0"),
        Field("wanted", "u1", "", "firmware", "1 = Enable was set in the last step"),
        Field("by_attribute", "u1", "", "firmware", "1 = attribute 0x11 enables"),
        Field("word", "u1", "", "firmware", "control word of the last step"),
        Field("mode", "u1", "", "firmware", "drive.opmode of the last step"),
        Field("image_valid", "u1", "", "firmware", "validity of the command as the last step saw it"),
        Field("enabled", "u1", "", "firmware", "1 = the power stage is to be on"),
        Field("stopped", "u1", "", "firmware", "1 = a controlled stop holds until Enable is cleared"),
        Field("loaded", "u1", "", "firmware", "Load Complete"),
        Field("loading", "u1", "", "firmware", "1 = the loaded command awaits its answer, 2 = its turn"),
        Field("read", "u1", "", "firmware", "1 = the last answer is a value for octets 24 to 31"),
        Field("moving", "u1", "", "firmware", "In Motion"),
    ],
)
