"""f702: shorthand for drive-fault 702."""

from __future__ import annotations

from pnfarm.faults.kind import InjectionKind
from pnfarm.faults.kinds.drive_fault import HOLD, DriveFault, check_repetition

__all__ = ["KINDS"]

KINDS = (
    InjectionKind(
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
    ),
)
