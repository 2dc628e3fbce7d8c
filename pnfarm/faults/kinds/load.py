"""load: the machine puts more on the shaft."""

from __future__ import annotations

from typing import Any

from pnfarm.faults.effects.confirmed import Held, StandingEffect
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

__all__ = ["KIND", "AddedLoad"]

_ANY_LOAD: dict[str, Any] = {"low": -1e6, "high": 1e6}


class AddedLoad(StandingEffect):
    """Torque, inertia and friction in addition to the present ones."""

    servo = SERVO

    def held(self) -> Held:
        return self.servo.loads, tuple(float(self.values[name]) for name in ("torque", "inertia", "friction"))


KIND = InjectionKind(
    "load",
    "drive",
    "The machine adds load to the shaft, in addition to the load of the farm file; several add up.  The drive's "
    "control loops stay tuned for the load without it.",
    "the change",
    AddedLoad,
    {
        "torque": ParamSpec("number", "Against forward motion.", default=0.0, unit="N m", **_ANY_LOAD),
        "inertia": ParamSpec("number", "More of it.", default=0.0, unit="kg m^2", low=0.0, high=1e6),
        "friction": ParamSpec("number", "More dry friction.", default=0.0, unit="N m", low=0.0, high=1e9),
    },
    takes=HELD,
    place=90,
    wire="Current and velocity change as far as the telegram has them.",
    reports="The bus reports nothing. A positioning axis that watches its following error may stop (S7-1500: "
    "alarm 521).",
)
