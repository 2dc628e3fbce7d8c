"""undervoltage, encoder-error, following-error, sto: faults by their cause.

One file for all of them, because they are data: the model says which of its faults has the cause.
"""

from __future__ import annotations

from pnfarm.faults.kind import HELD, InjectionKind
from pnfarm.faults.kinds.drive_fault import DriveFault, check_repetition

__all__ = ["KINDS"]

#: (name, which is the cause's in a model; what a user reads; place)
_CAUSES = (
    ("undervoltage", "The power supply is too low", 40),
    ("encoder-error", "The feedback of the motor is lost", 50),
    ("following-error", "The axis does not follow", 60),
    ("sto", "Safe torque off is requested", 70),
)

KINDS = tuple(
    InjectionKind(
        cause,
        "drive",
        f"{doc}; the cause stays until this ends, then the fault can be acknowledged.",
        "the fault",
        DriveFault,
        takes=HELD,
        preset={"fault": cause, "hold": True},
        misfits=check_repetition,
        wire="ZSW1.3 (fault present) is set, ZSW1.2 falls; the fault buffer (PNU 945, 947) has the model's number.",
        reports="The program sees ZSW1.3. S7-1500: a technology object raises its drive alarm. CODESYS: an axis error "
        "(assumed).",
        place=place,
    )
    for cause, doc, place in _CAUSES
)
