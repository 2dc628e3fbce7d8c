"""rpc-delay: acyclic messages leave late, so that the drive's stack seems slow."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.late import LATE_PARAMS, LateEffect
from pnfarm.faults.effects.wire import MESSAGES
from pnfarm.faults.gate.gate import DelayRule
from pnfarm.faults.kind import EACH, InjectionKind

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Window
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class RpcDelay(LateEffect):
    """Delayed on the way to the link."""

    needs = (MESSAGES,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._wire = drive.part(MESSAGES)
        self._rule = DelayRule(self._wire.messages, self)

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self._wire.delay(self._rule)

    def end(self, now: int) -> None:
        del now
        self._wire.undelay(self._rule)


KINDS = (
    InjectionKind(
        "rpc-delay",
        "connection",
        "Acyclic messages of the drive (connections, parameters, control) leave late, in order.",
        "a message that is late",
        RpcDelay,
        LATE_PARAMS,
        takes=EACH,
        place=100,
        wire="UDP datagrams of the drive are late, in order.",
        reports="A slower start-up; requests are repeated when the delay exceeds the controller's retry time.",
    ),
)
