"""drive-warning: the drive has a warning."""

from __future__ import annotations

from pnfarm.faults.effects.confirmed import StandingEffect
from pnfarm.faults.effects.connection import Status
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

__all__ = ["KIND"]


class DriveWarning(StandingEffect):
    """Shown before the drive's own warnings."""

    servo = SERVO
    status = Status.WARNING

    def prepare(self) -> None:
        self._warning = self.servo.find_fault(self.values["warning"])
        if not self._warning.warning:
            what = f"{self._warning.label} is a fault of this drive"
            raise InjectionError([("params.warning", what, "a warning; drive-fault raises faults")])

    def put(self) -> None:
        self.servo.warn(self._warning)

    def take(self) -> None:
        self.servo.unwarn(self._warning)


KIND = InjectionKind(
    "drive-warning",
    "drive",
    "The drive has a warning: ZSW1.7.",
    "the warning",
    DriveWarning,
    {"warning": ParamSpec("fault", "Which warning.", required=True)},
    takes=HELD,
    place=30,
    wire="ZSW1.7 (warning present) is set.",
    reports="The bus reports nothing: the PLC program sees it in ZSW1.",
)
