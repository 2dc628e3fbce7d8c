"""Alarms that a PROFINET drive does not send by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.parts import DrivePart, Part
from pnfarm.protocols.profinet.cm.device.events import AlarmConfirmed
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmType
from pnfarm.table.impairment import IOPS_BAD

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.buses.profinet.faults.connection import ArKeys
    from pnfarm.engine.channels.impairments import ImpairmentTable
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.cm.device.events import CmEvent
    from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem

__all__ = ["ALARMS", "Alarms", "OwnAlarm"]

#: Alarms that report to a controller that a submodule is gone, or that it waits for parameters.
_MOVES = frozenset({
    AlarmType.PULL, AlarmType.PULL_MODULE, AlarmType.PLUG, AlarmType.PLUG_WRONG_SUBMODULE,
    AlarmType.CONTROLLED_BY_SUPERVISOR, AlarmType.RELEASED,
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class OwnAlarm:
    """An alarm that an injection raises about the submodule at ``place``."""

    alarm_type: int
    place: ExpectedKey
    high: bool = False
    items: tuple[AlarmItem, ...] = ()


class Alarms(DrivePart):
    """Sends alarms, and watches what the controllers acknowledge."""

    def __init__(
        self, station: ProfinetDevice, impairments: ImpairmentTable, keys: ArKeys, settle: Callable[[int], None]
    ) -> None:
        self._station = station
        self._impairments = impairments
        self._keys = keys
        self._settle = settle
        self._hooks: list[Callable[[AlarmConfirmed, int], None]] = []
        #: ARs that got an alarm about a submodule that came or went.
        self._to_correct: dict[ExpectedKey, set[int]] = {}

    def in_force(self) -> list[Any]:
        return [*self._hooks, *self._to_correct]

    def listen(self, hook: Callable[[AlarmConfirmed, int], None]) -> None:
        """Call ``hook`` for each AlarmAck of a controller."""
        self._hooks.append(hook)
        if self._hear not in self._station.connections.listeners:
            self._station.connections.listeners.append(self._hear)

    def stop_listening(self, hook: Callable[[AlarmConfirmed, int], None]) -> None:
        """Remove it."""
        self._hooks.remove(hook)
        if not self._hooks:
            self._station.connections.listeners.remove(self._hear)

    def _hear(self, event: CmEvent, now: int) -> None:
        if isinstance(event, AlarmConfirmed):
            for hook in list(self._hooks):
                hook(event, now)

    @property
    def last_number(self) -> int:
        """The number of the latest alarm; later ones have greater numbers, until the drive reboots."""
        return self._station.cm.alarms.last_number

    def send(self, alarm: OwnAlarm, now: int) -> tuple[int, ...] | None:
        """To each AR that owns the place; the alarms' numbers, None when no AR could get one."""
        cm = self._station.cm
        if not any(alarm.place in ar.owned and ar.alarm_cr is not None for ar in cm.ars):
            return None
        if alarm.alarm_type in _MOVES:
            owners = (self._keys.unique(ar.key) for ar in cm.ars if alarm.place in ar.owned)
            self._to_correct.setdefault(alarm.place, set()).update(owners)
        numbers = cm.alarm(alarm.alarm_type, alarm.place, now, items=alarm.items, high=alarm.high)
        self._settle(now)
        return numbers

    def correct(self, alarm: OwnAlarm, now: int) -> None:
        """Undo :meth:`send`: ARs that got an alarm of a plugged or pulled submodule get one with its true state."""
        owners = self._to_correct.pop(alarm.place, set())
        for ar in self._station.cm.ars:
            if self._keys.unique(ar.key) in owners:
                self._station.cm.replug(ar.key, alarm.place, now)
        self._settle(now)

    def return_of_submodules(self, last_ns: int, now: int) -> int:
        """Send return alarms: the IOPS of the submodules with data are GOOD again; returns how many.

        ``last_ns``: the last frame in which they were BAD.  Later connections get none, and none are sent while
        an impairment still makes the IOPS BAD.
        """
        if self._impairments.has(self._station.index, "out", IOPS_BAD):
            return 0
        places = {
            key
            for ar in self._station.ars.values()
            if ar.established and ar.connected_ns <= last_ns
            for _, cr in ar.providers
            for data in cr.data
            if data.data_length and (key := (data.api, data.slot, data.subslot)) not in ar.bad
        }
        numbers = [self._station.cm.alarm(AlarmType.RETURN_OF_SUBMODULE, place, now) for place in sorted(places)]
        self._settle(now)
        return sum(map(len, numbers))


ALARMS: Part[Alarms] = Part("alarms of PROFINET")
