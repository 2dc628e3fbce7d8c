"""Faults of modules, and faults that speak through the alarm channel."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any

from pnfarm.faults.frames import POLL_NS, Chance, Effect, Tally, Window
from pnfarm.faults.gate import GateRule, acknowledging_nothing, is_alarm_answer, is_alarm_data
from pnfarm.faults.target import ModuleChange, OwnAlarm
from pnfarm.faults.words import FaultError, shown
from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.wire.alarms import AlarmItem, AlarmType
from pnfarm.protocols.profinet.wire.diagnosis import (
    WHOLE_SUBMODULE,
    ChannelDiagnosis,
    ChannelProperties,
    Maintenance,
    Qualifier,
    Usi,
    emit_items,
)

if TYPE_CHECKING:
    from pnfarm.faults.plan import FaultSpec
    from pnfarm.faults.target import Evidence, FaultTarget
    from pnfarm.protocols.profinet.ar import ExpectedKey
    from pnfarm.protocols.profinet.events import AlarmConfirmed

__all__ = ["DiagnosisEffect", "ModuleEffect", "StormEffect", "UnacknowledgedEffect"]

#: More than ten thousand alarms a second are no test of a controller; in virtual time, time would stand still.
SHORTEST_INTERVAL_NS = 100_000

_GONE = frozenset({AlarmType.PULL, AlarmType.PULL_MODULE, AlarmType.PLUG_WRONG_SUBMODULE})
_MAINTENANCE = {
    "fault": Maintenance.FAULT,
    "maintenance-required": Maintenance.REQUIRED,
    "maintenance-demanded": Maintenance.DEMANDED,
}
_CODINGS = {"channel": Usi.CHANNEL, "extended": Usi.EXT_CHANNEL, "qualified": Usi.QUALIFIED_CHANNEL}
_QUALIFIERS = {
    "fault": Qualifier.FAULT,
    "maintenance-demanded": Qualifier.DEMANDED,
    "maintenance-required": Qualifier.REQUIRED,
    "advice": Qualifier.ADVICE,
}


class _Told(Effect):
    """Confirmed by the AlarmAck of an alarm that came after its begin, or by a later AR's ModuleDiffBlock."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._tally = Tally()
        self._standing: frozenset[int] = frozenset()
        self._mark = 0
        self._due: int | None = None
        self._listening = False

    def _watch(self) -> None:
        """Call it before the drive does what is to be told."""
        connection = self.target.connection()
        self._standing = connection.keys if connection is not None else frozenset()
        self._mark = self.target.last_alarm
        self.target.listen(self._hear)
        self._listening = True

    def _hear(self, event: AlarmConfirmed, now: int) -> None:
        # a drive that booted counts its alarms anew; what it tells then is about what stands, too
        if (event.number > self._mark or self.target.last_alarm < self._mark) and self._is_about(event):
            self._confirm()
        del now

    @abstractmethod
    def _is_about(self, event: AlarmConfirmed) -> bool:
        """Whether this alarm told of the fault."""

    @abstractmethod
    def _stands_in_diff(self) -> bool:
        """Whether a ModuleDiffBlock tells of it."""

    def _confirm(self) -> None:
        self._tally.confirm()
        self._deaf()

    def _deaf(self) -> None:
        if self._listening:
            self._listening = False
            self.target.unlisten(self._hear)
        self._due = None

    def check(self, now: int) -> None:
        if self._listening:
            if self._stands_in_diff():
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


class ModuleEffect(_Told):
    """module-missing and module-wrong."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        _, slot, _ = target.place(self.values["slot"], None)
        given = {name: self.values[name] for name in ("telegram", "ident", "substitute") if name in self.values}
        self._change = ModuleChange(slot, self.values["subslot"], self.values["missing"], **given)

    def begin(self, window: Window, now: int) -> None:
        del window
        self._watch()
        try:
            self.target.change_module(self._change, now)
        except BaseException:
            self._deaf()
            raise
        self._tally.note(now)
        self.check(now)

    def _is_about(self, event: AlarmConfirmed) -> bool:
        change = self._change
        return event.alarm_type in _GONE and event.slot == change.slot and change.subslot in {None, event.subslot}

    def _stands_in_diff(self) -> bool:
        return self.target.told_at_connect(self._change.slot, self._change.subslot, self._standing)

    def end(self, now: int) -> None:
        super().end(now)
        self.target.unchange_module(self._change, now)


class DiagnosisEffect(_Told):
    """diagnosis."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._entry = _entry(self.values, target.place(self.values["slot"], self.values["subslot"]))
        self._item = self._entry.item()

    def begin(self, window: Window, now: int) -> None:
        del window
        self._watch()
        try:
            self.target.diagnose(self._entry, now)
        except BaseException:
            self._deaf()
            raise
        self._tally.note(now)
        self.check(now)

    def _is_about(self, event: AlarmConfirmed) -> bool:
        told = event.alarm_type != AlarmType.DIAGNOSIS_DISAPPEARS
        return told and (event.api, event.slot, event.subslot) == self._entry.place

    def _stands_in_diff(self) -> bool:
        _, slot, subslot = self._entry.place
        return self.target.told_at_connect(slot, subslot, self._standing, diagnosis=True)

    def end(self, now: int) -> None:
        super().end(now)
        self.target.undiagnose(self._entry, now)


