"""session-drop: the drive closes the streams of its peers."""

from __future__ import annotations

from pnfarm.faults.effects.effect import POLL_NS, ChanceEffect
from pnfarm.faults.effects.sockets import SOCKETS
from pnfarm.faults.kind import EACH, InjectionKind

__all__ = ["KIND"]


class SessionDrop(ChanceEffect):
    """Each stream once the drive has answered on it; without ``count`` and ``for`` one."""

    sockets = SOCKETS
    once = ends_by_itself = True
    _passed: frozenset[int] = frozenset()

    def begin(self, now: int) -> None:
        self.check(now)

    def check(self, now: int) -> None:
        sessions = self.sockets.sessions()
        self._passed &= frozenset(sessions)
        for stream in sessions:
            if stream not in self._passed and not self.exhausted:
                self._passed |= {stream}
                if self.occurs(now):
                    self.sockets.close(stream, now)
        self._due = None if self.finished else now + POLL_NS


KIND = InjectionKind(
    "session-drop",
    "connection",
    "The drive closes the TCP connection of a session, each one after it has answered there for the first time.",
    "a TCP connection that is closed; without `count` and `for` it happens once",
    SessionDrop,
    takes=EACH,
    place=92,
    wire="A FIN of the drive; a message on its way gets no answer.",
    reports="The session ends, and is set up again; messages that had no answer fail or are sent again.",
)
