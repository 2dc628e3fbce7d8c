"""A PROFINET drive's records: refused, held back, answered late."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.parts import InForce, Part
from pnfarm.faults.effects.requests import ParameterAccess
from pnfarm.protocols.profinet.errors import PnioStatus, RecordError
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.faults.gate.gate import LateRule
    from pnfarm.protocols.profinet.rpc.events import CallKey

__all__ = ["RECORDS", "Records"]

_RECORDS = frozenset({Opnum.READ, Opnum.WRITE, Opnum.READ_IMPLICIT})


@dataclass(frozen=True, slots=True)
class _CountedError(RecordError):
    """An error code that counts its uses."""

    given: Callable[[], None] = field(kw_only=True)

    def status(self, service: int) -> PnioStatus:
        self.given()
        # a dataclass with slots is made twice, so that a bare super() would look for the first
        return RecordError.status(self, service)


class Records(ParameterAccess):
    """Applies what is in force to the drive's present handler and RPC server (:class:`~.rpc_events.LateAnswers`)."""

    def __init__(self, station: ProfinetDevice, settle: Callable[[int], None]) -> None:
        super().__init__()
        self._station = station
        self._settle = settle
        #: Asked at each read of a pending parameter response whether it is held back.
        self.holds: InForce[Callable[[int], bool]] = InForce(self.apply)
        self._late: list[LateRule] = []
        self._kept: dict[CallKey, list[LateRule]] = {}

    def rebooted(self, now: int) -> None:
        # what was held back never leaves
        kept, self._kept = self._kept, {}
        for rules in kept.values():
            for rule in rules:
                rule.left(sent=False)
        if self._late:
            self._station.rpc.late = self
        super().rebooted(now)

    def in_force(self) -> list[Any]:
        return [*self.errors, *self.holds, *self._late]

    def error(self, values: Mapping[str, Any], given: Callable[[], None]) -> RecordError:
        return _CountedError(values["code"], values["code2"], given=given)

    def apply(self) -> None:
        records = self._station.kind.records
        # its status is read at each refusal
        records.error = self.errors[-1] if self.errors else None
        records.withhold = self._holding if self.holds else None

    def _holding(self, now: int) -> bool:
        # every hook is called, so that its sequence does not depend on the others
        return any([hook(now) for hook in self.holds])  # noqa: C419 - see above

    # answers to Read and Write

    def delay_answers(self, rule: LateRule) -> None:
        """Ask ``rule`` for the delay of each answer to a Read or Write; delays of several rules add up."""
        self._late.append(rule)
        self._station.rpc.late = self

    def stop_delay(self, rule: LateRule, now: int) -> None:
        self._late = [other for other in self._late if other is not rule]
        if not self._late:
            self._station.rpc.release_answers(now)
            self._station.rpc.late = None
        self._settle(now)

    def wait_ns(self, call: CallKey, opnum: int, now: int) -> int:
        if opnum not in _RECORDS:
            return 0
        waits = [(rule, rule.asked(now)) for rule in self._late]
        acting = [rule for rule, wait in waits if wait]
        if acting:
            self._kept[call] = acting
        return sum(wait for _, wait in waits)

    def left(self, call: CallKey, *, sent: bool) -> None:
        for rule in self._kept.pop(call, ()):
            rule.left(sent=sent)


RECORDS: Part[Records] = Part("records of PROFINET")
