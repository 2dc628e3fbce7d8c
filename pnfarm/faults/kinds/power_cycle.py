"""power-cycle: the control supply goes off and comes back."""

from __future__ import annotations

from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import Effect
from pnfarm.faults.effects.supply import SUPPLY
from pnfarm.faults.kind import InjectionKind, ParamSpec

__all__ = ["KIND"]


class PowerCycle(Effect):
    """Off at once; further times when the drive is connected again."""

    supply = SUPPLY
    connection = CONNECTION
    ends_by_itself = True
    _off = False
    _was_on = True

    def begin(self, now: int) -> None:
        self._was_on = self.supply.powered
        self.supply.power_off(now)
        self._off = True
        self.tally.note(now, happened=self._was_on, confirmed=self._was_on and not self.supply.powered)
        self._due = now + self.values["off"]

    def check(self, now: int) -> None:
        if self._off:
            if self._due is not None and now >= self._due:
                self.end(now)
                # of one that was off there is nothing to interrupt
                self.finished = not self._was_on or self.tally.seen.activations >= (self.spec.count or 1)
            return
        connection = self.connection.now()
        if not self.finished and connection is not None and connection.established:
            self.begin(now)

    def end(self, now: int) -> None:
        if self._off:
            self._off = False
            self._due = None
            self.supply.power_on(now)


KIND = InjectionKind(
    "power-cycle",
    "drive",
    "The control supply goes off and comes back; the drive boots with its non-volatile memory.",
    "one interruption; with `count` the next one follows when the drive is connected again",
    PowerCycle,
    {"off": ParamSpec("duration", "How long the supply is off.", default="1s")},
    takes=frozenset({"count"}),
    place=130,
    wire="The frames end without notice; later the drive starts as after power on (LLDP, DCP, Connect).",
    reports="After the watchdog, IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running "
    "(assumed)). The device comes back.",
)
