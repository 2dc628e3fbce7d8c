"""Effects that are confirmed by a cyclic frame which left after them."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import Effect, Held

if TYPE_CHECKING:
    from pnfarm.faults.effects.connection import Status

__all__ = ["ConfirmedEffect", "Held", "StandingEffect"]


#: Cycles within which a drive shows in its frames what was done to it: its firmware steps and sends once in each.
SHOWN_WITHIN = 4


class ConfirmedEffect(Effect):
    """Confirmed by a cyclic frame that left since; if there is a ``status``, by one that reports it."""

    connection = CONNECTION
    status: Status | None = None
    #: Whether frames without the status contradict the injection; if not, they are not checked any more.
    must_show: ClassVar[bool] = True
    _look_since: int | None = None
    #: When a frame that left since did not report the status, for the first time.
    _missed_ns: int | None = None

    def _occurred(self, now: int) -> None:
        self.tally.note(now)
        self._look_since = now
        self._missed_ns = None
        self._look(now)

    def _look(self, now: int) -> None:
        """Check whether it was seen on the wire; if not, check again a cycle later."""
        self._due = None
        if self._look_since is None:
            return
        # a frame of the same instant was filled before the drive took the fault
        since = self._look_since + 1
        if self.status is None:
            seen = self.connection.sent_data(since)
        else:
            seen = self.connection.sent_status(self.status, since)
        if seen:
            self.tally.confirm()
            self._look_since = None
            return
        connection = self.connection.now()
        if self.status is not None and not self.connection.reports(self.status):
            # nothing that leaves can show it
            return
        if connection is not None and self.status is not None and self.connection.sent_data(since):
            self._missed_ns = now if self._missed_ns is None else self._missed_ns
            if now - self._missed_ns >= SHOWN_WITHIN * connection.cycle_ns:
                if not self.must_show:
                    self._look_since = None
                    return
                self.tally.contradict(f"cyclic frames left since, and none reports {self.status.value}")
        if connection is not None:
            self._due = now + max(connection.cycle_ns, 1_000_000)


class StandingEffect(ConfirmedEffect):
    """Applied to the drive once; stays until the injection ends."""

    def begin(self, now: int) -> None:
        self.put()
        self._occurred(now)

    def check(self, now: int) -> None:
        self._look(now)

    def end(self, now: int) -> None:
        self._look(now)
        self._due = None
        self.take()
