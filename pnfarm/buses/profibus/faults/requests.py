"""What masters ask of a drive on PROFIBUS: Set_Prm, and its parameters as records."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.parts import InForce
from pnfarm.faults.effects.requests import ConnectRequests, ParameterAccess

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.buses.profibus.device.device import ProfibusDevice
    from pnfarm.faults.gate.gate import LateRule

__all__ = ["Records", "SetParameters"]


class SetParameters(ConnectRequests):
    """Set_Prm: what is in force survives a boot."""

    def __init__(self, device: ProfibusDevice) -> None:
        super().__init__()
        self._device = device

    def rebooted(self, now: int) -> None:
        del now
        self.apply()

    def refusal(self, values: Mapping[str, Any]) -> str:
        """The wire has no code: the diagnosis says Prm_Fault."""
        del values
        return "refused by an injected fault"

    def apply(self) -> None:
        self._device.slave.refuse_set_up = self.asked if self.hooks else None


@dataclass(frozen=True, slots=True, eq=False)
class _Error:
    """Error_Code_1 of the negative responses."""

    code: int
    given: Callable[[], None]


class Records(ParameterAccess):
    """Reads and writes on MSAC1 and MSAC2."""

    def __init__(self, device: ProfibusDevice, settle: Callable[[int], None]) -> None:
        super().__init__()
        self._device = device
        self._settle = settle
        self._late: InForce[LateRule] = InForce(self.apply)
        #: By client, of which each waits for one answer at a time: when it may go, and the rules that hold it back.
        self._held: dict[int, tuple[int, list[LateRule]]] = {}

    def rebooted(self, now: int) -> None:
        for client in list(self._held):
            self._left(client, sent=False)
        super().rebooted(now)

    def in_force(self) -> list[Any]:
        return [*self.errors, *self._late]

    def error(self, values: Mapping[str, Any], given: Callable[[], None]) -> _Error:
        return _Error(values["error"], given)

    def delay_answers(self, rule: LateRule) -> None:
        self._late.put(rule)

    def stop_delay(self, rule: LateRule, now: int) -> None:
        self._late.take(rule)
        for client, (_, rules) in list(self._held.items()):
            if rule in rules:
                rules.remove(rule)
            if not rules:
                del self._held[client]
        self._settle(now)

    def apply(self) -> None:
        user = self._device.user
        user.error = (self.errors[-1].code, 0) if self.errors else None
        user.given = self.errors[-1].given if self.errors else lambda: None
        user.withhold = self._withheld if self._late else None
        user.gone = partial(self._left, sent=False)

    def _withheld(self, client: int, now: int) -> bool:
        if client not in self._held:
            waits = [(rule, rule.asked(now)) for rule in self._late]
            rules = [rule for rule, wait in waits if wait]
            if not rules:
                return False
            self._held[client] = now + sum(wait for _, wait in waits), rules
        if now < self._held[client][0]:
            return True
        self._left(client, sent=True)
        return False

    def _left(self, client: int, *, sent: bool) -> None:
        _, rules = self._held.pop(client, (0, ()))
        for rule in rules:
            rule.left(sent=sent)
