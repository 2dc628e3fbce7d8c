"""record-delay: answers to Read and Write come late, so that the drive's application seems slow."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.late import LATE_PARAMS, LateEffect
from pnfarm.faults.effects.requests import PARAMETER_ACCESS
from pnfarm.faults.kind import EACH, InjectionKind

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Window
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class RecordDelay(LateEffect):
    """As its bus holds back answers."""

    needs = (PARAMETER_ACCESS,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._records = drive.part(PARAMETER_ACCESS)

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self._records.delay_answers(self)

    def end(self, now: int) -> None:
        self._records.stop_delay(self, now)


KINDS = (
    InjectionKind(
        "record-delay",
        "records",
        "The drive answers requests for its parameters late.",
        "an answer that is late",
        RecordDelay,
        LATE_PARAMS,
        takes=EACH,
        place=30,
        wire="Parameter responses are late.",
        reports="The bus reports nothing: the program's acyclic job takes longer.",
    ),
)
