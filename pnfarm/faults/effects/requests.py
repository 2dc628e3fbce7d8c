"""What peers request of a drive, as injections see it: connections, and parameters.  Each bus has its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.parts import DrivePart, InForce, Part

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.faults.gate.gate import LateRule

__all__ = ["CONNECT_REQUESTS", "PARAMETER_ACCESS", "ConnectRequests", "ParameterAccess"]


class ConnectRequests(DrivePart, ABC):
    """Requests for cyclic connections.

    Each hook is asked about every readable one, at its time; what it returns refuses the request, None does not.
    """

    def __init__(self) -> None:
        self.hooks: InForce[Callable[[int], Any]] = InForce(self.apply)
        self._now = 0

    def refresh(self, now: int) -> None:
        self._now = now

    def in_force(self) -> list[Any]:
        return list(self.hooks)

    @abstractmethod
    def apply(self) -> None:
        """Apply the hooks to the drive's present machines."""

    def asked(self) -> Any:
        """What refuses the present request; None for none."""
        # one that refuses may be the last that its injection refuses
        return next((refusal for hook in list(self.hooks) if (refusal := hook(self._now)) is not None), None)

    @abstractmethod
    def refusal(self, values: Mapping[str, Any]) -> Any:
        """What refuses a request, by the parameters that a bus gives to ``connect-refuse``.

        Raises :class:`~pnfarm.faults.errors.InjectionError` for what cannot be expressed.
        """


class ParameterAccess(DrivePart, ABC):
    """Requests for the drive's parameters and objects, beside its cyclic data.

    ``errors`` refuse requests; the latest counts.
    """

    def __init__(self) -> None:
        self.errors: InForce[Any] = InForce(self.apply)

    def rebooted(self, now: int) -> None:
        del now
        self.apply()

    @abstractmethod
    def apply(self) -> None:
        """Apply what is in force to the drive's present machines."""

    @abstractmethod
    def error(self, values: Mapping[str, Any], given: Callable[[], None]) -> Any:
        """An error by the parameters that a bus gives to ``record-error``; ``given()`` is called for each use.

        Raises :class:`~pnfarm.faults.errors.InjectionError` for what cannot be expressed.
        """

    @abstractmethod
    def delay_answers(self, rule: LateRule) -> None:
        """Ask ``rule`` for the delay of each answer; delays of several rules add up."""

    @abstractmethod
    def stop_delay(self, rule: LateRule, now: int) -> None:
        """Remove it; after the last rule, answers held back leave."""


CONNECT_REQUESTS: Part[ConnectRequests] = Part("requests for connections")
PARAMETER_ACCESS: Part[ParameterAccess] = Part("requests for parameters")
