"""The part of a fault's target that is context management: modules, alarms, diagnosis, late answers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults.modules import Diagnoses, SlotChanges, SlowAnswers, place_of
from pnfarm.protocols.profinet.events import AlarmConfirmed
from pnfarm.protocols.profinet.wire.alarms import AlarmType
from pnfarm.protocols.profinet.wire.blocks_expected import ModuleState
from pnfarm.table.impairment import IOPS_BAD

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profinet.device.station import DriveStation
    from pnfarm.farm.core import FarmCore
    from pnfarm.faults.target import LateRule, ModuleChange, OwnAlarm
    from pnfarm.protocols.profinet.ar import Ar, ExpectedKey
    from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
    from pnfarm.protocols.profinet.events import CmEvent

__all__ = ["CmTarget"]

#: Advice, maintenance required, maintenance demanded and fault, in SubmoduleState.
_DIAGNOSIS_BITS = 0x0078
#: Alarms from which a controller takes that a submodule is gone, or that it waits for parameters.
_MOVES = frozenset({
    AlarmType.PULL, AlarmType.PULL_MODULE, AlarmType.PLUG, AlarmType.PLUG_WRONG_SUBMODULE,
    AlarmType.CONTROLLED_BY_SUPERVISOR, AlarmType.RELEASED,
})  # fmt: skip


class CmTarget:
    """See :class:`~pnfarm.faults.target.FaultTarget`; the rest of it is :class:`~.fault_targets.StationTarget`'s."""

    def __init__(self, core: FarmCore, station: DriveStation) -> None:
        self._core = core
        self._station = station
        self._changes = SlotChanges(station)
        self._diagnoses = Diagnoses(station)
        self._slow = SlowAnswers(station)
        self._alarm_hooks: list[Callable[[AlarmConfirmed, int], None]] = []
        self._cm = station.cm
        self._boots = 0
        #: ARs that a fault's alarm told that a submodule came or went.
        self._misled: dict[ExpectedKey, set[int]] = {}

    def _unique(self, key: int) -> int:
        """The key of an AR, other than that of any AR before: a drive that boots begins its keys anew."""
        if self._station.cm is not self._cm:
            self._cm = self._station.cm
            self._boots += 1
        return self._boots << 32 | key

    def _settle(self, now: int) -> None:
        self._core.settle(self._station, now)

    def _rebooted(self, now: int) -> None:
        """The drive has new machines: what is in force goes into them."""
        self._slow.rebooted()
        self._changes.rebooted(now)
        self._diagnoses.put()

    # the connection

    def expire(self, now: int) -> int:
        ended = 0
        for key, ar in list(self._station.ars.items()):
            if ar.established and ar.consumers:
                row, cr = ar.consumers[0]
                # what the drive would say: silence for as long as its timer takes
                self._station.connections.expired(row, cr.data_hold_ns, now)
                ended += key not in {a.key for a in self._station.cm.ars}
        self._settle(now)
        return ended

    def delay_answers(self, rule: LateRule) -> None:
        self._slow.add(rule)

    def answer_in_time(self, rule: LateRule, now: int) -> None:
        self._slow.remove(rule, now)
        self._settle(now)

    # modules

    def place(self, slot: int | None, subslot: int | None) -> ExpectedKey:
        return place_of(self._station, slot, subslot)

    def change_module(self, change: ModuleChange, now: int) -> None:
        self._changes.check(change)
        self._changes.add(change, now)
        self._diagnoses.put()
        self._settle(now)

    def unchange_module(self, change: ModuleChange, now: int) -> None:
        self._changes.remove(change, now)
        self._diagnoses.put()
        self._settle(now)

    def told_at_connect(
        self, slot: int, subslot: int | None, standing: frozenset[int], *, diagnosis: bool = False
    ) -> bool:
        for key, channels in self._station.ars.items():
            ar = self._station.cm.ar(key)
            later = ar is not None and channels.established and self._unique(key) not in standing
            if ar is not None and later and _names(ar, slot, subslot, diagnosis=diagnosis):
                return True
        return False

    # alarms

    def listen(self, hook: Callable[[AlarmConfirmed, int], None]) -> None:
        self._alarm_hooks.append(hook)
        if self._hear not in self._station.connections.listeners:
            self._station.connections.listeners.append(self._hear)

    def unlisten(self, hook: Callable[[AlarmConfirmed, int], None]) -> None:
        self._alarm_hooks.remove(hook)
        if not self._alarm_hooks:
            self._station.connections.listeners.remove(self._hear)

    def _hear(self, event: CmEvent, now: int) -> None:
        if isinstance(event, AlarmConfirmed):
            for hook in list(self._alarm_hooks):
                hook(event, now)

    @property
    def last_alarm(self) -> int:
        return self._station.cm.alarms.last_number

    def alarm(self, alarm: OwnAlarm, now: int) -> tuple[int, ...] | None:
        cm = self._station.cm
        if not any(alarm.place in ar.owned and ar.alarm_cr is not None for ar in cm.ars):
            return None
        if alarm.alarm_type in _MOVES:
            owners = (self._unique(ar.key) for ar in cm.ars if alarm.place in ar.owned)
            self._misled.setdefault(alarm.place, set()).update(owners)
        specifier = cm.diagnosis.alarm_specifier(alarm.place)
        told = cm.alarm(alarm.alarm_type, alarm.place, now, items=alarm.items, specifier=specifier, high=alarm.high)
        self._settle(now)
        return told

    def unalarm(self, alarm: OwnAlarm, now: int) -> None:
        misled = self._misled.pop(alarm.place, set())
        for ar in self._station.cm.ars:
            if self._unique(ar.key) in misled:
                self._station.cm.come_again(ar.key, alarm.place, now)
        self._settle(now)

    def return_of_submodules(self, last_ns: int, now: int) -> int:
        if self._core.impairments.has(self._station.index, "out", IOPS_BAD):
            return 0
        places = {
            key
            for ar in self._station.ars.values()
            if ar.established and ar.connected_ns <= last_ns
            for _, cr in ar.providers
            for data in cr.data
            if data.data_length and (key := (data.api, data.slot, data.subslot)) not in ar.bad
        }
        told = [self._station.cm.alarm(AlarmType.RETURN_OF_SUBMODULE, place, now) for place in sorted(places)]
        self._settle(now)
        return sum(map(len, told))

    def diagnose(self, entry: DiagnosisEntry, now: int) -> None:
        self._diagnoses.add(entry)
        self._settle(now)

    def undiagnose(self, entry: DiagnosisEntry, now: int) -> None:
        self._diagnoses.remove(entry)
        self._settle(now)


def _names(ar: Ar, slot: int, subslot: int | None, *, diagnosis: bool) -> bool:
    """Whether the AR's ModuleDiffBlock names the place."""
    found = [m for api in (ar.module_diff.apis if ar.module_diff else ()) for m in api.modules if m.slot == slot]
    if subslot is None or any(m.state == ModuleState.NO_MODULE for m in found):
        return bool(found) and not diagnosis
    states = [s.state for m in found for s in m.submodules if s.subslot == subslot]
    return any(state & _DIAGNOSIS_BITS for state in states) if diagnosis else bool(states)
