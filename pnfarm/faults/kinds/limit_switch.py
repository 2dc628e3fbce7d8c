"""limit-switch: the axis is on a limit of its travel."""

from __future__ import annotations

from pnfarm.faults.effects.confirmed import Held, StandingEffect
from pnfarm.faults.effects.connection import Status
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

__all__ = ["KIND"]


class LimitSwitch(StandingEffect):
    """Confirmed by the drive's warning, if its manual names one."""

    servo = SERVO

    def prepare(self) -> None:
        self._side = str(self.values["side"])
        warns = self.servo.warns_of_limit(self._side) and self.connection.reports(Status.WARNING)
        self.status = Status.WARNING if warns else None

    def held(self) -> Held:
        return self.servo.limits, self._side


KIND = InjectionKind(
    "limit-switch",
    "drive",
    "The axis is on a limit of its travel: no task moves further that way, and the drive warns if its manual "
    "names a warning.",
    "reaching the limit",
    LimitSwitch,
    {"side": ParamSpec("word", "Which end of the travel.", default="positive", words={"positive": 0, "negative": 1})},
    takes=HELD,
    place=80,
    wire="The words and warnings that the drive's manual has for the switch; the velocity falls to 0.",
    reports="The bus reports nothing: the program sees the drive's words. S7-1500: a positioning axis that watches its "
    "following error stops with technology alarm 521.",
)
