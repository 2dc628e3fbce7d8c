"""record-error: the drive's own records are refused."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults.records import RECORDS
from pnfarm.faults.effect import Effect, Tally, Window
from pnfarm.faults.kind import OCTET, InjectionKind, ParamSpec, words_of
from pnfarm.protocols.profinet.errors import AccessError, PnioStatus, RecordError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.faults.evidence import Evidence
    from pnfarm.faults.given import GivenInjection
    from pnfarm.faults.parts import InjectedDrive

__all__ = ["KINDS"]


@dataclass(frozen=True, slots=True)
class _CountedError(RecordError):
    """An error code that counts its uses."""

    given: Callable[[], None] = field(kw_only=True)

    def status(self, service: int) -> PnioStatus:
        self.given()
        # a dataclass with slots is made twice, so that a bare super() would look for the first
        return RecordError.status(self, service)


class Refusal(Effect):
    """Of each Read and Write, up to ``count``."""

    needs = (RECORDS,)

    def __init__(self, spec: GivenInjection, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._records = drive.part(RECORDS)
        self._tally = Tally()
        self._given = 0
        self._in_force = False
        self._error = _CountedError(self.values["code"], self.values["code2"], given=self._refused)

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
        "The drive's own records (parameter access) are refused (PNIOStatus DE or DF 80 and two codes).",
        "a record access that is refused",
        Refusal,
        {
            "code": ParamSpec(
                "whole number", "ErrorCode1.", default="module-failure", words=words_of(AccessError), **OCTET
            ),
            "code2": ParamSpec("whole number", "ErrorCode2.", default=0, **OCTET),
        },
        takes=frozenset({"count", "for"}),
        place=10,
        wire="Read and write responses with the error code in PNIO status.",
        reports="The program's acyclic job (RDREC, WRREC) ends with the error code in STATUS.",
    ),
)
