"""Effects that put a setting of a slave in force, and take it back at their end."""

from __future__ import annotations

from typing import Any, ClassVar

from pnfarm.buses.profibus.faults.slave import SLAVE
from pnfarm.faults.effects.effect import POLL_NS, Effect

__all__ = ["SlaveEffect"]


class SlaveEffect(Effect):
    """``what`` as in :meth:`~pnfarm.buses.profibus.faults.slave.SlavePart.put`."""

    slave = SLAVE
    what: ClassVar[str]

    def value(self) -> Any:
        """The setting; not None."""
        return True

    def seen(self) -> int:
        """A count that grows once the master met it: that of the diagnoses that it has read."""
        return self.slave.diagnoses_read

    def begin(self, now: int) -> None:
        self._before = self.seen()
        self._value = self.value()
        self.slave.put(self.what, self._value, now)
        self.tally.note(now)
        self._due = now + POLL_NS

    def check(self, now: int) -> None:
        if self._due is None:
            return
        self._due = now + POLL_NS
        if self.seen() > self._before:
            self.tally.confirm()
            self._due = None

    def end(self, now: int) -> None:
        self._due = None
        if self.seen() > self._before:
            self.tally.confirm()
        self.slave.take_back(self.what, self._value, now)
