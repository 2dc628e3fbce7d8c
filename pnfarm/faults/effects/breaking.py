"""Effects that end connections, one after the other."""

from __future__ import annotations

from abc import abstractmethod

from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import ChanceEffect

__all__ = ["BreakingEffect"]


class BreakingEffect(ChanceEffect):
    """Aborts each connection that reaches data exchange; without ``count`` and ``for`` only one."""

    connection = CONNECTION
    once = ends_by_itself = True
    _passed: frozenset[int] = frozenset()

    def begin(self, now: int) -> None:
        self.check(now)

    def check(self, now: int) -> None:
        connection = self.connection.now()
        if self.finished or connection is None or not connection.established or connection.keys & self._passed:
            return
        self._passed = connection.keys
        happens = self.happens() and self.break_off(now) > 0
        self.tally.note(now, happened=happens, confirmed=happens)
        self.finished = self.exhausted

    @abstractmethod
    def break_off(self, now: int) -> int:
        """Do it; returns how many connections ended."""
