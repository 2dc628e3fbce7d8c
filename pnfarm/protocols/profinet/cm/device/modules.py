"""The submodules of the present ARs: which of them each AR can use, and the alarms when one is plugged or pulled.

:class:`Modules` changes what is plugged, sends the alarms, and keeps for each AR the machines of
:mod:`.cmdev_plug`; its owner, :class:`~.cmdev.CmDevice`, reports :class:`~.events.SubmodulesChanged` afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.cm.ar import CmdevState
from pnfarm.protocols.profinet.cm.device.diff import Holdings, expected_idents, module_diff, unusable_submodules
from pnfarm.protocols.profinet.cm.device.ownership import expected_keys
from pnfarm.protocols.profinet.cm.device.plug import ParameterBegin, Plug, PlugsmEvent
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmType
from pnfarm.protocols.profinet.wire.cm.connect import ArProperties

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.protocols.profinet.cm.ar import Ar, ExpectedKey
    from pnfarm.protocols.profinet.cm.device.alarms import DeviceAlarms
    from pnfarm.protocols.profinet.cm.device.events import AlarmConfirmed
    from pnfarm.protocols.profinet.description import ModuleDescription, Plugged
    from pnfarm.protocols.profinet.diagnosis import DiagnosisStore
    from pnfarm.protocols.profinet.wire.cm.expected import ExpectedApi, ModuleDiffBlock

__all__ = ["Before", "Modules"]

#: The controller has ApplicationReady's ModuleDiffBlock, or will: what happens from here on takes an alarm.
_READY_SENT = frozenset({CmdevState.W_ARDYCNF, CmdevState.WDATA, CmdevState.DATA})

#: Alarms about what the AR has no longer: no parameters follow.
_GONE = frozenset({
    AlarmType.PULL, AlarmType.PULL_MODULE, AlarmType.PLUG_WRONG_SUBMODULE, AlarmType.CONTROLLED_BY_SUPERVISOR,
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Before:
    """A slot before a change: its real modules, and the expected submodules that each AR could use."""

    real: dict[ExpectedKey, tuple[int, int]]
    usable: dict[int, set[ExpectedKey]]


@dataclass(slots=True)
class _Running:
    """Parameters that come while data flow."""

    begin: ParameterBegin = field(default_factory=ParameterBegin)
    plugs: list[Plug] = field(default_factory=list)
    #: What changed while the alarm channel accepted no alarms, and the alarm to send for each.
    untold: dict[ExpectedKey, AlarmType] = field(default_factory=dict)


class Modules:
    """See the module's docstring.  ``diagnosis`` gives the diagnosis bits of SubmoduleState."""

    def __init__(self, plugged: Plugged, alarms: DeviceAlarms, diagnosis: DiagnosisStore) -> None:
        self._plugged = plugged
        self._alarms = alarms
        self._diagnosis = diagnosis
        self._running: dict[int, _Running] = {}

    def open(self, ar_key: int) -> None:
        self._running[ar_key] = _Running()

    def close(self, ar_key: int) -> None:
        self._running.pop(ar_key, None)

    # what an AR has

    def diff(self, ar: Ar) -> ModuleDiffBlock | None:
        """The differences between the plugged and the AR's expected modules."""
        holdings = Holdings(ar.locked, ar.pending, ar.supervisor, self._diagnosis.submodule_diag_state)
        return module_diff(ar.expected, self._plugged, holdings)

    def unusable(self, ar: Ar) -> frozenset[ExpectedKey]:
        """Expected submodules whose data are bad."""
        return unusable_submodules(ar.expected, self.diff(ar))

    def usable(self, ar: Ar) -> set[ExpectedKey]:
        """Expected submodules that are there, as expected or as a substitute, whichever AR owns them."""
        missing = unusable_submodules(ar.expected, module_diff(ar.expected, self._plugged))
        return {key for key in expected_keys(ar.expected) if key not in missing}

    def following(self, expected: Sequence[ExpectedApi], others: Iterable[Ar]) -> dict[int, ModuleDescription | None]:
        """The modules in the slots of a new AR: what no other one uses takes what is expected, where it can."""
        theirs = [entry for ar in others for entry in ar.expected]
        slots = {entry.slot for entry in theirs}
        used = {(entry.slot, sub.subslot) for entry in theirs for sub in entry.submodules}
        found = {}
        for slot, (module, idents) in expected_idents(expected).items():
            free = {subslot: ident for subslot, ident in idents.items() if (slot, subslot) not in used}
            found[slot] = self._plugged.following(slot, module, free, shared=slot in slots)
        return found

    # what happens to it

    def before(self, ars: Iterable[Ar], slot: int) -> Before:
        """How a slot is, for :meth:`moved` afterwards."""
        return Before(self._real(slot), {ar.key: self.usable(ar) for ar in ars})

    def _real(self, slot: int) -> dict[ExpectedKey, tuple[int, int]]:
        """The content of a slot: the idents of module and submodule, by place."""
        module = self._plugged.module(slot)
        return {} if module is None else {
            (s.api, slot, s.subslot): (module.module_ident, s.submodule_ident) for s in module.submodules
        }  # fmt: skip

    def gone(self, slot: int, before: Before) -> list[ExpectedKey]:
        """The submodules that were in a slot and are not any more, or that others have replaced."""
        real = self._real(slot)
        return [key for key, idents in before.real.items() if real.get(key) != idents]

    def moved(self, ar: Ar, slot: int, before: Before, now: int, *, whole: bool) -> bool:
        """Something was pulled from or plugged into ``slot``; ``whole`` means a module.

        False when the AR expects nothing there.
        """
        expected = [key for key in expected_keys(ar.expected) if key[1] == slot]
        if not expected:
            return False
        had, has, real = before.usable[ar.key], self.usable(ar), self._real(slot)
        owned = [key for key in expected if key in ar.owned]
        gone = [key for key in owned if key in before.real and key not in real]
        wrong = [key for key in owned if key in real and key not in has and before.real.get(key) != real[key]]
        self._forget(ar, [*gone, *wrong])
        if self._plugged.module(slot) is not None:
            # that the whole module was pulled is over
            self._forget(ar, [key for key in self._running[ar.key].untold if key[1:] == (slot, 0)])
        if ar.state in _READY_SENT:
            self._tell_gone(ar, slot, gone, now, whole=whole)
            for key in wrong:
                self._tell(ar, AlarmType.PLUG_WRONG_SUBMODULE, key, now)
        for key in owned:
            if key in has - had:
                self.await_parameters(ar, AlarmType.PLUG, key, now)
        return True

    def _tell_gone(self, ar: Ar, slot: int, gone: list[ExpectedKey], now: int, *, whole: bool) -> None:
        if gone and whole and self._plugged.module(slot) is None:
            # one alarm for the module: subslot 0, of its own type where the controller knows it
            known = ar.properties & ArProperties.PULL_MODULE_ALARM_ALLOWED
            alarm_type = AlarmType.PULL_MODULE if known else AlarmType.PULL
            self._tell(ar, alarm_type, (gone[0][0], slot, 0), now)
            return
        for key in gone:
            self._tell(ar, AlarmType.PULL, key, now)

    def _tell(self, ar: Ar, alarm_type: AlarmType, key: ExpectedKey, now: int) -> int | None:
        """Send an alarm about what changed; its number.  A channel that is full is tried again when it has room."""
        untold = self._running[ar.key].untold
        untold.pop(key, None)
        flags = self._diagnosis.alarm_specifier(key, ar.owned)
        number = self._alarms.send(ar.key, alarm_type, key, now, specifier=flags)
        if number is None and ar.alarm_cr is not None:
            untold[key] = alarm_type
        return number

    def taken_over(self, ar: Ar, keys: Iterable[ExpectedKey], now: int) -> None:
        """A supervisor has taken some of a controller's submodules."""
        lost = sorted(keys)
        self._forget(ar, lost)
        if ar.state in _READY_SENT:
            for key in lost:
                self._tell(ar, AlarmType.CONTROLLED_BY_SUPERVISOR, key, now)

    def inherited(self, ar: Ar, keys: Iterable[ExpectedKey], now: int) -> None:
        """Another AR ended and left submodules to this one."""
        for key in sorted(self.usable(ar) & set(keys)):
            self.await_parameters(ar, AlarmType.RELEASED, key, now)

    def await_parameters(self, ar: Ar, alarm_type: AlarmType, key: ExpectedKey, now: int) -> None:
        """Send an AR the alarm for a submodule that it can use from now on, and wait for the submodule's parameters.

        During start-up no alarm is needed: ApplicationReady reports it.  Without an alarm channel the submodule
        cannot be parametrised.
        """
        if ar.state not in _READY_SENT or ar.alarm_cr is None:
            return
        ar.pending.add(key)
        number = self._tell(ar, alarm_type, key, now)
        if number is not None:
            self._running[ar.key].plugs.append(Plug(key, number))

    def replug(self, ar: Ar, key: ExpectedKey, now: int) -> bool:
        """Send an AR a plug alarm for one of its submodules, as after a pull; False when the submodule is not there."""
        if key not in ar.owned or key not in self.usable(ar):
            return False
        self._forget(ar, [key])
        self.await_parameters(ar, AlarmType.PLUG, key, now)
        return True

    def _forget(self, ar: Ar, keys: Iterable[ExpectedKey]) -> None:
        """Stop waiting for anything of these submodules."""
        gone = set(keys)
        ar.pending -= gone
        running = self._running[ar.key]
        running.plugs = [p for p in running.plugs if p.key not in gone]
        running.untold = {key: alarm_type for key, alarm_type in running.untold.items() if key not in gone}

    # parameters while data flow

    def begin(self, ar_key: int) -> ParameterBegin:
        return self._running[ar_key].begin

    def plug(self, ar_key: int, sequence: int) -> Plug | None:
        """The plug whose alarm had this sequence number; the alarm's AlarmAck need not have come."""
        plugs = self._running[ar_key].plugs
        number = self._alarms.number_of(ar_key, sequence)
        for plug in plugs:
            if plug.number == number:
                plug.sequence = sequence
        return next((p for p in plugs if p.sequence == sequence), None)

    def plug_confirmed(self, ar_key: int, sequence: int) -> None:
        """The controller confirmed ApplicationReady.plug."""
        running = self._running[ar_key]
        for plug in running.plugs:
            if plug.sequence == sequence:
                plug.step(PlugsmEvent.APPLICATION_READY_CNF)
        running.plugs = [p for p in running.plugs if not p.done]

    def alarm_confirmed(self, ar: Ar, event: AlarmConfirmed, now: int) -> None:
        """An alarm's AlarmAck came: a plug may have waited for it, or for its place in the queue."""
        running = self._running[event.ar_key]
        for plug in running.plugs:
            if plug.number == event.number:
                plug.sequence = event.sequence
                plug.step(PlugsmEvent.ALARM_ACK if event.status.ok else PlugsmEvent.ALARM_REFUSED)
        running.plugs = [p for p in running.plugs if not p.done]
        untold, running.untold = running.untold, {}
        for key, alarm_type in untold.items():
            if alarm_type in _GONE:
                self._tell(ar, alarm_type, key, now)
            else:
                self.await_parameters(ar, alarm_type, key, now)
