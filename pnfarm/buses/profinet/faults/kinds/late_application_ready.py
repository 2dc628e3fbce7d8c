"""late-application-ready: the drive sends ApplicationReady late."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults.set_up import SET_UP
from pnfarm.faults.effects.effect import Chance, Effect, Window
from pnfarm.faults.kind import EACH, InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS", "LateReady"]


class LateReady(Effect):
    """By ``delay``; None is never."""

    needs = (SET_UP,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._set_up = drive.part(SET_UP)
        self._chance = Chance(spec, drive, spec.count)
        self._delay: int | None = self.values["delay"]
        self._decided = False
        self._acts = False
        self._held: frozenset[int] = frozenset()

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self._set_up.hold_ready(self)

    def decide(self) -> tuple[bool, int | None]:
        """The rule for one connection that is being set up."""
        self._acts = not self.finished and self._chance.happens()
        self._decided = True
        return self._acts, self._delay

    def check(self, now: int) -> None:
        waiting = self._set_up.waiting_for_ready()
        if self._decided and waiting - self._held:
            self._decided = False
            self._chance.tally.note(now, happened=self._acts, confirmed=self._acts)
            if self._acts:
                self._held |= waiting
        # ending earlier would send ApplicationReady to the connection that must not get it
        self._held &= waiting
        self.finished = self._chance.exhausted and not self._held

    def end(self, now: int) -> None:
        self._set_up.unhold_ready(self, now)

    def evidence(self) -> Evidence:
        return self._chance.tally.seen


KINDS = (
    InjectionKind(
        "late-application-ready",
        "connection",
        "After parametrisation the drive sends ApplicationReady late.",
        "a connection whose ApplicationReady is late",
        LateReady,
        {"delay": ParamSpec("duration", "From the end of parametrisation to ApplicationReady.", default="5s")},
        takes=EACH,
        place=40,
        wire="The ApplicationReady request comes late.",
        reports=(
            "The device stays failed until then; beyond the controller's monitoring the connection is ended and "
            "set up again."
        ),
    ),
)
