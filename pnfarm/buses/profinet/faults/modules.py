"""What faults make of a station's modules, diagnosis and late answers, several of each at once.

Each of these knows what is in force and puts it into whatever machines the station has: a drive that boots has new
ones, without a trace of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.device.modules import module_of_ident, module_of_telegram
from pnfarm.errors import ConfigError
from pnfarm.faults.words import FaultError
from pnfarm.protocols.profinet.description import SlotState
from pnfarm.protocols.profinet.wire.rpc import Opnum

if TYPE_CHECKING:
    from pnfarm.buses.profinet.device.station import DriveStation
    from pnfarm.faults.target import LateRule, ModuleChange
    from pnfarm.protocols.profinet.ar import ExpectedKey
    from pnfarm.protocols.profinet.description import ModuleDescription
    from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
    from pnfarm.protocols.profinet.rpc_events import CallKey

__all__ = ["Diagnoses", "SlotChanges", "SlowAnswers", "place_of"]

_RECORDS = frozenset({Opnum.READ, Opnum.WRITE, Opnum.READ_IMPLICIT})


def place_of(station: DriveStation, slot: int | None, subslot: int | None) -> ExpectedKey:
    """A submodule that the drive can have; None: the telegram's slot, its submodule with set points."""
    description = station.description
    chosen = description.modules[0].slot if slot is None else slot
    modules = [m for m in (description.dap, *description.modules) if m.slot == chosen]
    if not modules:
        allowed = ", ".join(map(str, description.slots))
        raise FaultError([("params.slot", f"{station.configured_name} has no slot {slot}", allowed)])
    known = {s.subslot: s for m in modules for s in m.submodules}
    if subslot is None:
        subslot = next((s.subslot for s in known.values() if s.output_bytes), min(known))
    if subslot not in known:
        allowed = ", ".join(f"0x{number:04X}" for number in sorted(known))
        what = f"slot {chosen} of {station.configured_name} has no subslot 0x{subslot:04X}"
        raise FaultError([("params.subslot", what, allowed)])
    found = known[subslot]
    return found.api, found.slot, found.subslot


class SlotChanges:
    """Changes of slots in force.  The latest one holds; what a slot is without any of them is kept as its base.

    Hands that pull or plug meanwhile have the last word until the next change comes or goes, and are the new base.
    """

    def __init__(self, station: DriveStation) -> None:
        self._station = station
        self._changes: list[ModuleChange] = []
        self._bases: dict[int, SlotState] = {}
        self._put: dict[int, SlotState] = {}
        self._plugged = station.cm.plugged

    def check(self, change: ModuleChange) -> None:
        """Raises :class:`ConfigError` when the slot cannot have that."""
        station, slot = self._station, change.slot
        if slot == station.description.dap.slot:
            allowed = ", ".join(str(s) for s in station.description.slots if s != slot)
            what = f"slot {slot} of {station.configured_name} holds the access point, which cannot be pulled"
            raise FaultError([("params.slot", what, allowed)])
        place_of(station, slot, change.subslot)
        if change.telegram is not None and change.ident is not None:
            raise FaultError([("params.ident", "is given beside `telegram`", "one of the two")])
        if change.subslot is not None and (change.telegram is not None or change.substitute):
            field = "telegram" if change.telegram is not None else "substitute"
            raise FaultError([(f"params.{field}", "is of a whole module", "leave out `subslot`, or give `ident`")])
        if change.telegram is not None:
            try:
                module_of_telegram(station, slot, change.telegram)
            except ConfigError as exc:
                raise FaultError([("params.telegram", str(exc), "")]) from exc

    def add(self, change: ModuleChange, now: int) -> None:
        self._changes.append(change)
        self._apply(change.slot, now)

    def remove(self, change: ModuleChange, now: int) -> None:
        self._changes.remove(change)
        self._apply(change.slot, now)

    def rebooted(self, now: int) -> None:
        """The slots are as at power-on."""
        for slot in dict.fromkeys(change.slot for change in self._changes):
            self._apply(slot, now)

    def _apply(self, slot: int, now: int) -> None:
        cm = self._station.cm
        if cm.plugged is not self._plugged:
            # the drive booted since
            self._plugged = cm.plugged
            self._bases.clear()
            self._put.clear()
        there = cm.plugged.state(slot)
        if self._put.get(slot) != there:
            self._bases[slot] = there
        changes = [change for change in self._changes if change.slot == slot]
        state = self._bases[slot]
        for change in changes:
            state = self._changed(state, change)
        if changes:
            self._put[slot] = state
        else:
            self._put.pop(slot, None)
            del self._bases[slot]
        if state != there:
            cm.put(slot, state, now)

    def _changed(self, base: SlotState, change: ModuleChange) -> SlotState:
        module = base.module
        if change.subslot is not None:
            module = self._with_submodule(module, change)
        elif change.missing:
            module = None
        else:
            module = self._other_module(change, module or base.pulled)
        return SlotState(module, held=True, substitute=change.substitute, pulled=base.pulled or base.module)

    def _other_module(self, change: ModuleChange, shape: ModuleDescription | None) -> ModuleDescription:
        if change.telegram is not None:
            return module_of_telegram(self._station, change.slot, change.telegram)
        known = [m.module_ident for m in self._station.description.modules]
        ident = change.ident if change.ident is not None else _unknown(known)
        return module_of_ident(self._station, change.slot, ident, shape)

    def _with_submodule(self, module: ModuleDescription | None, change: ModuleChange) -> ModuleDescription | None:
        """The module without the change's submodule, or with that one of another ident."""
        if module is None:
            return None
        others = tuple(s for s in module.submodules if s.subslot != change.subslot)
        if change.missing:
            return replace(module, submodules=others)
        known = [s.submodule_ident for m in self._station.description.modules for s in m.submodules]
        ident = change.ident if change.ident is not None else _unknown(known)
        changed = (replace(s, submodule_ident=ident) for s in module.submodules if s.subslot == change.subslot)
        return replace(module, submodules=tuple(sorted((*others, *changed), key=lambda s: s.subslot)))


