"""Effects that end connections, one after the other."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import Chance, Effect, Window

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Needs
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["BreakingEffect"]


class BreakingEffect(Effect):
    """Aborts each connection that reaches data exchange; without ``count`` and ``for`` only one."""

    needs: ClassVar[Needs] = (CONNECTION,)
    ends_by_itself = True

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._connection = drive.part(CONNECTION)
        self._chance = Chance(spec, drive, spec.count if spec.count or spec.for_ns else 1)
        self._passed: frozenset[int] = frozenset()

    def begin(self, window: Window, now: int) -> None:
        del window
        self.check(now)

    def check(self, now: int) -> None:
        connection = self._connection.now()
        if self.finished or connection is None or not connection.established or connection.keys & self._passed:
            return
        self._passed = connection.keys
        happens = self._chance.happens()
        if happens:
            happens = self.break_off(now) > 0
        self._chance.tally.note(now, happened=happens, confirmed=happens)
        self.finished = self._chance.exhausted

    @abstractmethod
    def break_off(self, now: int) -> int:
        """Do it; returns how many connections ended."""

    def evidence(self) -> Evidence:
        return self._chance.tally.seen
