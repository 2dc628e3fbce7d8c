"""Effects that change what is in a slot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults.modules import ModuleChange
from pnfarm.buses.profinet.faults.reported_effect import ReportedEffect
from pnfarm.faults.kind import WORD, ParamSpec
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmType

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.cm.device.events import AlarmConfirmed

__all__ = ["ONE_SUBSLOT", "SLOT", "SUBSLOT", "SlotEffect"]

SLOT = ParamSpec("whole number", "The slot; left out, the telegram's.", **WORD)
SUBSLOT = ParamSpec("whole number", "The subslot; left out, the one that carries the set points.", **WORD)
ONE_SUBSLOT = ParamSpec("whole number", "One submodule; left out, the whole module.", **WORD)

_GONE = frozenset({AlarmType.PULL, AlarmType.PULL_MODULE, AlarmType.PLUG_WRONG_SUBMODULE})


class SlotEffect(ReportedEffect):
    """Confirmed by the alarms for a submodule that is gone or wrong."""

    def prepare(self) -> None:
        _, slot, _ = self.modules.place(self.values["slot"], None)
        given = {name: self.values[name] for name in ("telegram", "ident", "substitute") if name in self.values}
        self._other = ModuleChange(slot, self.values["subslot"], self.values["missing"], **given)

    def _change(self, now: int) -> None:
        self.modules.change(self._other, now)

    def _restore(self, now: int) -> None:
        self.modules.undo_change(self._other, now)

    def _is_about(self, event: AlarmConfirmed) -> bool:
        change = self._other
        return event.alarm_type in _GONE and event.slot == change.slot and change.subslot in {None, event.subslot}

    def _is_in_diff(self) -> bool:
        return self.modules.in_diff_at_connect(self._other.slot, self._other.subslot, self._standing)
