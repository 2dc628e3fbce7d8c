"""Effects that are confirmed by a cyclic frame which left after them."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from pnfarm.faults.frames import Effect, Tally, Window

if TYPE_CHECKING:
    from pnfarm.faults.plan import FaultSpec
    from pnfarm.faults.target import Evidence, FaultTarget

__all__ = ["ShownEffect", "StandingEffect"]


class ShownEffect(Effect):
    """What a cyclic frame that left since confirms; if there is a ``bit``, one with that bit of ZSW1 set."""

    bit: int | None = None

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._tally = Tally()
        self._look_since: int | None = None
        self._due: int | None = None

    def _occurred(self, now: int) -> None:
        self._tally.note(now)
        self._look_since = now
        self._look(now)

    def _look(self, now: int) -> None:
        """Was it seen on the wire?  Ask again a cycle later if not."""
        self._due = None
        if self._look_since is None:
            return
        # a frame of the very instant was filled before the drive took the fault
        since = self._look_since + 1
        seen = self.target.sent_data(since) if self.bit is None else self.target.sent_status(self.bit, since)
        if seen:
            self._tally.confirm()
            self._look_since = None
            return
        connection = self.target.connection()
        if connection is not None:
            self._due = now + max(connection.cycle_ns, 1_000_000)

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due


class StandingEffect(ShownEffect):
    """What is put on the drive once and stands there until the fault ends."""

    _stands = False

    @abstractmethod
    def put(self) -> None:
        """Do it."""

    @abstractmethod
    def take(self) -> None:
        """Undo it."""

    def begin(self, window: Window, now: int) -> None:
        del window
        self.put()
        self._stands = True
        self._occurred(now)

    def check(self, now: int) -> None:
        self._look(now)

    def end(self, now: int) -> None:
        self._look(now)
        self._due = None
        if self._stands:
            self._stands = False
            self.take()
