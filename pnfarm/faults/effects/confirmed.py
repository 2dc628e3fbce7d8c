"""Effects that are confirmed by a cyclic frame which left after them."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import Effect, Tally, Window
from pnfarm.faults.effects.servo import SERVO

if TYPE_CHECKING:
    from pnfarm.faults.effects.connection import Status
    from pnfarm.faults.effects.effect import Needs
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["ConfirmedEffect", "StandingEffect"]


#: Cycles within which a drive shows in its frames what was done to it: its firmware steps and sends once in each.
SHOWN_WITHIN = 4


class ConfirmedEffect(Effect):
    """Confirmed by a cyclic frame that left since; if there is a ``status``, by one that reports it."""

    needs: ClassVar[Needs] = (SERVO, CONNECTION)
    status: Status | None = None
    #: Whether frames without the status contradict the injection.
    must_show: ClassVar[bool] = True

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._servo = drive.part(SERVO)
        self._connection = drive.part(CONNECTION)
        self._tally = Tally()
        self._look_since: int | None = None
        #: When a frame that left since did not report the status, for the first time.
        self._missed_ns: int | None = None
        self._due: int | None = None

    def _occurred(self, now: int) -> None:
        self._tally.note(now)
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
            seen = self._connection.sent_data(since)
        else:
            seen = self._connection.sent_status(self.status, since)
        if seen:
            self._tally.confirm()
            self._look_since = None
            return
        connection = self._connection.now()
        if self.status is not None and not self._connection.reports(self.status):
            # nothing that leaves can show it
            return
        if connection is not None and self.must_show and self.status is not None and self._connection.sent_data(since):
            self._missed_ns = now if self._missed_ns is None else self._missed_ns
            if now - self._missed_ns >= SHOWN_WITHIN * connection.cycle_ns:
                self._tally.contradict(f"cyclic frames left since, and none reports {self.status.value}")
        if connection is not None:
            self._due = now + max(connection.cycle_ns, 1_000_000)

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due


class StandingEffect(ConfirmedEffect):
    """Applied to the drive once; stays until the injection ends."""

    _applied = False

    @abstractmethod
    def put(self) -> None:
        """Do it."""

    @abstractmethod
    def take(self) -> None:
        """Undo it."""

    def begin(self, window: Window, now: int) -> None:
        del window
        self.put()
        self._applied = True
        self._occurred(now)

    def check(self, now: int) -> None:
        self._look(now)

    def end(self, now: int) -> None:
        self._look(now)
        self._due = None
        if self._applied:
            self._applied = False
            self.take()
