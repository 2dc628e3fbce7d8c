"""slow-ramp: ramps take longer than asked."""

from __future__ import annotations

from pnfarm.faults.effects.confirmed import Held, StandingEffect
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

__all__ = ["KIND"]


class SlowRamp(StandingEffect):
    """Ramps of speed and of positioning alike."""

    servo = SERVO

    def prepare(self) -> None:
        self._factor = float(self.values["factor"])
        if self.servo.lacks_ramp:
            what = f"{self.drive.name} ({self.drive.models[0]}) has no ramp generator, which slow-ramp needs"
            raise InjectionError([("kind", f"{what}: its controller makes the ramps", "")])

    def held(self) -> Held:
        return self.servo.slow_ramps, self._factor


KIND = InjectionKind(
    "slow-ramp",
    "drive",
    "Every ramp of the drive takes longer than asked: speed, stops and quick stops, jogging, positioning.  ZSW1.8 and "
    "ZSW1.10 follow the actual speed.",
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
    reports="The bus reports nothing. A program that waits for ZSW1.10 or a position waits longer. A technology object "
    "that makes the ramps and watches its following error stops the axis (S7-1500: technology alarm 521).",
)
