"""slow-ramp: ramps take longer than asked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.confirmed import StandingEffect
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class SlowRamp(StandingEffect):
    """Ramps of speed and of positioning alike."""

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._factor = float(self.values["factor"])
        if self._servo.lacks_ramp:
            what = f"{drive.name} ({drive.models[0]}) has no ramp generator, which slow-ramp needs"
            raise InjectionError([("kind", f"{what}: its controller makes the ramps", "")])

    def put(self) -> None:
        self._servo.slow_ramps(self._factor)

    def take(self) -> None:
        self._servo.hasten_ramps(self._factor)


KINDS = (
    InjectionKind(
        "slow-ramp",
        "drive",
        "Every ramp of the drive takes longer than asked: speed, stops and quick stops, jogging, positioning.  "
        "ZSW1.8 and ZSW1.10 follow the actual speed.",
        "the change",
        SlowRamp,
        {
            "factor": ParamSpec(
                "number",
                "How many times as long a ramp takes; several injections multiply.",
                default=2.0,
                low=1.0,
                high=1000.0,
            ),
        },
        takes=HELD,
        place=105,
        wire="The actual velocity (NIST_A, NIST_B) reaches the set point later; so do ZSW1.8 and ZSW1.10.",
        reports=(
            "The bus reports nothing. A program that waits for ZSW1.10 or a position waits longer. A technology object "
            "that makes the ramps and watches its following error stops the axis (S7-1500: technology alarm 521)."
        ),
    ),
)
