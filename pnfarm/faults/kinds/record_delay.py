"""record-delay: answers to Read and Write come late, so that the drive's application seems slow."""

from __future__ import annotations

from pnfarm.faults.effects.late import LATE_PARAMS, LateEffect
from pnfarm.faults.effects.requests import PARAMETER_ACCESS
from pnfarm.faults.kind import EACH, InjectionKind

__all__ = ["KIND"]


class RecordDelay(LateEffect):
    """As its bus holds back answers."""

    records = PARAMETER_ACCESS

    def put(self) -> None:
        self.records.delay_answers(self)

    def end(self, now: int) -> None:
        self.records.stop_delay(self, now)


KIND = InjectionKind(
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
)
