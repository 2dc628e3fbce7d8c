"""parameter-busy: the drive still works on a parameter request."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults.records import RECORDS
from pnfarm.faults.effects.effect import Chance, Effect, Window
from pnfarm.faults.kind import EACH, InjectionKind

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class ParameterBusy(Effect):
    """Each read of a response that is ready."""

    needs = (RECORDS,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._records = drive.part(RECORDS)
        self._chance = Chance(spec, drive, spec.count)

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self._records.hold_responses(self._asked)

    def _asked(self, now: int) -> bool:
        if self.finished:
            return False
        happens = self._chance.happens()
        self._chance.tally.note(now, happened=happens, confirmed=happens)
        self.finished = self._chance.exhausted
        return happens

    def end(self, now: int) -> None:
        del now
        self._records.release_responses(self._asked)

    def evidence(self) -> Evidence:
        return self._chance.tally.seen


KINDS = (
    InjectionKind(
        "parameter-busy",
        "records",
        "The drive still works on a parameter request: reading the response gets a state conflict (B5).",
        "a response that is held back",
        ParameterBusy,
        takes=EACH,
        place=20,
        wire="Reads of the parameter response are answered with the PNIO status of a state conflict (B5).",
        reports="The bus reports nothing: the program reads again until its job times out.",
    ),
)