def _entry(values: dict[str, Any], place: ExpectedKey) -> DiagnosisEntry:
    """The diagnosis that the parameters describe; raises :class:`FaultError` for what no coding can say."""
    severity, coding = values["severity"], values["coding"]
    if severity == "advice" and coding != "qualified":
        raise FaultError(
            [("params.severity", "is 'advice'", "with `coding` qualified; fault and maintenance otherwise")]
        )
    if severity != "fault" and coding == "manufacturer":
        raise FaultError([("params.severity", f"is {shown(severity)}", "fault, in a manufacturer's coding")])
    try:
        if coding == "manufacturer":
            return DiagnosisEntry(*place, usi=values["usi"], channel=values["channel"], data=values["data"])
        # the lowest bit of the severity's
        qualifier = _QUALIFIERS[severity] & -_QUALIFIERS[severity] if coding == "qualified" else 0
        return DiagnosisEntry(
            *place,
            usi=_CODINGS[coding],
            channel=values["channel"],
            error_type=values["error"],
            ext_error_type=values["ext"],
            ext_add_value=values["add-value"],
            maintenance=Maintenance.QUALIFIED if qualifier else _MAINTENANCE[severity],
            qualifier=qualifier,
        )
    except ValueError as exc:
        raise FaultError([("params", str(exc), "`coding` extended or qualified for an extended error type")]) from exc


def _own_alarm(values: dict[str, Any], target: FaultTarget) -> OwnAlarm:
    """What the parameters of a kind that raises alarms say."""
    alarm_type, priority = values["type"], values["priority"]
    items: tuple[AlarmItem, ...] = ()
    if values["error"] is not None:
        item = ChannelDiagnosis(WHOLE_SUBMODULE, ChannelProperties(), values["error"])
        items = tuple(AlarmItem(usi, data) for usi, data in emit_items((item,)))
    high = alarm_type == AlarmType.PROCESS if priority is None else priority == "high"
    return OwnAlarm(alarm_type, target.place(values["slot"], values["subslot"]), high, items)


class StormEffect(Effect):
    """alarm-storm."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._tally = Tally()
        self._alarm = _own_alarm(self.values, target)
        self._interval: int = self.values["interval"]
        self._wait: bool = self.values["wait"]
        self._unanswered: set[int] = set()
        self._keys: frozenset[int] = frozenset()
        self._next = 0
        self._due: int | None = None
        if self._interval < SHORTEST_INTERVAL_NS:
            raise FaultError([("params.interval", f"is {shown(spec.params['interval'])}", "a duration from 100us")])

    def begin(self, window: Window, now: int) -> None:
        del window
        self.target.listen(self._hear)
        self._next = now
        self.check(now)

    def _hear(self, event: AlarmConfirmed, now: int) -> None:
        del now
        if event.number in self._unanswered:
            self._unanswered.discard(event.number)
            self._tally.confirm()

    def check(self, now: int) -> None:
        self._due = None
        count = self.spec.count
        if count is not None and self._tally.seen.activations >= count:
            # its last alarms are answered as the others were
            self.finished = not self._unanswered or not self._connected()
            self._due = None if self.finished else now + POLL_NS
            return
        if not self._connected() or (self._wait and self._unanswered):
            self._due = now + POLL_NS
            return
        if now >= self._next:
            numbers = self.target.alarm(self._alarm, now)
            if numbers is None:
                self._due = now + POLL_NS
                return
            self._unanswered.update(numbers)
            self._tally.note(now, happened=bool(numbers))
            self._next = now + self._interval
        self._due = self._next

    def _connected(self) -> bool:
        """The AlarmAcks of a connection that went never come."""
        connection = self.target.connection()
        keys = connection.keys if connection is not None and connection.established else frozenset()
        if keys != self._keys:
            self._keys = keys
            self._unanswered.clear()
        return bool(keys)

    def end(self, now: int) -> None:
        self.target.unlisten(self._hear)
        self.target.unalarm(self._alarm, now)

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due


class UnacknowledgedEffect(Effect):
    """alarm-unacknowledged: answers are lost until the connection ended; then, perhaps, again."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._chance = Chance(spec, target, spec.count if spec.count or spec.for_ns else 1)
        self._alarm = _own_alarm(self.values, target) if self.values["raise"] else None
        self._rule: GateRule | None = None
        self._keys: frozenset[int] = frozenset()
        self._passed: frozenset[int] = frozenset()
        self._due: int | None = None

    def begin(self, window: Window, now: int) -> None:
        del window
        self.check(now)

    def check(self, now: int) -> None:
        connection = self.target.connection()
        standing = connection.keys if connection else frozenset()
        if self._rule is not None:
            if standing & self._keys:
                self._due = now + POLL_NS
                return
            self._hear_again()
            self.finished = self._chance.exhausted
        if not self.finished and connection and connection.established and not standing & self._passed:
            self._passed = standing
            happens = self._chance.falls()
            if happens:
                self._rule, self._keys = self._new_rule(), standing
                self.target.gate(self._rule)
                self._due = now + POLL_NS
                if self._alarm is not None:
                    self.target.alarm(self._alarm, now)
            self._chance.tally.note(now, happened=happens)

    def _new_rule(self) -> GateRule:
        if self.values["what"] == "no-ack":
            # an AlarmAck that never came gets no acknowledgement, not even in a later alarm
            return GateRule(("in",), is_alarm_data)
        return GateRule(("in",), is_alarm_answer, instead=acknowledging_nothing)

    def _hear_again(self) -> None:
        """Answers pass; those that were lost are the proof that the controller gave some."""
        if self._rule is not None:
            self.target.ungate(self._rule)
            if self._rule.evidence().confirmed:
                self._chance.tally.confirm()
            self._rule = None
        self._due = None

    def end(self, now: int) -> None:
        self._hear_again()
        if self._alarm is not None:
            self.target.unalarm(self._alarm, now)

    def evidence(self) -> Evidence:
        return self._chance.tally.seen

    def next_deadline(self) -> int | None:
        return self._due
