"""forward-open-delay: Forward_Open is answered late."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.faults.frames import CIP_FRAMES
from pnfarm.buses.ethernetip.faults.messages import OPEN
from pnfarm.faults.effects.late import LATE_PARAMS, LateEffect
from pnfarm.faults.gate.gate import DelayRule
from pnfarm.faults.kind import EACH, InjectionKind

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Window
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class ForwardOpenDelay(LateEffect):
    """Whatever the answer says."""

    needs = (CIP_FRAMES,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._wire = drive.part(CIP_FRAMES)
        self._rule = DelayRule(frozenset({OPEN}), self)

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self._wire.delay(self._rule)

    def end(self, now: int) -> None:
        del now
        self._wire.undelay(self._rule)


KINDS = (
    InjectionKind(
        "forward-open-delay",
        "connection",
        "Answers to Forward_Open and Large_Forward_Open leave late, and behind them all that follows on the same TCP "
        "connection.  The drive's own end of the connection is open before the answer leaves.",
        "an answer that is late",
        ForwardOpenDelay,
        LATE_PARAMS,
        takes=EACH,
        place=42,
        wire="The answer is late; with a connection accepted, the drive's cyclic packets come before it.",
        reports=(
            "A slower start-up. Beyond the scanner's own time it gives up and asks again, with another serial number "
            "(Logix: module fault 16#0204, connection request timed out; CODESYS the same state (assumed)); the drive "
            "then still has the first connection until its timeout, and refuses the second one as an owner's."
        ),
    ),
)
