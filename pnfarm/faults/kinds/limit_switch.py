"""limit-switch: the axis is on a limit of its travel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.confirmed import StandingEffect
from pnfarm.faults.effects.connection import Status
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class LimitSwitch(StandingEffect):
    """Confirmed by the drive's warning, if its manual names one."""

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._side = str(self.values["side"])
        warns = self._servo.warns_of_limit(self._side) and self._connection.reports(Status.WARNING)
        self.status = Status.WARNING if warns else None

    def put(self) -> None:
        self._servo.reach_limit(self._side)

    def take(self) -> None:
        self._servo.leave_limit(self._side)


KINDS = (
    InjectionKind(
        "limit-switch",
        "drive",
        "The axis is on a limit of its travel: no task moves further that way, and the drive warns if its manual "
        "names a warning.",
        "reaching the limit",
        LimitSwitch,
        {
            "side": ParamSpec(
                "word", "Which end of the travel.", default="positive", words={"positive": 0, "negative": 1}
            )
        },
        takes=HELD,
        place=80,
        wire="The words and warnings that the drive's manual has for the switch; the velocity falls to 0.",
        reports=(
            "The bus reports nothing: the program sees the drive's words. S7-1500: a positioning axis that watches its "
            "following error stops with technology alarm 521."
        ),
    ),
)
