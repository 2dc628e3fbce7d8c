"""Fields of the axis record: machine."""

from __future__ import annotations

from pnfarm.table.axis_codes import CAMS, USED_INPUTS
from pnfarm.table.layout import Field, subject

__all__ = ["MACHINE_RECORD"]

MACHINE_RECORD = subject(
    "machine",
    "The machine's switches, stops and cams, and the drive's digital inputs.",
    settings=[
        Field("switch_low", "f8", "rev", "station", "the low limit switch is pressed from here downwards"),
        Field("switch_high", "f8", "rev", "station", "the high limit switch is pressed from here upwards"),
        Field("stop_low", "f8", "rev", "station", "end stop: the shaft turns no further"),
        Field("stop_high", "f8", "rev", "station", "end stop: the shaft turns no further"),
        Field("cam_low", "f8", "rev", "station", "where a cam begins", (CAMS,)),
        Field("cam_high", "f8", "rev", "station", "where a cam ends", (CAMS,)),
        Field("cam_inputs", "u4", "", "station", "bit of inputs that a cam switches on, 0 = no such cam", (CAMS,)),
        Field("fault_inputs", "u4", "", "fault", "digital inputs that faults switch on, bit by bit"),
        Field("input_modes", "u2", "", "parameter", "use of the first digital inputs: INPUT_*", (USED_INPUTS,)),
        Field("input_inverted", "u1", "", "parameter", "1 = such an input is inverted", (USED_INPUTS,)),
        Field("parts", "u1", "", "station", "which parts it has: MACHINE_*"),
        Field("fault_limits", "u1", "", "fault", "limit switches that faults press: bit 0 low, bit 1 high"),
    ],
    state=[
        Field("inputs", "u4", "", "firmware", "levels of the drive's digital inputs, bit by bit"),
        Field("outputs", "u2", "", "firmware", "levels of a control unit's digital outputs, bit by bit"),
        Field("switches_off", "u1", "", "firmware", "1 = the controller has limit switches not count"),
        Field("limit_switch", "u1", "", "firmware", "limit switches that are pressed, coded as fault_limits"),
        Field("home_switch", "u1", "", "firmware", "1 = a digital input that is used as home switch is on"),
        Field("stop_input", "u1", "", "firmware", "1 = an input that is used for controlled stops is on"),
    ],
)
