"""hiccup: the drive loses its enable again and again, for one look each time."""

from __future__ import annotations

from pnfarm.faults.effects.effect import Effect
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.kind import InjectionKind, ParamSpec


class Hiccup(Effect):
    """Taken away at every other look."""

    servo = SERVO
    _lacks = False

    def begin(self, now: int) -> None:
        self.check(now)

    def check(self, now: int) -> None:
        if self._due is not None and now < self._due:
            return
        if self._lacks:
            self.servo.lacks.take("enable")
        else:
            self.servo.lacks.put("enable")
            self.tally.note(now)
        self._lacks = not self._lacks
        self._due = now + self.values["pause"]

    def take(self) -> None:
        if self._lacks:
            self.servo.lacks.take("enable")


KIND = InjectionKind(
    "hiccup",
    "drive",
    "The drive loses its enable again and again.",
    "a loss",
    Hiccup,
    {"pause": ParamSpec("duration", "From one change to the next.", default="200ms")},
    takes=frozenset({"for"}),
)
