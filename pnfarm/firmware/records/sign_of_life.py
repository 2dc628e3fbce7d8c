"""Fields of the axis record: life."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["LIFE_RECORD"]

LIFE_RECORD = subject(
    "life",
    "Sign of life of controller and drive.",
    settings=[
        Field("fault", "u4", "", "parameter", "fault raised when too many failed (number | reaction << 24), 0 = none"),
        Field("tolerance", "u2", "", "parameter", "failed signs of life that raise the fault (PNU 925), 65535 = none"),
        Field("watched", "u1", "", "parameter", "1 = sign of life in STW2 and ZSW2"),
        Field("isochronous", "u1", "", "parameter", "1 = it is not monitored without isochronous operation"),
    ],
    state=[
        Field("errors", "i8", "", "firmware", "failed signs of life"),
        Field("frames", "u4", "", "firmware", "set point frames seen so far"),
        Field("counted", "u4", "", "firmware", "frames sent that its own sign of life has counted"),
        Field("count", "u4", "", "firmware", "error counter: 10 up on a failure, 1 down on a good frame"),
        Field("seen", "u1", "", "firmware", "the controller's last count, 0 = none"),
        Field("run", "u1", "", "firmware", "frames in sequence, 15 = the controller is monitored"),
        Field("sent", "u1", "", "firmware", "the drive's own count, 1..15, 0 = none yet"),
        Field("failed", "u1", "", "firmware", "too many failed: LIFE_*"),
    ],
)
