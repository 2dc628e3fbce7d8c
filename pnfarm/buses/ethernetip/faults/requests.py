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
    from collections.abc import Callable, Mapping

    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
    from pnfarm.faults.effects.wire import Wire
    from pnfarm.faults.gate.gate import LateRule
    from pnfarm.protocols.enip.message_router import ObjectPath
    from pnfarm.protocols.enip.wire.forward_open import ForwardOpen

__all__ = ["APPLICATION_CLASSES", "ExplicitAccess", "ForwardOpens"]

#: The drive's own objects: Parameter, Position Controller Supervisor, Position Controller.
APPLICATION_CLASSES: Final = frozenset({0x0F, 0x24, 0x25})
#: Transport class of cyclic data.
_CYCLIC: Final = 1


class ForwardOpens(ConnectRequests):
    """Forward_Open for cyclic data; what is in force survives a boot, as the device's own part does."""

    def __init__(self, device: EthernetIpDevice) -> None:
        self._device = device
        self._hooks: list[Callable[[int], Any]] = []
        self._now = 0

    def refresh(self, now: int) -> None:
        self._now = now

    def in_force(self) -> list[Any]:
        return list(self._hooks)

    def refusal(self, values: Mapping[str, Any]) -> Refusal:
        status, extended = values["status"], values["extended"]
        if extended is None:
            words = (ConnectionStatus.OUT_OF_CONNECTIONS,) if status == GeneralStatus.CONNECTION_FAILURE else ()
        else:
            words = (extended,)
        return Refusal(*words, status=status)

    def hook_connect(self, hook: Callable[[int], Any]) -> None:
        self._hooks.append(hook)
        self._device.connections.refuse = self._asked

    def unhook_connect(self, hook: Callable[[int], Any]) -> None:
        self._hooks.remove(hook)
        if not self._hooks:
            self._device.connections.refuse = nobody

    def _asked(self, request: ForwardOpen) -> Refusal | None:
        if request.transport.transport != _CYCLIC:
            return None
        for hook in list(self._hooks):
            refusal = hook(self._now)
            if refusal is not None:
                return Refusal(*refusal.extended, status=refusal.status)
        return None


@dataclass(frozen=True, slots=True, eq=False)
class _Error:
    """An error status for what it matches; None: any."""

    class_id: int | None
    instance: int | None
    attribute: int | None
    answer: Answer
    given: Callable[[], None]

    def matches(self, path: ObjectPath) -> bool:
        if self.class_id is None and path.class_id not in APPLICATION_CLASSES:
            return False
        return (
            self.class_id in {None, path.class_id}
            and self.instance in {None, path.instance_id}
            and self.attribute in {None, path.attribute_id}
        )


class ExplicitAccess(ParameterAccess):
    """Requests to the drive's objects, unconnected or of class 3, also within a Multiple_Service_Packet."""

    def __init__(self, device: EthernetIpDevice, wire: Wire, settle: Callable[[int], None]) -> None:
        self._device = device
        self._wire = wire
        self._settle = settle
        self._errors: list[_Error] = []
        self._late: list[tuple[LateRule, DelayRule]] = []

    def rebooted(self, now: int) -> None:
        del now
        self._put()

    def in_force(self) -> list[Any]:
        return [*self._errors, *self._late]

    def error(self, values: Mapping[str, Any], given: Callable[[], None]) -> _Error:
        if values["class"] is None and values["instance"] is None and values["attribute"] is not None:
            what = "means nothing without a class or an instance: attributes of different classes share numbers"
            raise InjectionError([("params.attribute", what, "class, too")])
        extended = () if values["extended"] is None else (values["extended"],)
        answer = Answer(values["status"], b"", extended)
        return _Error(values["class"], values["instance"], values["attribute"], answer, given)

    def refuse_records(self, error: _Error) -> None:
        self._errors.append(error)
        self._put()

    def allow_records(self, error: _Error) -> None:
        self._errors = [other for other in self._errors if other is not error]
        self._put()

    def _put(self) -> None:
        self._device.adapter.router.refuse = self._refused if self._errors else None

    def _refused(self, path: ObjectPath, service: int) -> Answer | None:
        del service
        for error in reversed(self._errors):
            if error.matches(path):
                error.given()
                return error.answer
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