def _unknown(idents: list[int]) -> int:
    """An ident that is none of these."""
    return next(ident for ident in range(max(idents) + 1, max(idents) + 3) if ident <= 0xFFFF_FFFF)


class Diagnoses:
    """Diagnosis in force.  Of entries with one key the latest holds; one whose submodule is not there waits for it."""

    def __init__(self, station: DriveStation) -> None:
        self._station = station
        self._entries: list[DiagnosisEntry] = []

    def add(self, entry: DiagnosisEntry) -> None:
        """Raises :class:`ConfigError` when the drive's store is full."""
        store = self._station.cm.diagnosis
        if len({e.key for e in (*store, *self._entries, entry)}) > store.maximum:
            raise ConfigError(
                f"{self._station.configured_name} holds {store.maximum} diagnoses, and no more; clear one"
            )
        self._entries.append(entry)
        self.put()

    def remove(self, entry: DiagnosisEntry) -> None:
        self._entries.remove(entry)
        if any(other.key == entry.key for other in self._entries):
            self.put()
        else:
            self._station.cm.diagnosis.remove(entry)

    def put(self) -> None:
        """What is in force, into the store that the drive has now; nothing changes where it stands already."""
        cm = self._station.cm
        for entry in {entry.key: entry for entry in self._entries}.values():
            if cm.plugged.submodule(*entry.place) is not None:
                cm.diagnosis.add(entry)


class SlowAnswers:
    """Rules in force on answers to Read and Write: the :class:`~.rpc_events.LateAnswers` of the RPC server."""

    def __init__(self, station: DriveStation) -> None:
        self._station = station
        self._rules: list[LateRule] = []
        self._kept: dict[CallKey, list[LateRule]] = {}

    def add(self, rule: LateRule) -> None:
        self._rules.append(rule)
        self._station.rpc.late = self

    def remove(self, rule: LateRule, now: int) -> None:
        self._rules = [other for other in self._rules if other is not rule]
        if not self._rules:
            self._station.rpc.release_answers(now)
            self._station.rpc.late = None

    def rebooted(self) -> None:
        """What was kept back never leaves."""
        kept, self._kept = self._kept, {}
        for rules in kept.values():
            for rule in rules:
                rule.left(sent=False)
        if self._rules:
            self._station.rpc.late = self

    def wait_ns(self, call: CallKey, opnum: int, now: int) -> int:
        if opnum not in _RECORDS:
            return 0
        waits = [(rule, rule.asked(now)) for rule in self._rules]
        acting = [rule for rule, wait in waits if wait]
        if acting:
            self._kept[call] = acting
        return sum(wait for _, wait in waits)

    def left(self, call: CallKey, *, sent: bool) -> None:
        for rule in self._kept.pop(call, ()):
            rule.left(sent=sent)
