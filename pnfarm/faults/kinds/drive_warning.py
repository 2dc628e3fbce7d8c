"""drive-warning: the drive has a warning."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.confirmed import StandingEffect
from pnfarm.faults.effects.connection import Status
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class DriveWarning(StandingEffect):
    """Shown before the drive's own warnings."""

    status = Status.WARNING

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._warning = self._servo.find_fault(self.values["warning"])
        if not self._warning.warning:
            raise InjectionError(
                [
                    (
                        "params.warning",
                        f"{self._warning.label} is a fault of this drive",
                        "a warning; drive-fault raises faults",
                    )
                ]
            )

    def put(self) -> None:
        self._servo.warn(self._warning)

    def take(self) -> None:
        self._servo.unwarn(self._warning)


KINDS = (
    InjectionKind(
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
    ),
)
