"""Effects that the controller is informed of: by an alarm, or when it connects."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults.alarms import ALARMS
from pnfarm.buses.profinet.faults.modules import MODULES
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import POLL_NS, Effect

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.cm.device.events import AlarmConfirmed

__all__ = ["ReportedEffect"]


class ReportedEffect(Effect):
    """Confirmed by the AlarmAck of an alarm that came after its start, or by a later AR's ModuleDiffBlock."""

    connection = CONNECTION
    alarms = ALARMS
    modules = MODULES
    _standing: frozenset[int] = frozenset()
    _listening = False

    @abstractmethod
    def _change(self, now: int) -> None:
        """Let the drive do what the alarm reports."""

    @abstractmethod
    def _restore(self, now: int) -> None:
        """Undo it."""

    def begin(self, now: int) -> None:
        connection = self.connection.now()
        self._standing = connection.keys if connection is not None else frozenset()
        self._mark = self.alarms.last_number
        self.alarms.listen(self._hear)
        self._listening = True
        try:
            self._change(now)
        except BaseException:
            self._deaf()
            raise
        self.tally.note(now)
        self.check(now)

    def _hear(self, event: AlarmConfirmed, now: int) -> None:
        # a drive that booted restarts its alarm numbers; its alarms then are about this injection, too
        if (event.number > self._mark or self.alarms.last_number < self._mark) and self._is_about(event):
            self._confirm()
        del now

    @abstractmethod
    def _is_about(self, event: AlarmConfirmed) -> bool:
        """Whether this alarm reports it."""

    @abstractmethod
    def _is_in_diff(self) -> bool:
        """Whether a ModuleDiffBlock reports it."""

    def _confirm(self) -> None:
        self.tally.confirm()
        self._deaf()

    def _deaf(self) -> None:
        if self._listening:
            self._listening = False
            self.alarms.stop_listening(self._hear)
        self._due = None

    def check(self, now: int) -> None:
        if self._listening:
            if self._is_in_diff():
                self._confirm()
            else:
                self._due = now + POLL_NS

    def end(self, now: int) -> None:
        self.check(now)
        self._deaf()
        self._restore(now)
