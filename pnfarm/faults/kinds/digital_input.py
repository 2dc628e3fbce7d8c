"""digital-input: a voltage at an input of the drive."""

from __future__ import annotations

from pnfarm.faults.effects.confirmed import Held, StandingEffect
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

__all__ = ["KIND"]


class DigitalInput(StandingEffect):
    """The input is on until the injection ends."""

    servo = SERVO

    def held(self) -> Held:
        return self.servo.inputs, int(self.values["input"])


KIND = InjectionKind(
    "digital-input",
    "drive",
    "A digital input of the drive is on: a switch, a touch probe.",
    "switching it on",
    DigitalInput,
    {"input": ParamSpec("whole number", "Which one, from 0.", required=True, low=0, high=31)},
    takes=HELD,
    place=120,
    wire="The input's bits in the drive's words and parameters, as far as its telegram has them.",
    reports="The bus reports nothing.",
)
