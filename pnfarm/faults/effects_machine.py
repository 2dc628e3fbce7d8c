"""Faults of the machine around the drive: its limit switches, enable, supply of power, digital inputs and load."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects_drive import WARNING_PRESENT
from pnfarm.faults.shown import StandingEffect

if TYPE_CHECKING:
    from pnfarm.faults.plan import FaultSpec
    from pnfarm.faults.target import FaultTarget

__all__ = ["InputEffect", "LimitSwitchEffect", "LoadEffect", "NotReadyEffect"]

#: ZSW1 (PROFIdrive profile, status word 1).
SWITCHING_ON_INHIBITED = 6


class LimitSwitchEffect(StandingEffect):
    """limit-switch: the axis stands on it, and the drive warns if its manual names a warning."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._side = str(self.values["side"])
        self.bit = WARNING_PRESENT if target.warns_of_limit(self._side) else None

    def put(self) -> None:
        self.target.reach_limit(self._side)

    def take(self) -> None:
        self.target.leave_limit(self._side)


class NotReadyEffect(StandingEffect):
    """not-ready: no fault, but the drive cannot be switched on."""

    bit = SWITCHING_ON_INHIBITED

    def put(self) -> None:
        self.target.lack(str(self.values["missing"]))

    def take(self) -> None:
        self.target.regain(str(self.values["missing"]))


class InputEffect(StandingEffect):
    """digital-input: a voltage at an input of the drive."""

    def put(self) -> None:
        self.target.switch_input(int(self.values["input"]))

    def take(self) -> None:
        self.target.release_input(int(self.values["input"]))


class LoadEffect(StandingEffect):
    """load, stuck-axis: more on the shaft."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._torque, self._inertia, self._friction = (
            float(self.values[name]) for name in ("torque", "inertia", "friction")
        )

    def put(self) -> None:
        self.target.put_load(self._torque, self._inertia, self._friction)

    def take(self) -> None:
        self.target.take_load(self._torque, self._inertia, self._friction)
