"""session-drop: the drive closes the streams of its peers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.effect import POLL_NS, Chance, Effect, Window
from pnfarm.faults.effects.sockets import SOCKETS
from pnfarm.faults.kind import EACH, InjectionKind

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class SessionDrop(Effect):
    """Each stream once the drive has answered on it; without ``count`` and ``for`` one."""

    needs = (SOCKETS,)
    ends_by_itself = True

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._sockets = drive.part(SOCKETS)
        self._chance = Chance(spec, drive, spec.count if spec.count or spec.for_ns else 1)
        self._passed: set[int] = set()
        self._due: int | None = None

    def begin(self, window: Window, now: int) -> None:
        del window
        self.check(now)

    def check(self, now: int) -> None:
        sessions = self._sockets.sessions()
        self._passed.intersection_update(sessions)
        for stream in sessions:
            if stream in self._passed or self._chance.exhausted:
                continue
            self._passed.add(stream)
            happens = self._chance.happens()
            self._chance.tally.note(now, happened=happens, confirmed=happens)
            if happens:
                self._sockets.close(stream, now)
        self.finished = self._chance.exhausted
        self._due = None if self.finished else now + POLL_NS

    def evidence(self) -> Evidence:
        return self._chance.tally.seen

    def next_deadline(self) -> int | None:
        return self._due


KINDS = (
    InjectionKind(
        "session-drop",
        "connection",
        "The drive closes the TCP connection of a session, each one after it has answered there for the first time.",
        "a TCP connection that is closed; without `count` and `for` it happens once",
        SessionDrop,
        takes=EACH,
        place=92,
        wire="A FIN of the drive; a message on its way gets no answer.",
        reports="The session ends, and is set up again; messages that had no answer fail or are sent again.",
    ),
)
