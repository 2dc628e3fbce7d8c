"""What is wired to a drive: its hardware enable, its supply of power, its digital inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects import Effect, Tally, Window
from pnfarm.faults.effects_drive import ShownEffect

if TYPE_CHECKING:
    from pnfarm.faults.plan import FaultSpec
    from pnfarm.faults.target import Evidence, FaultTarget

__all__ = ["InputEffect", "NotReadyEffect"]

#: ZSW1 (PROFIdrive profile, status word 1).
SWITCHING_ON_INHIBITED = 6


class NotReadyEffect(ShownEffect):
    """not-ready: no fault, but the drive cannot be switched on."""

    bit = SWITCHING_ON_INHIBITED

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._missing = str(self.values["missing"])
        self._lacking = False

    def begin(self, window: Window, now: int) -> None:
        del window
        self._lacking = True
        self.target.lack(self._missing)
        self._occurred(now)

    def check(self, now: int) -> None:
        self._look(now)

    def end(self, now: int) -> None:
        self._look(now)
        self._due = None
        if self._lacking:
            self._lacking = False
            self.target.regain(self._missing)


class InputEffect(Effect):
    """digital-input: a voltage at an input of the drive."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._tally = Tally()
        self._number = int(self.values["input"])
        self._on = False

    def begin(self, window: Window, now: int) -> None:
        del window
        self._on = True
        self.target.switch_input(self._number)
        self._tally.note(now, confirmed=True)

    def end(self, now: int) -> None:
        del now
        if self._on:
            self._on = False
            self.target.release_input(self._number)

    def evidence(self) -> Evidence:
        return self._tally.seen
