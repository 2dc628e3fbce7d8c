"""not-ready: something that the drive needs is taken away."""

from __future__ import annotations

from pnfarm.faults.effects.confirmed import Held, StandingEffect
from pnfarm.faults.effects.connection import Status
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

__all__ = ["KIND"]


class NotReady(StandingEffect):
    """Without a fault, the drive cannot be switched on."""

    servo = SERVO
    status = Status.INHIBITED

    def held(self) -> Held:
        return self.servo.lacks, str(self.values["missing"])


KIND = InjectionKind(
    "not-ready",
    "drive",
    "Something that the drive needs is taken away, without a fault: it coasts, and cannot be switched on before this "
    "ends.",
    "taking it away",
    NotReady,
    {
        "missing": ParamSpec(
            "word",
            "The hardware enable (ENPO of a Moog MSD, DRV.HWENABLE of an AKD), or the power supply of the DC link.",
            default="enable",
            words={"enable": 0, "supply": 1},
        )
    },
    takes=HELD,
    place=110,
    wire="ZSW1.6 (switching on inhibited) is set, ZSW1.0 to 1.2 fall.",
    reports="The bus reports nothing: the PLC program sees it in ZSW1.",
)
