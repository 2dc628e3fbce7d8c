"""link-flap: the cable is pulled and plugged repeatedly."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.cable import CableEffect
from pnfarm.faults.kind import InjectionKind, Misfits, ParamSpec
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields

__all__ = ["KIND"]

#: The cable is out, and in, for no shorter time.
SHORTEST_NS = 1_000_000


class LinkFlap(CableEffect):
    """Out for ``down`` of each ``period``."""

    def prepare(self) -> None:
        self._period: int = self.values["period"]
        self._down: int = self.values["down"] or self._period // 2

    def _pull(self, now: int) -> None:
        super()._pull(now)
        self._due = now + self._down

    def check(self, now: int) -> None:
        self._look()
        if self._due is None or now < self._due:
            return
        if self._is_out:
            self._plug()
            self.finished = self.spec.count is not None and self.tally.seen.activations >= self.spec.count
            self._due = None if self.finished else now + self._period - self._down
        else:
            self._pull(now)


def _misfits(spec: InjectionFields) -> Misfits:
    """Down for less than the period."""
    if {"period", "down"}.isdisjoint(spec.params):
        return
    try:
        period, down = spec.values()["period"], spec.values()["down"]
    except Problem:
        # the parameter's own error is already reported
        return
    if down is not None and down > period - SHORTEST_NS:
        yield "params.down", Problem(f"is {shown(spec.params['down'])}", "1ms shorter than the period, or more")


KIND = InjectionKind(
    "link-flap",
    "link",
    "The cable is pulled and plugged repeatedly.",
    "pulling the cable",
    LinkFlap,
    {
        "period": ParamSpec("duration", "From one pull to the next.", default="1s", low=10 * SHORTEST_NS),
        "down": ParamSpec(
            "duration", "How long the cable is out each time; left out, half the period.", default=None, low=SHORTEST_NS
        ),
    },
    takes=frozenset({"count", "for"}),
    misfits=_misfits,
    place=40,
    wire="No carrier, repeatedly.",
    reports="After each watchdog, IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running "
    "(assumed)). Then the connection is set up again.",
)
