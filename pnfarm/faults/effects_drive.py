"""Faults of the drive itself: its fault buffer, its warnings, its supply."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.frames import Effect, Tally, Window
from pnfarm.faults.shown import ShownEffect, StandingEffect
from pnfarm.faults.words import FaultError

if TYPE_CHECKING:
    from pnfarm.faults.plan import FaultSpec
    from pnfarm.faults.target import Evidence, FaultTarget

__all__ = ["DriveFaultEffect", "PowerCycleEffect", "WarningEffect"]

#: ZSW1 (PROFIdrive profile, status word 1).
FAULT_PRESENT = 3
WARNING_PRESENT = 7
#: How often a drive without supply is looked at.
LOOK_NS = 50_000_000


class DriveFaultEffect(ShownEffect):
    """drive-fault, f702 and the faults named by their cause."""

    bit = FAULT_PRESENT

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._hold = bool(self.values.get("hold")) or spec.for_ns is not None or spec.cycles is not None
        self._fault = target.find_fault(self.values["fault"])
        self._holding = False
        self._stood = False
        self._count = 0
        if self._fault.warning:
            raise FaultError(
                [
                    (
                        "params.fault",
                        f"{self._fault.label} is a warning of this drive",
                        "a fault; drive-warning raises warnings",
                    )
                ]
            )

    def begin(self, window: Window, now: int) -> None:
        del window
        if self._hold:
            self.target.hold_fault(self._fault)
            self._holding = True
            self._occurred(now)
        else:
            self._raise(now)

    def _raise(self, now: int) -> None:
        """Once; a drive without supply has none until it is back."""
        if not self.target.powered:
            self._due = now + LOOK_NS
            return
        self._stood = False
        self._count = self.target.fault_count(self._fault)
        self.target.raise_fault(self._fault)
        self._occurred(now)

    def check(self, now: int) -> None:
        self._look(now)
        if self._hold:
            return
        seen = self._tally.seen.activations
        stands = self.target.fault_stands(self._fault)
        if not seen:
            self._raise(now)
        elif stands:
            self._stood = True
        elif self.target.ignores_fault(self._fault):
            # nothing comes of it
            self.finished = True
        elif self._stood or self.target.fault_count(self._fault) > self._count:
            if seen >= (self.spec.count or 1):
                self.finished = True
            else:
                self._raise(now)

    def end(self, now: int) -> None:
        self._look(now)
        self._due = None
        if self._holding:
            self._holding = False
            self.target.release_fault(self._fault)


class WarningEffect(StandingEffect):
    """drive-warning."""

    bit = WARNING_PRESENT

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._warning = target.find_fault(self.values["warning"])
        if not self._warning.warning:
            raise FaultError(
                [
                    (
                        "params.warning",
                        f"{self._warning.label} is a fault of this drive",
                        "a warning; drive-fault raises faults",
                    )
                ]
            )

    def put(self) -> None:
        self.target.warn(self._warning)

    def take(self) -> None:
        self.target.unwarn(self._warning)


class PowerCycleEffect(Effect):
    """power-cycle: off now; further ones when the drive is connected again."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._tally = Tally()
        self._off = False
        self._due: int | None = None

    def begin(self, window: Window, now: int) -> None:
        del window
        self._switch_off(now)

    def _switch_off(self, now: int) -> None:
        self.target.power_off(now)
        self._off = True
        self._tally.note(now, confirmed=not self.target.powered)
        self._due = now + self.values["off"]

    def _switch_on(self, now: int) -> None:
        if self._off:
            self._off = False
            self._due = None
            self.target.power_on(now)

    def check(self, now: int) -> None:
        if self._off:
            if self._due is not None and now >= self._due:
                self._switch_on(now)
                self.finished = self._tally.seen.activations >= (self.spec.count or 1)
            return
        connection = self.target.connection()
        if not self.finished and connection is not None and connection.established:
            self._switch_off(now)

    def end(self, now: int) -> None:
        self._switch_on(now)

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due
