"""The set-up of a PROFINET drive's connections: the Connect, and the ApplicationReady."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.faults.effects.parts import Part
from pnfarm.faults.effects.requests import ConnectRequests
from pnfarm.protocols.profinet.cm.ar import CmdevState
from pnfarm.protocols.profinet.errors import ErrorCode, pnio_error
from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq, ArProperties

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.protocols.profinet.errors import PnioStatus

__all__ = ["SET_UP", "ReadyRule", "SetUp"]


class ReadyRule(Protocol):
    """Decides whether a connection's ApplicationReady is held back."""

    def decide(self) -> tuple[bool, int | None]:
        """(whether this rule acts on the present connection, nanoseconds or None for never)."""


class SetUp(ConnectRequests):
    """Rules on each AR with cyclic data, from its Connect request on."""

    def __init__(self, station: ProfinetDevice, settle: Callable[[int], None]) -> None:
        super().__init__()
        self._station = station
        self._settle = settle
        self._ready_rules: list[ReadyRule] = []

    def refresh(self, now: int) -> None:
        super().refresh(now)
        if self.hooks or self._ready_rules:
            self.apply()

    def apply(self) -> None:
        self._station.cm.refuse_connect = self._connecting if self.hooks or self._ready_rules else None

    def in_force(self) -> list[Any]:
        return [*self.hooks, *self._ready_rules]

    def refusal(self, values: Mapping[str, Any]) -> PnioStatus:
        return pnio_error(ErrorCode.CONNECT, values["code1"], values["code2"])

    def _connecting(self, request: ArBlockReq) -> PnioStatus | None:
        if request.properties & ArProperties.DEVICE_ACCESS:
            return None
        status: PnioStatus | None = self.asked()
        if status is None:
            self._decide_ready()
        return status

    def hold_ready(self, rule: ReadyRule) -> None:
        """Ask ``rule`` about each connection, also the one that is being set up."""
        self._ready_rules.append(rule)
        self.apply()
        if any(not ar.established for ar in self._station.ars.values()):
            self._decide_ready()

    def _decide_ready(self) -> None:
        """For the connection that is being set up; the latest rule that acts on it counts."""
        delay: int | None = 0
        for rule in reversed(self._ready_rules):
            acts, wanted = rule.decide()
            if acts:
                delay = wanted
                break
        self._station.connections.ready_delay_ns = delay

    def unhold_ready(self, rule: ReadyRule, now: int) -> None:
        """Remove it: connections that no other rule holds back get their ApplicationReady."""
        self._ready_rules.remove(rule)
        self.apply()
        if self._ready_rules:
            self._decide_ready()
            return
        self._station.connections.ready_delay_ns = 0
        for key in self.waiting_for_ready():
            self._station.cm.application_ready(key, now)
        self._settle(now)

    def waiting_for_ready(self) -> frozenset[int]:
        """Keys of the ARs that are parametrised and have no ApplicationReady."""
        return frozenset(ar.key for ar in self._station.cm.ars if ar.state is CmdevState.W_ARDY)


SET_UP: Part[SetUp] = Part("connection set-up of PROFINET")
