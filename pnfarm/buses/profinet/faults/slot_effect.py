"""Effects that change what is in a slot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults.modules import ModuleChange
from pnfarm.buses.profinet.faults.reported_effect import ReportedEffect
from pnfarm.faults.kind import WORD, ParamSpec
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmType

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Window
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.protocols.profinet.cm.device.events import AlarmConfirmed

__all__ = ["ONE_SUBSLOT", "SLOT", "SUBSLOT", "SlotEffect"]

SLOT = ParamSpec("whole number", "The slot; left out, the telegram's.", **WORD)
SUBSLOT = ParamSpec("whole number", "The subslot; left out, the one that carries the set points.", **WORD)
ONE_SUBSLOT = ParamSpec("whole number", "One submodule; left out, the whole module.", **WORD)

_GONE = frozenset({AlarmType.PULL, AlarmType.PULL_MODULE, AlarmType.PLUG_WRONG_SUBMODULE})


class SlotEffect(ReportedEffect):
    """Confirmed by the alarms for a submodule that is gone or wrong."""

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        _, slot, _ = self._modules.place(self.values["slot"], None)
        given = {name: self.values[name] for name in ("telegram", "ident", "substitute") if name in self.values}
        self._change = ModuleChange(slot, self.values["subslot"], self.values["missing"], **given)

    def begin(self, window: Window, now: int) -> None:
        del window
        self._watch()
        try:
            self._modules.change(self._change, now)
        except BaseException:
            self._deaf()
            raise
        self._tally.note(now)
        self.check(now)

    def _is_about(self, event: AlarmConfirmed) -> bool:
        change = self._change
        return event.alarm_type in _GONE and event.slot == change.slot and change.subslot in {None, event.subslot}

    def _is_in_diff(self) -> bool:
        return self._modules.in_diff_at_connect(self._change.slot, self._change.subslot, self._standing)

    def end(self, now: int) -> None:
        super().end(now)
        self._modules.undo_change(self._change, now)
