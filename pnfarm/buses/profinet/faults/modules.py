"""The modules of a PROFINET drive: what is in its slots, with several changes at once.

Changes in force are applied to the station's present machines: a drive that boots has new ones, without
them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.device.modules import module_of_ident, module_of_telegram
from pnfarm.errors import ConfigError
from pnfarm.faults.effects.parts import DrivePart, Part
from pnfarm.faults.errors import InjectionError
from pnfarm.protocols.profinet.description import SlotState
from pnfarm.protocols.profinet.wire.cm.expected import ModuleState

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.buses.profinet.faults.connection import ArKeys
    from pnfarm.protocols.profinet.cm.ar import Ar, ExpectedKey
    from pnfarm.protocols.profinet.description import ModuleDescription

__all__ = ["MODULES", "ModuleChange", "Modules"]

#: Advice, maintenance required, maintenance demanded and fault, in SubmoduleState.
_DIAGNOSIS_BITS = 0x0078


@dataclass(frozen=True, slots=True, eq=False)
class ModuleChange:
    """What is in a slot instead: nothing (``missing``), or something else; with ``subslot`` of one submodule.

    Without ``telegram`` and ``ident`` it is an ident that the drive does not have.
    """

    slot: int
    subslot: int | None = None
    missing: bool = True
    telegram: int | None = None
    ident: int | None = None
    substitute: bool = False


class Modules(DrivePart):
    """Changes of slots in force.  ``changed()`` is called for each, before the station settles."""

    def __init__(
        self, station: ProfinetDevice, keys: ArKeys, settle: Callable[[int], None], changed: Callable[[], None]
    ) -> None:
        self._station = station
        self._keys = keys
        self._settle = settle
        self._changed = changed
        self._changes = _SlotChanges(station)

    def rebooted(self, now: int) -> None:
        self._changes.rebooted(now)
        self._changed()

    def in_force(self) -> list[Any]:
        return list(self._changes.changes)

    def place(self, slot: int | None, subslot: int | None) -> ExpectedKey:
        """A submodule that the drive can have, None: where its set points come in; raises :class:`ConfigError`."""
        return _place_of(self._station, slot, subslot)

    def change(self, change: ModuleChange, now: int) -> None:
        """Put ``change`` in force; the latest one counts.  Raises :class:`ConfigError` when the slot cannot have it."""
        self._changes.check(change)
        self._changes.add(change, now)
        self._changed()
        self._settle(now)

    def undo_change(self, change: ModuleChange, now: int) -> None:
        """Remove it: the slot becomes its base with the remaining changes."""
        self._changes.remove(change, now)
        self._changed()
        self._settle(now)

    def in_diff_at_connect(
        self, slot: int, subslot: int | None, standing: frozenset[int], *, diagnosis: bool = False
    ) -> bool:
        """Whether an AR in DATA, other than those with the keys ``standing``, has a ModuleDiffBlock with the place.

        With ``diagnosis`` it must name a diagnosis of the submodule.
        """
        for key, channels in self._station.ars.items():
            ar = self._station.cm.ar(key)
            later = ar is not None and channels.established and self._keys.unique(key) not in standing
            if ar is not None and later and _names(ar, slot, subslot, diagnosis=diagnosis):
                return True
        return False


def _names(ar: Ar, slot: int, subslot: int | None, *, diagnosis: bool) -> bool:
    """Whether the AR's ModuleDiffBlock names the place."""
    found = [m for api in (ar.module_diff.apis if ar.module_diff else ()) for m in api.modules if m.slot == slot]
    if subslot is None or any(m.state == ModuleState.NO_MODULE for m in found):
        return bool(found) and not diagnosis
    states = [s.state for m in found for s in m.submodules if s.subslot == subslot]
    return any(state & _DIAGNOSIS_BITS for state in states) if diagnosis else bool(states)


def _place_of(station: ProfinetDevice, slot: int | None, subslot: int | None) -> ExpectedKey:
    """A submodule that the drive can have; None: the telegram's slot, its submodule with set points.

    Of a device that is the first slot with a module; its access point's where there is none.
    """
    description = station.description
    first = next((m.slot for m in description.modules if m.submodules), description.dap.slot)
    chosen = first if slot is None else slot
    modules = [m for m in (description.dap, *description.modules) if m.slot == chosen]
    if not modules:
        allowed = ", ".join(map(str, description.slots))
        raise InjectionError([("params.slot", f"{station.configured_name} has no slot {slot}", allowed)])
    known = {s.subslot: s for m in modules for s in m.submodules}
    if not known:
        raise InjectionError(
            [("params.slot", f"slot {slot} of {station.configured_name} has no submodules", "another")]
        )
    if subslot is None:
        subslot = next((s.subslot for s in known.values() if s.output_bytes), min(known))
    if subslot not in known:
        allowed = ", ".join(f"0x{number:04X}" for number in sorted(known))
        what = f"slot {chosen} of {station.configured_name} has no subslot 0x{subslot:04X}"
        raise InjectionError([("params.subslot", what, allowed)])
    found = known[subslot]
    return found.api, found.slot, found.subslot


class _SlotChanges:
    """Changes of slots in force.  The latest one counts; the slot without them is kept as its base. A user's

    pull or plug in between takes precedence until the next change comes or goes, and is the new base.
    """

    def __init__(self, station: ProfinetDevice) -> None:
        self._station = station
        self.changes: list[ModuleChange] = []
        self._bases: dict[int, SlotState] = {}
        self._put: dict[int, SlotState] = {}
        self._plugged = station.cm.plugged

    def check(self, change: ModuleChange) -> None:
        """Raises :class:`ConfigError` when the slot cannot have it."""
        station, slot = self._station, change.slot
        if slot == station.description.dap.slot:
            allowed = ", ".join(str(s) for s in station.description.slots if s != slot)
            what = f"slot {slot} of {station.configured_name} holds the access point, which cannot be pulled"
            raise InjectionError([("params.slot", what, allowed)])
        _place_of(station, slot, change.subslot)
        if change.telegram is not None and change.ident is not None:
            raise InjectionError([("params.ident", "is given together with `telegram`", "one of the two")])
        if change.subslot is not None and (change.telegram is not None or change.substitute):
            field = "telegram" if change.telegram is not None else "substitute"
            raise InjectionError([(f"params.{field}", "is of a whole module", "leave out `subslot`, or give `ident`")])
        if change.telegram is not None:
            try:
                module_of_telegram(station, slot, change.telegram)
            except ConfigError as exc:
                raise InjectionError([("params.telegram", str(exc), "")]) from exc

    def add(self, change: ModuleChange, now: int) -> None:
        self.changes.append(change)
        self._apply(change.slot, now)

    def remove(self, change: ModuleChange, now: int) -> None:
        self.changes.remove(change)
        self._apply(change.slot, now)

    def rebooted(self, now: int) -> None:
        """The slots are as at power-on."""
        for slot in dict.fromkeys(change.slot for change in self.changes):
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
        changes = [change for change in self.changes if change.slot == slot]
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
    """An ident that differs from these: after the highest, or the lowest that is free."""
    behind = max(idents) + 1
    return behind if behind <= 0xFFFF_FFFF else next(i for i in range(1, len(idents) + 2) if i not in idents)


MODULES: Part[Modules] = Part("modules of PROFINET")
