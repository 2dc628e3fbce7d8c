"""What masters ask of a drive on PROFIBUS: Set_Prm, and its parameters as records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.requests import ConnectRequests, ParameterAccess

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.buses.profibus.device.device import ProfibusDevice
    from pnfarm.faults.gate.gate import LateRule

__all__ = ["Records", "SetParameters"]


class SetParameters(ConnectRequests):
    """Set_Prm: what is in force survives a boot."""

    def __init__(self, device: ProfibusDevice) -> None:
        self._device = device
        self._hooks: list[Callable[[int], Any]] = []
        self._now = 0

    def refresh(self, now: int) -> None:
        self._now = now

    def rebooted(self, now: int) -> None:
        del now
        self._put()

    def in_force(self) -> list[Any]:
        return list(self._hooks)

    def refusal(self, values: Mapping[str, Any]) -> str:
        """The wire has no code: the diagnosis says Prm_Fault."""
        del values
        return "refused by an injected fault"

    def hook_connect(self, hook: Callable[[int], Any]) -> None:
        self._hooks.append(hook)
        self._put()

    def unhook_connect(self, hook: Callable[[int], Any]) -> None:
        self._hooks.remove(hook)
        self._put()

    def _put(self) -> None:
        self._device.slave.refuse_set_up = self._asked if self._hooks else None

    def _asked(self) -> str | None:
        for hook in list(self._hooks):
            if (refusal := hook(self._now)) is not None:
                return str(refusal)
        return None


@dataclass(frozen=True, slots=True, eq=False)
class _Error:
    """Error_Code_1 of the negative responses."""

    code: int
    given: Callable[[], None]


class Records(ParameterAccess):
    """Reads and writes on MSAC1 and MSAC2."""

    def __init__(self, device: ProfibusDevice, settle: Callable[[int], None]) -> None:
        self._device = device
        self._settle = settle
        self._errors: list[_Error] = []
        self._late: list[LateRule] = []
        #: When the answer that is asked for may go, by nothing but its turn: there is one at a time for each client.
        self._until: int | None = None

    def rebooted(self, now: int) -> None:
        del now
        self._until = None
        self._put()

    def in_force(self) -> list[Any]:
        return [*self._errors, *self._late]

    def error(self, values: Mapping[str, Any], given: Callable[[], None]) -> _Error:
        return _Error(values["error"], given)

    def refuse_records(self, error: _Error) -> None:
        self._errors.append(error)
        self._put()

    def allow_records(self, error: _Error) -> None:
        self._errors = [other for other in self._errors if other is not error]
        self._put()

    def delay_answers(self, rule: LateRule) -> None:
        self._late.append(rule)
        self._put()

    def stop_delay(self, rule: LateRule, now: int) -> None:
        self._late = [other for other in self._late if other is not rule]
        if not self._late:
            self._until = None
        self._put()
        self._settle(now)

    def _put(self) -> None:
        user = self._device.user
        user.error = (self._errors[-1].code, 0) if self._errors else None
        user.given = self._errors[-1].given if self._errors else lambda: None
        user.withhold = self._withheld if self._late else None

    def _withheld(self, now: int) -> bool:
        if self._until is None:
            late = sum(rule.asked(now) for rule in self._late)
            if not late:
                return False
            self._until = now + late
        if now < self._until:
            return True
        self._until = None
        for rule in self._late:
            rule.left(sent=True)
        return False
