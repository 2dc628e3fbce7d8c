"""toy-mute: the drive receives its orders and reports nothing."""

from __future__ import annotations

from pnfarm.faults.effects.effect import Effect
from pnfarm.faults.kind import InjectionKind
from toybus.faults.drive import MOUTH


class ToyMute(Effect):
    mouth = MOUTH

    def begin(self, now: int) -> None:
        self.mouth.shut()
        self.tally.note(now, confirmed=True)

    def take(self) -> None:
        self.mouth.open()


KIND = InjectionKind(
    "toy-mute", "connection", "The drive reports nothing.", "the silence", ToyMute, takes=frozenset({"for"})
)
