"""Fields of the axis record: homing."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["HOMING_RECORD"]

HOMING_RECORD = subject(
    "homing",
    "Homing.",
    settings=[
        Field("velocity", "f8", "rpm", "parameter", "of homing"),
        Field("acceleration", "f8", "rpm/s", "parameter", "of homing"),
        Field("deceleration", "f8", "rpm/s", "parameter", "of homing"),
        Field("direction", "f8", "", "parameter", "of homing: positive = forwards"),
        Field("position", "f8", "rev", "parameter", "position that the reference mark gets"),
        Field("distance", "f8", "rev", "parameter", "distance from the mark to where homing ends"),
        Field("share", "f8", "", "parameter", "part of velocity used after the search", default=1.0),
        Field("current", "f8", "A", "parameter", "limit while homing looks for an end stop, 0 = none"),
        Field("lag", "f8", "rev", "parameter", "following error that detects an end stop, 0 = none"),
        Field("farthest", "f8", "rev", "parameter", "longest search distance, 0 = unlimited"),
        Field("method", "u1", "", "parameter", "homing method: HOME_*, and firmware/homing.py"),
        Field("required", "u1", "", "parameter", "1 = tasks need the home position"),
        Field("by_edge", "u1", "", "parameter", "1 = homing begins with the edge of STW1.11, not while it is set"),
        Field(
            "ends_interpolation",
            "u1",
            "",
            "parameter",
            "1 = after homing the profile generator stays in force until ramp.generator is set",
        ),
        Field("stays", "u1", "", "parameter", "1 = the home position outlasts a power cycle"),
    ],
    state=[
        Field("origin", "f8", "rev", "firmware", "where position 0 of the machine lies on the shaft"),
        Field("sense", "f8", "", "firmware", "direction of the search, 1 forwards, -1 backwards"),
        Field("start", "f8", "rev", "firmware", "where homing began"),
        Field("current_limit", "f8", "A", "firmware", "current limit of homing in force, 0 = none"),
        Field("distance_in_force", "f8", "rev", "firmware", "distance of the telegram, or distance"),
        Field("method_in_force", "u2", "", "firmware", "method of the telegram, or method"),
        Field("homed", "u1", "", "firmware", "1 = the home position is known"),
        Field("leg", "u1", "", "firmware", "leg of homing in progress, as numbered in firmware/homing.py"),
        Field("seen", "u1", "", "firmware", "1 = STW1.11 has started homing and is still set"),
        Field("error", "u1", "", "firmware", "1 = the last homing was not carried out"),
        Field("inputs", "u4", "", "firmware", "machine.inputs of the last step, for flying homing"),
        Field("reversed", "u1", "", "firmware", "1 = the controller asks for the other direction"),
        Field("flying", "u1", "", "firmware", "1 = homing on the fly waits for its probe"),
        Field("brought", "u1", "", "firmware", "which of these the telegram brought, coded as profidrive.home_signals"),
    ],
)
