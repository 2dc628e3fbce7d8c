"""toy-mute: the drive receives its orders and reports nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.effect import Effect, Tally, Window
from pnfarm.faults.kind import InjectionKind
from toybus.faults.drive import MOUTH

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence


class ToyMute(Effect):
    needs = (MOUTH,)

    def begin(self, window: Window, now: int) -> None:
        self._tally = Tally()
        self.drive.part(MOUTH).shut()
        self._tally.note(now, confirmed=True)

    def end(self, now: int) -> None:
        self.drive.part(MOUTH).open()

    def evidence(self) -> Evidence:
        return self._tally.seen


KINDS = (
    InjectionKind(
        "toy-mute", "connection", "The drive reports nothing.", "the silence", ToyMute, takes=frozenset({"for"})
    ),
)
