"""load: the machine puts more on the shaft."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.confirmed import StandingEffect
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS", "AddedLoad"]

_ANY_LOAD: dict[str, Any] = {"low": -1e6, "high": 1e6}


class AddedLoad(StandingEffect):
    """Torque, inertia and friction in addition to the present ones."""

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._torque, self._inertia, self._friction = (
            float(self.values[name]) for name in ("torque", "inertia", "friction")
        )

    def put(self) -> None:
        self._servo.put_load(self._torque, self._inertia, self._friction)

    def take(self) -> None:
        self._servo.take_load(self._torque, self._inertia, self._friction)


KINDS = (
    InjectionKind(
        "load",
        "drive",
        "The machine adds load to the shaft, on top of the load of the farm file; several add up.  The drive's "
        "controllers stay tuned for the load without it.",
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
        reports=(
            "The bus reports nothing. A positioning axis that watches its following error may stop (S7-1500: "
            "technology alarm 521)."
        ),
    ),
)
