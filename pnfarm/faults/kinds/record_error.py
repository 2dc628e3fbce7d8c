"""record-error: the drive's own records are refused."""

from __future__ import annotations

from pnfarm.faults.effects.effect import Effect
from pnfarm.faults.effects.requests import PARAMETER_ACCESS
from pnfarm.faults.kind import InjectionKind

__all__ = ["KIND"]


class Refusal(Effect):
    """Of each request, up to ``count``."""

    records = PARAMETER_ACCESS
    _given = 0
    _in_force = False

    def prepare(self) -> None:
        self._error = self.records.error(self.values, self._refused)

    def put(self) -> None:
        self._in_force = True
        self.records.errors.put(self._error)

    def _refused(self) -> None:
        self._given += 1
        if self.spec.count is not None and self.tally.seen.activations + self._given >= self.spec.count:
            self.take()

    def take(self) -> None:
        if self._in_force:
            self._in_force = False
            self.records.errors.take(self._error)

    def check(self, now: int) -> None:
        for _ in range(self._given):
            self.tally.note(now, confirmed=True)
        self._given = 0
        self.finished = not self._in_force

    def end(self, now: int) -> None:
        self.check(now)
        self.take()


KIND = InjectionKind(
    "record-error",
    "records",
    "Requests for the drive's parameters are refused, with an error code of its bus.",
    "a request that is refused",
    Refusal,
    takes=frozenset({"count", "for"}),
    place=10,
    wire="Requests for parameters are answered with an error code.",
    reports="The program's acyclic job (RDREC, WRREC) ends with the error code in STATUS.",
)
