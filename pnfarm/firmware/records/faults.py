"""Fields of the axis record: commands, faults."""

from __future__ import annotations

from pnfarm.table.axis_codes import COMMANDS, FAULT_ACTIONS, FAULT_SITUATIONS, FAULT_SLOTS
from pnfarm.table.layout import Field, subject

__all__ = ["COMMANDS_RECORD", "FAULTS_RECORD"]

COMMANDS_RECORD = subject(
    "commands",
    "Commands of the event loop, and requests that the firmware has yet to carry out.",
    settings=[
        Field("ring", "i8", "", "station", "ring of commands to the firmware", (COMMANDS,)),
        Field("head", "u4", "", "station", "commands written so far"),
    ],
    state=[
        Field("tail", "u4", "", "firmware", "commands taken so far"),
        Field("task", "u2", "", "firmware", "motion task that a command starts, plus 1; 0 = none"),
        Field("home", "u1", "", "firmware", "1 = a command starts homing"),
        Field("disable", "u1", "", "firmware", "1 = the power stage is to be switched off"),
        Field("stop", "u1", "", "firmware", "request to stop motion: STOP_*, 0 = none"),
        Field("resume", "u1", "", "firmware", "1 = a halted task is to be continued"),
        Field("service", "u1", "", "firmware", "1 = service motion is to begin"),
    ],
)

FAULTS_RECORD = subject(
    "faults",
    "Faults: active ones, those whose cause remains, and the fault buffer.",
    settings=[
        Field(
            "loss_delay_ns",
            "i8",
            "ns",
            "parameter",
            "how long cyclic data may be missing before loss_fault; 0 = raised at once",
        ),
        Field(
            "loss_fault",
            "u4",
            "",
            "parameter",
            "fault raised when cyclic data is lost (number | reaction << 24), 0 = none",
        ),
        Field(
            "stop_fault", "u4", "", "parameter", "fault raised when the controller goes to STOP, coded as loss_fault"
        ),
        Field("sto_fault", "u4", "", "parameter", "fault of safe torque off, 0 = none"),
        Field("ignored", "u4", "", "parameter", "numbers of faults that are not raised, 0 = none", (FAULT_ACTIONS,)),
        Field("refuse_until", "i8", "", "fault", "acknowledgements are refused while refused is below it"),
        Field("places", "u1", "", "parameter", "faults of one situation in the buffer, 0 = FAULT_SLOTS"),
        Field(
            "stays", "u1", "", "parameter", "1 = the buffer begins with the newest situation, 0 = with the active one"
        ),
        Field("history_lost", "u1", "", "parameter", "1 = the fault buffer is empty after power on"),
    ],
    state=[
        Field("since_ns", "i8", "ns", "firmware", "when the active situation began, 0 = none"),
        Field("refused", "i8", "", "firmware", "acknowledgements refused because of refuse_until"),
        Field("asked_ns", "i8", "ns", "firmware", "when a parameter last asked to acknowledge, 0: never"),
        Field("code", "u4", "", "firmware", "active faults, oldest first, 0 = none", (FAULT_SLOTS,)),
        Field("held", "u4", "", "firmware", "faults whose cause is present, with reaction", (FAULT_SLOTS,)),
        Field("causes", "u1", "", "firmware", "number of faults in held"),
        Field("counter", "u4", "", "firmware", "PNU 944: situations since power-on"),
        Field("kept", "u2", "", "firmware", "situations that the fault buffer held at power-on"),
        Field("changes", "u2", "", "firmware", "changes of the fault buffer since power-on"),
        Field("ends", "u2", "", "firmware", "number of situations that ended"),
        Field("refusing", "u1", "", "firmware", "1 = the present request to acknowledge is refused until it ends"),
        Field("reacted", "u1", "", "firmware", "1 once the controller withdrew the enable after a fault"),
        Field("buffer", "u4", "", "firmware", "PNU 947: situations, newest first", (FAULT_SLOTS * FAULT_SITUATIONS,)),
    ],
)
