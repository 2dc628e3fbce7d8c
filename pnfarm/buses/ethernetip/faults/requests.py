"""What peers request of a drive on EtherNet/IP: Forward_Open, and its objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from pnfarm.buses.ethernetip.device.connections import nobody
from pnfarm.buses.ethernetip.faults.messages import ANSWER
from pnfarm.faults.effects.requests import ConnectRequests, ParameterAccess
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.gate.gate import DelayRule
from pnfarm.protocols.enip.connection_check import Refusal
from pnfarm.protocols.enip.object import Answer
from pnfarm.protocols.enip.status import ConnectionStatus, GeneralStatus

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Mapping

    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
    from pnfarm.faults.effects.wire import Wire
    from pnfarm.faults.gate.gate import LateRule
    from pnfarm.protocols.enip.message_router import ObjectPath
    from pnfarm.protocols.enip.wire.forward_open import ForwardOpen

__all__ = ["ExplicitAccess", "ForwardOpens"]

#: Transport class of cyclic data.
_CYCLIC: Final = 1


class ForwardOpens(ConnectRequests):
    """Forward_Open for cyclic data; what is in force survives a boot, as the device's own part does."""

    def __init__(self, device: EthernetIpDevice) -> None:
        super().__init__()
        self._device = device

    def refusal(self, values: Mapping[str, Any]) -> Refusal:
        status, extended = values["status"], values["extended"]
        if extended is None:
            words = (ConnectionStatus.OUT_OF_CONNECTIONS,) if status == GeneralStatus.CONNECTION_FAILURE else ()
        else:
            words = (extended,)
        return Refusal(*words, status=status)

    def apply(self) -> None:
        self._device.connections.refuse = self._refusal if self.hooks else nobody

    def _refusal(self, request: ForwardOpen) -> Refusal | None:
        if request.transport.transport != _CYCLIC:
            return None
        refusal = self.asked()
        return None if refusal is None else Refusal(*refusal.extended, status=refusal.status)


@dataclass(frozen=True, slots=True, eq=False)
class _Error:
    """An error status for what it matches; None: any."""

    class_id: int | None
    instance: int | None
    attribute: int | None
    answer: Answer
    given: Callable[[], None]

    def matches(self, path: ObjectPath, own: Container[int]) -> bool:
        """``own``: the classes of the application's objects."""
        if self.class_id is None and path.class_id not in own:
            return False
        return (
            self.class_id in {None, path.class_id}
            and self.instance in {None, path.instance_id}
            and self.attribute in {None, path.attribute_id}
        )


class ExplicitAccess(ParameterAccess):
    """Requests to the drive's objects, unconnected or of class 3, also within a Multiple_Service_Packet."""

    def __init__(self, device: EthernetIpDevice, wire: Wire, settle: Callable[[int], None]) -> None:
        super().__init__()
        self._device = device
        self._wire = wire
        self._settle = settle
        self._late: list[tuple[LateRule, DelayRule]] = []

    def in_force(self) -> list[Any]:
        return [*self.errors, *self._late]

    def error(self, values: Mapping[str, Any], given: Callable[[], None]) -> _Error:
        if values["class"] is None and values["instance"] is None and values["attribute"] is not None:
            what = "means nothing without a class or an instance: attributes of different classes share numbers"
            raise InjectionError([("params.attribute", what, "class, too")])
        extended = () if values["extended"] is None else (values["extended"],)
        answer = Answer(values["status"], b"", extended)
        return _Error(values["class"], values["instance"], values["attribute"], answer, given)

    def apply(self) -> None:
        self._device.adapter.router.refuse = self._refused if self.errors else None

    def _refused(self, path: ObjectPath, service: int) -> Answer | None:
        del service
        own = {one.class_id for one in self._device.kind.objects}
        for error in reversed(self.errors):
            if error.matches(path, own):
                error.given()
                answer: Answer = error.answer
                return answer
        return None

    def delay_answers(self, rule: LateRule) -> None:
        delay = DelayRule(frozenset({ANSWER}), rule)
        self._late.append((rule, delay))
        self._wire.delay(delay)

    def stop_delay(self, rule: LateRule, now: int) -> None:
        for known, delay in self._late:
            if known is rule:
                self._wire.undelay(delay)
        self._late = [entry for entry in self._late if entry[0] is not rule]
        self._settle(now)
