"""The submodules that a controller can use, and the reasons for the others.

Theory.  A submodule is unusable from the answer of Connect or an ApplicationReady whose ModuleDiffBlock says so, or
from an alarm that takes it away: pulled, a wrong one plugged, controlled by a supervisor.  The controller's own data
for it are BAD from then on, and the AR goes on with the others.  An alarm that brings it back (plugged, released) is
answered by a round of parameters (:mod:`rounds`), and the end of that round makes the submodule good again,
unless its ApplicationReady says otherwise.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.cm.controller.events import ApplicationReadyReceived, ParametersEnded, SubmodulesChanged
from pnfarm.protocols.profinet.cm.controller.rounds import Ready, RoundEnded, Rounds
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmType

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Iterable

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.cm.controller.calls import CallQueue
    from pnfarm.protocols.profinet.cm.controller.events import RecordWriteDone
    from pnfarm.protocols.profinet.cm.controller.plan import ArPlan
    from pnfarm.protocols.profinet.cm.controller.response import ModuleDeviation
    from pnfarm.protocols.profinet.wire.alarms.notification import AlarmNotification

    _Event = ApplicationReadyReceived | ParametersEnded | SubmodulesChanged | RecordWriteDone

__all__ = ["ControllerSubmodules"]

_WRITING = "its parameters are being written"

#: Alarms that take a submodule, or with subslot 0 a whole module, away.
_TAKEN_AWAY: dict[int, str] = {
    AlarmType.PULL: "pulled",
    AlarmType.PULL_MODULE: "pulled with its module",
    AlarmType.PLUG_WRONG_SUBMODULE: "a wrong submodule is plugged",
    AlarmType.CONTROLLED_BY_SUPERVISOR: "controlled by a supervisor",
}
#: Alarms after which a submodule waits for its parameters.
_BROUGHT_BACK = frozenset({AlarmType.PLUG, AlarmType.RELEASED})


class ControllerSubmodules:
    """See the module's docstring.  ``calls`` and ``dropped`` are the AR's."""

    def __init__(self, plan: ArPlan, calls: CallQueue, dropped: Counter[str]) -> None:
        self.rounds = Rounds(plan, calls, dropped)
        self._keys = tuple((s.api, s.slot, s.subslot) for s in plan.sorted_submodules)
        self._why: dict[ExpectedKey, str] = {}
        self._reported: dict[ExpectedKey, str] = {}
        #: Submodules whose ApplicationReady is overdue and may still come, with the reported reason.
        self._overdue: dict[ExpectedKey, str] = {}
        self._dropped = dropped

    @property
    def unusable(self) -> dict[ExpectedKey, str]:
        """(api, slot, subslot) -> why."""
        return dict(self._why)

    # what the device says

    def differ(self, module_diff: tuple[ModuleDeviation, ...]) -> None:
        """Set the unusable submodules after a start-up, from the reported deviations."""
        self._why = self._misfits(module_diff)

    def alarm(self, alarm: AlarmNotification, now: int, *, data: bool) -> None:
        """An alarm, acknowledged, that may take submodules away; those that it brings back get their parameters.

        ``data``: the AR exchanges data; before, its start-up parametrises everything.
        """
        concerned = self._concerned(alarm)
        why = _TAKEN_AWAY.get(alarm.alarm_type)
        if why is not None:
            self._why.update(dict.fromkeys(concerned, why))
            self.rounds.gone(concerned, now)
        elif alarm.alarm_type in _BROUGHT_BACK and concerned:
            if not data:
                self._dropped["plug-before-data"] += 1
                return
            self._why.update(dict.fromkeys(concerned, _WRITING))
            self.rounds.plugged(concerned, alarm.sequence_number, now)

    def begin(self, wanted: Iterable[ExpectedKey] | None) -> bool:
        """PrmBegin for these submodules, or for all that can be used; False if that is not possible now."""
        keys = self._keys if wanted is None else tuple(wanted)
        return self.rounds.begin(tuple(key for key in keys if wanted is not None or key not in self._why))

    # what follows

    def events(self) -> list[_Event]:
        """What happened since the last call; the last is :class:`SubmodulesChanged` when the usable ones changed."""
        out: list[_Event] = []
        for event in self.rounds.events():
            if isinstance(event, Ready):
                self._why.update(self._misfits(event.content.module_diff))
                out.append(ApplicationReadyReceived(event.content.module_diff, event.content.after_plug))
            elif isinstance(event, RoundEnded):
                self._round_ended(event)
                out.append(ParametersEnded(event.keys, event.after_plug, event.reason, event.code))
            else:
                out.append(event)
        if self._why != self._reported:
            self._reported = dict(self._why)
            out.append(SubmodulesChanged(self._reported))
        return out

    def _round_ended(self, event: RoundEnded) -> None:
        for key in event.keys:
            why, overdue = self._why.get(key), self._overdue.pop(key, None)
            if why is None or why not in {_WRITING, overdue}:
                continue
            if event.overdue:
                self._overdue[key] = event.reason
            if event.reason:
                self._why[key] = event.reason
            else:
                del self._why[key]

    def _concerned(self, alarm: AlarmNotification) -> tuple[ExpectedKey, ...]:
        """The planned submodules that an alarm is about; subslot 0 means the whole module."""
        place = (alarm.api, alarm.slot, alarm.subslot)
        if alarm.subslot:
            return (place,) if place in self._keys else ()
        return tuple(key for key in self._keys if key[1] == alarm.slot)

    def _misfits(self, module_diff: tuple[ModuleDeviation, ...]) -> dict[ExpectedKey, str]:
        why: dict[ExpectedKey, str] = {}
        for deviation in module_diff:
            if deviation.fits:
                continue
            place = (deviation.api, deviation.slot, deviation.subslot)
            for key in self._keys:
                if key == place or (deviation.subslot is None and key[1] == deviation.slot):
                    why.setdefault(key, deviation.what)
        return why
