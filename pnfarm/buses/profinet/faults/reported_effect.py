"""Effects that the controller is informed of: by an alarm, or when it connects."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

from pnfarm.buses.profinet.faults.alarms import ALARMS
from pnfarm.buses.profinet.faults.modules import MODULES
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import POLL_NS, Effect, Tally

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Needs
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.protocols.profinet.cm.device.events import AlarmConfirmed

__all__ = ["ReportedEffect"]


class ReportedEffect(Effect):
    """Confirmed by the AlarmAck of an alarm that came after its begin, or by a later AR's ModuleDiffBlock."""

    needs: ClassVar[Needs] = (CONNECTION, ALARMS, MODULES)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._connection = drive.part(CONNECTION)
        self._alarms = drive.part(ALARMS)
        self._modules = drive.part(MODULES)
        self._tally = Tally()
        self._standing: frozenset[int] = frozenset()
        self._mark = 0
        self._due: int | None = None
        self._listening = False

    def _watch(self) -> None:
        """Call it before the drive does what the alarm reports."""
        connection = self._connection.now()
        self._standing = connection.keys if connection is not None else frozenset()
        self._mark = self._alarms.last_number
        self._alarms.listen(self._hear)
        self._listening = True

    def _hear(self, event: AlarmConfirmed, now: int) -> None:
        # a drive that booted restarts its alarm numbers; its alarms then are about this injection, too
        if (event.number > self._mark or self._alarms.last_number < self._mark) and self._is_about(event):
            self._confirm()
        del now

    @abstractmethod
    def _is_about(self, event: AlarmConfirmed) -> bool:
        """Whether this alarm reports it."""

    @abstractmethod
    def _is_in_diff(self) -> bool:
        """Whether a ModuleDiffBlock reports it."""

    def _confirm(self) -> None:
        self._tally.confirm()
        self._deaf()

    def _deaf(self) -> None:
        if self._listening:
            self._listening = False
            self._alarms.stop_listening(self._hear)
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

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due
