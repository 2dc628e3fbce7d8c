"""What peers request of a drive, as injections see it: connections, and parameters.  Each bus has its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.parts import DrivePart, Part

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.faults.gate.gate import LateRule

__all__ = ["CONNECT_REQUESTS", "PARAMETER_ACCESS", "ConnectRequests", "ParameterAccess"]


class ConnectRequests(DrivePart, ABC):
    """Requests for cyclic connections."""

    @abstractmethod
    def refusal(self, values: Mapping[str, Any]) -> Any:
        """What refuses a request, by the parameters that a bus gives to ``connect-refuse``.

        Raises :class:`~pnfarm.faults.errors.InjectionError` for what cannot be said.
        """

    @abstractmethod
    def hook_connect(self, hook: Callable[[int], Any]) -> None:
        """Ask ``hook(now)`` about every readable request; what it returns refuses it, None does not."""

    @abstractmethod
    def unhook_connect(self, hook: Callable[[int], Any]) -> None:
        """Remove it."""


class ParameterAccess(DrivePart, ABC):
    """Requests for the drive's parameters and objects, beside its cyclic data."""

    @abstractmethod
    def error(self, values: Mapping[str, Any], given: Callable[[], None]) -> Any:
        """An error by the parameters that a bus gives to ``record-error``; ``given()`` is called for each use.

        Raises :class:`~pnfarm.faults.errors.InjectionError` for what cannot be said.
        """

    @abstractmethod
    def refuse_records(self, error: Any) -> None:
        """Refuse requests with this error.  The latest counts."""

    @abstractmethod
    def allow_records(self, error: Any) -> None:
        """Remove it."""

    @abstractmethod
    def delay_answers(self, rule: LateRule) -> None:
        """Ask ``rule`` for the delay of each answer; delays of several rules add up."""

    @abstractmethod
    def stop_delay(self, rule: LateRule, now: int) -> None:
        """Remove it; after the last rule, answers held back leave."""


CONNECT_REQUESTS: Part[ConnectRequests] = Part("requests for connections")
PARAMETER_ACCESS: Part[ParameterAccess] = Part("requests for parameters")
