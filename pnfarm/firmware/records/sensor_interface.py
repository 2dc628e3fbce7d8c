"""Fields of the axis record: sensor."""

from __future__ import annotations

from math import inf

from pnfarm.table.layout import Field, subject

__all__ = ["SENSOR_2_RECORD", "SENSOR_RECORD"]

_SETTINGS = [
    Field("step", "f8", "rev", "parameter", "one increment of G1_XIST1, 0 = no such signal"),
    Field("step_2", "f8", "rev", "parameter", "one increment of G1_XIST2, 0 = no such signal"),
    Field(
        "revolutions",
        "f8",
        "rev",
        "parameter",
        "range that the encoder still knows at power-on, 0 = none, inf = unlimited",
        default=inf,
    ),
    Field("probe_inputs", "u4", "", "parameter", "bit of machine.inputs that is probe 1 or 2, 0 = none", (2,)),
    Field("fault", "u4", "", "parameter", "the encoder's fault, number | reaction << 24, 0 = none"),
    Field("bits", "u2", "", "parameter", "bits of G1_STW that the drive supports, 0 = no sensor interface"),
    Field("refused", "u2", "", "parameter", "those of them that the drive refuses"),
    Field("status_bits", "u2", "", "parameter", "bits of G1_ZSW that the drive supports"),
    Field("probe_mode", "u2", "", "parameter", "0 = the probes measure"),
    Field("shows", "u1", "", "parameter", "1 = G1_XIST2 is the position while nothing else is requested"),
    Field(
        "marks",
        "u1",
        "",
        "parameter",
        "places 0..3: where functions 1 to 4 find their mark, MARK_*; 4..7: its edge, EDGE_*; 8..11: nothing",
        (12,),
    ),
]
_STATE = [
    Field("position", "f8", "rev", "firmware", "shaft position at the last step"),
    Field("zero", "f8", "rev", "firmware", "shaft position at which its count is 0"),
    Field("inputs", "u4", "", "firmware", "machine.inputs at the last step"),
    Field("stw", "u2", "", "firmware", "G1_STW in force, supported bits only"),
    Field("error", "u2", "", "firmware", "code of the sensor error, 0 = none"),
    Field("state", "u1", "", "firmware", "SD1 to SD12 as 1..12, 0 = not yet; profidrive/sensor_interface.py"),
    Field("active", "u1", "", "firmware", "functions waiting for their mark or edge: G1_ZSW.0 to 3"),
    Field("found", "u1", "", "firmware", "functions whose value was found: G1_ZSW.4 to 7"),
    Field("probing", "u1", "", "firmware", "1 = active and found functions are measurements on the fly"),
    Field("read", "u1", "", "firmware", "function whose value is read, 1 to 4"),
    Field("faulty", "u1", "", "firmware", "1 = the encoder's fault was there at the last step"),
    Field("value", "f8", "rev", "firmware", "position at each function's mark or edge", (4,)),
]

SENSOR_RECORD = subject("sensor", "The sensor interface of encoder 1.", settings=_SETTINGS, state=_STATE)
SENSOR_2_RECORD = subject("sensor_2", "The sensor interface of encoder 2.", settings=_SETTINGS, state=_STATE)
