"""late-application-ready: the drive sends ApplicationReady late."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.set_up import SET_UP
from pnfarm.faults.effects.effect import ChanceEffect
from pnfarm.faults.kind import EACH, InjectionKind, ParamSpec

__all__ = ["KIND", "LateReady"]


class LateReady(ChanceEffect):
    """By ``delay``; None is never."""

    set_up = SET_UP
    _decided = False
    _acts = False
    _held: frozenset[int] = frozenset()

    def put(self) -> None:
        self.set_up.hold_ready(self)

    def decide(self) -> tuple[bool, int | None]:
        """The rule for one connection that is being set up."""
        self._acts = not self.finished and self.happens()
        self._decided = True
        return self._acts, self.values["delay"]

    def check(self, now: int) -> None:
        waiting = self.set_up.waiting_for_ready()
        if self._decided and waiting - self._held:
            self._decided = False
            self.tally.note(now, happened=self._acts, confirmed=self._acts)
            if self._acts:
                self._held |= waiting
        # ending earlier would send ApplicationReady to the connection that must not get it
        self._held &= waiting
        self.finished = self.exhausted and not self._held

    def end(self, now: int) -> None:
        self.set_up.unhold_ready(self, now)


KIND = InjectionKind(
    "late-application-ready",
    "connection",
    "After parametrisation the drive sends ApplicationReady late.",
    "a connection whose ApplicationReady is late",
    LateReady,
    {"delay": ParamSpec("duration", "From the end of parametrisation to ApplicationReady.", default="5s")},
    takes=EACH,
    place=40,
    wire="The ApplicationReady request comes late.",
    reports="The device stays failed until then; beyond the controller's monitoring the connection is ended and set up "
    "again.",
)
