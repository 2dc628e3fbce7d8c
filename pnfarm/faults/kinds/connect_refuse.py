"""connect-refuse: the drive refuses connections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.effect import Chance, Effect, Window
from pnfarm.faults.effects.requests import CONNECT_REQUESTS
from pnfarm.faults.kind import EACH, InjectionKind

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class ConnectRefuse(Effect):
    """Each request for cyclic data, as the drive's bus refuses it."""

    needs = (CONNECT_REQUESTS,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._requests = drive.part(CONNECT_REQUESTS)
        self._chance = Chance(spec, drive, spec.count)
        self._refusal = self._requests.refusal(self.values)

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self._requests.hook_connect(self._asked)

    def _asked(self, now: int) -> Any:
        if self.finished:
            return None
        happens = self._chance.happens()
        self._chance.tally.note(now, happened=happens, confirmed=happens)
        self.finished = self._chance.exhausted
        return self._refusal if happens else None

    def end(self, now: int) -> None:
        del now
        self._requests.unhook_connect(self._asked)

    def evidence(self) -> Evidence:
        return self._chance.tally.seen


KINDS = (
    InjectionKind(
        "connect-refuse",
        "connection",
        "The drive refuses connections, with an error code of its bus.",
        "a request for a connection that is refused",
        ConnectRefuse,
        takes=EACH,
        place=20,
        wire="Requests for a connection are answered with an error code.",
        reports=(
            "The device stays failed; the diagnosis shows the connection as refused. A controller tries repeatedly."
        ),
    ),
)
