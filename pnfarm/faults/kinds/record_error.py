"""record-error: the drive's own records are refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.effect import Effect, Tally, Window
from pnfarm.faults.effects.requests import PARAMETER_ACCESS
from pnfarm.faults.kind import InjectionKind

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class Refusal(Effect):
    """Of each request, up to ``count``."""

    needs = (PARAMETER_ACCESS,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._records = drive.part(PARAMETER_ACCESS)
        self._tally = Tally()
        self._given = 0
        self._in_force = False
        self._error = self._records.error(self.values, self._refused)

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self._in_force = True
        self._records.refuse_records(self._error)

    def _refused(self) -> None:
        self._given += 1
        if self.spec.count is not None and self._tally.seen.activations + self._given >= self.spec.count:
            self._allow()

    def _allow(self) -> None:
        if self._in_force:
            self._in_force = False
            self._records.allow_records(self._error)

    def check(self, now: int) -> None:
        for _ in range(self._given):
            self._tally.note(now, confirmed=True)
        self._given = 0
        self.finished = not self._in_force

    def end(self, now: int) -> None:
        self.check(now)
        self._allow()

    def evidence(self) -> Evidence:
        return self._tally.seen


KINDS = (
    InjectionKind(
        "record-error",
        "records",
        "Requests for the drive's parameters are refused, with an error code of its bus.",
        "a request that is refused",
        Refusal,
        takes=frozenset({"count", "for"}),
        place=10,
        wire="Requests for parameters are answered with an error code.",
        reports="The program's acyclic job (RDREC, WRREC) ends with the error code in STATUS.",
    ),
)
