"""hiccup: the drive loses its enable again and again, for one look each time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.effect import Effect, Tally, Window
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.kind import InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive


class Hiccup(Effect):
    """Taken away at every other look."""

    needs = (SERVO,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._servo = drive.part(SERVO)
        self._tally = Tally()
        self._lacks = False
        self._due = 0

    def begin(self, window: Window, now: int) -> None:
        self.check(now)

    def check(self, now: int) -> None:
        if now < self._due:
            return
        if self._lacks:
            self._servo.give_back("enable")
        else:
            self._servo.take_away("enable")
            self._tally.note(now)
        self._lacks = not self._lacks
        self._due = now + self.values["pause"]

    def end(self, now: int) -> None:
        if self._lacks:
            self._servo.give_back("enable")

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due


KINDS = (
    InjectionKind(
        "hiccup",
        "drive",
        "The drive loses its enable again and again.",
        "a loss",
        Hiccup,
        {"pause": ParamSpec("duration", "From one change to the next.", default="200ms")},
        takes=frozenset({"for"}),
    ),
)
