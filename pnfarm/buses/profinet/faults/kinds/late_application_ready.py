"""late-application-ready: the drive sends ApplicationReady late."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.set_up import SET_UP
from pnfarm.faults.effects.effect import ChanceEffect
from pnfarm.faults.kind import EACH, InjectionKind, ParamSpec

__all__ = ["KIND", "LateReady"]


class LateReady(ChanceEffect):
    """By ``delay``; None is never."""

    set_up = SET_UP

    def prepare(self) -> None:
        super().prepare()
        self._held: set[int] = set()

    def put(self) -> None:
        self.set_up.hold_ready(self)

    def decide(self, key: int, now: int) -> tuple[bool, int | None]:
        """The rule for one connection that is being set up."""
        acts = self.occurs(now)
        if acts:
            self._held.add(key)
        return acts, self.values["delay"]

    def check(self, now: int) -> None:
        del now
        self._held &= self.set_up.waiting_for_ready()
        # ending earlier would send ApplicationReady to the connection that must not get it
        self.finished = self.exhausted and not self._held

    def end(self, now: int) -> None:
        self.set_up.unhold_ready(self, self._held, now)


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
