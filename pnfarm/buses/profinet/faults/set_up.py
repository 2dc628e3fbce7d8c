"""The set-up of a PROFINET drive's connections: the Connect, and the ApplicationReady."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.faults.effects.parts import Part
from pnfarm.faults.effects.requests import ConnectRequests
from pnfarm.protocols.profinet.cm.ar import CmdevState
from pnfarm.protocols.profinet.errors import ErrorCode, pnio_error

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.protocols.profinet.errors import PnioStatus
    from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq

__all__ = ["SET_UP", "ReadyRule", "SetUp"]


class ReadyRule(Protocol):
    """Decides whether a connection's ApplicationReady is held back."""

    def decide(self, key: int, now: int) -> tuple[bool, int | None]:
        """(whether this rule acts on the AR of this key, nanoseconds or None for never)."""


class SetUp(ConnectRequests):
    """Rules on each AR with cyclic data: on its Connect request, and on its ApplicationReady."""

    def __init__(self, station: ProfinetDevice, settle: Callable[[int], None]) -> None:
        super().__init__()
        self._station = station
        self._settle = settle
        self._ready_rules: list[ReadyRule] = []

    def refresh(self, now: int) -> None:
        super().refresh(now)
        if self.hooks:
            self.apply()

    def apply(self) -> None:
        self._station.cm.refuse_connect = self._connecting if self.hooks else None

    def in_force(self) -> list[Any]:
        return [*self.hooks, *self._ready_rules]

    def refusal(self, values: Mapping[str, Any]) -> PnioStatus:
        return pnio_error(ErrorCode.CONNECT, values["code1"], values["code2"])

    def _connecting(self, request: ArBlockReq) -> PnioStatus | None:
        if request.device_access:
            return None
        status: PnioStatus | None = self.asked()
        return status

    def hold_ready(self, rule: ReadyRule) -> None:
        """Ask ``rule`` about each connection whose parameters are complete."""
        self._ready_rules.append(rule)
        self._station.connections.ready_delay = self._ready_delay

    def _ready_delay(self, key: int, sequence: int | None, now: int) -> int | None:
        """For a connection that is being set up; the latest rule that acts on it counts."""
        if sequence is not None or key not in self.waiting_for_ready():
            return 0
        for rule in reversed(self._ready_rules):
            acts, delay = rule.decide(key, now)
            if acts:
                return delay
        return 0

    def unhold_ready(self, rule: ReadyRule, held: Iterable[int], now: int) -> None:
        """Remove it: the connections of these keys, which it holds back, get their ApplicationReady."""
        self._ready_rules.remove(rule)
        if not self._ready_rules:
            self._station.connections.ready_delay = None
        for key in held:
            self._station.cm.application_ready(key, now)
        self._settle(now)

    def waiting_for_ready(self) -> frozenset[int]:
        """Keys of the ARs that are parametrised and have no ApplicationReady."""
        return frozenset(ar.key for ar in self._station.cm.ars if ar.state is CmdevState.W_ARDY)


SET_UP: Part[SetUp] = Part("connection set-up of PROFINET")
