"""power-cycle: the control supply goes off and comes back."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import Effect, Tally, Window
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.kind import InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class PowerCycle(Effect):
    """Off at once; further times when the drive is connected again."""

    needs = (SERVO, CONNECTION)
    ends_by_itself = True

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._servo = drive.part(SERVO)
        self._connection = drive.part(CONNECTION)
        self._tally = Tally()
        self._off = False
        self._due: int | None = None

    def begin(self, window: Window, now: int) -> None:
        del window
        self._switch_off(now)

    def _switch_off(self, now: int) -> None:
        self._servo.power_off(now)
        self._off = True
        self._tally.note(now, confirmed=not self._servo.powered)
        self._due = now + self.values["off"]

    def _switch_on(self, now: int) -> None:
        if self._off:
            self._off = False
            self._due = None
            self._servo.power_on(now)

    def check(self, now: int) -> None:
        if self._off:
            if self._due is not None and now >= self._due:
                self._switch_on(now)
                self.finished = self._tally.seen.activations >= (self.spec.count or 1)
            return
        connection = self._connection.now()
        if not self.finished and connection is not None and connection.established:
            self._switch_off(now)

    def end(self, now: int) -> None:
        self._switch_on(now)

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due


KINDS = (
    InjectionKind(
        "power-cycle",
        "drive",
        "The control supply goes off and comes back; the drive boots with its non-volatile memory.",
        "one interruption; with `count` the next one follows when the drive is connected again",
        PowerCycle,
        {"off": ParamSpec("duration", "How long the supply is off.", default="1s")},
        takes=frozenset({"count"}),
        place=130,
        wire="The frames end without notice; later the drive starts as after power on (LLDP, DCP, Connect).",
        reports=(
            "After the watchdog, IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running "
            "(assumed)). The device comes back."
        ),
    ),
)
