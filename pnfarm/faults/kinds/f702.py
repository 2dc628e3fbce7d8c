"""f702: shorthand for drive-fault 702."""

from __future__ import annotations

from pnfarm.faults.kind import InjectionKind
from pnfarm.faults.kinds.drive_fault import HOLD, DriveFault, check_repetition

__all__ = ["KIND"]

KIND = InjectionKind(
    "f702",
    "drive",
    "Fieldbus communication lost: drive-fault 702.",
    "the fault; with `count` it comes again once it was acknowledged",
    DriveFault,
    {"hold": HOLD},
    takes=frozenset({"count", "for", "cycles"}),
    preset={"fault": 702},
    misfits=check_repetition,
    place=20,
    wire="As drive-fault: ZSW1.3 is set, PNU 945 and 947 have 702.",
    reports="The program sees ZSW1.3. S7-1500: a technology object raises its drive alarm. CODESYS: an axis error "
    "(assumed).",
)
