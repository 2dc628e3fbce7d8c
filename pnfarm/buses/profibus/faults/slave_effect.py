"""Effects that put a setting of a slave in force, and take it back at their end."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

from pnfarm.buses.profibus.faults.slave import SLAVE
from pnfarm.faults.effects.effect import POLL_NS, Effect, Tally, Window

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["SlaveEffect"]


class SlaveEffect(Effect):
    """``what`` as in :meth:`~pnfarm.buses.profibus.faults.slave.SlavePart.put`."""

    needs = (SLAVE,)
    what: ClassVar[str]

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self.slave = drive.part(SLAVE)
        self._tally = Tally()
        self._put: Any = None
        self._before = 0
        self._due: int | None = None

    @abstractmethod
    def value(self) -> Any:
        """The setting; not None."""

    @abstractmethod
    def seen(self) -> int:
        """A count that grows once the master met it."""

    def begin(self, window: Window, now: int) -> None:
        del window
        self._before = self.seen()
        self._put = self.value()
        self.slave.put(self.what, self._put, now)
        self._tally.note(now)
        self._due = now + POLL_NS

    def check(self, now: int) -> None:
        if self._due is None:
            return
        if self.seen() > self._before:
            self._tally.confirm()
            self._due = None
        else:
            self._due = now + POLL_NS

    def end(self, now: int) -> None:
        self._due = None
        if self._put is not None:
            put, self._put = self._put, None
            if self.seen() > self._before:
                self._tally.confirm()
            self.slave.take_back(self.what, put, now)

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due
