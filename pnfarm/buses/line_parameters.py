"""How ``pnfarm param --line`` asks a station of a serial line for a parameter, whatever the bus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from pnfarm.buses.bus import LineBus

if TYPE_CHECKING:
    from pnfarm.links.base import Link, Port

__all__ = ["Asked", "AskedController", "LineParameterBus", "LineQuestion", "LineWork"]


@dataclass(frozen=True, slots=True)
class LineQuestion:
    """``station``: its address; ``own``: that of the one who asks; ``model``: whose names and types count, if any.

    ``value``: what is written, None to read; ``baud`` of the line.
    """

    station: int
    parameter: str
    value: int | None = None
    own: int = 0
    model: str | None = None
    baud: int = 1_500_000


class Asked(Protocol):
    """One question at work."""

    @property
    def done(self) -> bool: ...

    def result(self) -> dict[str, Any]:
        """As the API has a parameter: ``drive``, ``pnu``, ``subindex``, ``name``, ``value``, ``values``, ``unit``.

        Raises :class:`~pnfarm.errors.RemoteError` for a station that does not answer, and
        :class:`~pnfarm.drives.parameters.parameter.ParameterError` for what it refuses.
        """


@runtime_checkable
class AskedController(Protocol):
    """What a bus's controller does besides if its stations are asked for parameters by their address."""

    def ask_station(self, question: LineQuestion, now: int) -> Asked:
        """Raises :class:`~pnfarm.errors.ConfigError` or ``ParameterError`` for what cannot be asked."""


class LineWork(Protocol):
    """What has a serial line for itself; the link hands it what comes."""

    @property
    def done(self) -> bool: ...

    def start(self, now: int) -> None: ...

    def service(self, now: int) -> None:
        """Go on: time has passed."""

    def next_deadline(self) -> int | None:
        """When :meth:`service` is due."""


class LineAsker(Asked, LineWork, Protocol):
    """A question with a line for itself."""


@runtime_checkable
class LineParameterBus(LineBus, Protocol):
    """What a bus with a line says besides if parameters of its stations can be asked for by another master."""

    name: str

    def parameter_asker(self, link: Link, port: Port, question: LineQuestion) -> LineAsker:
        """Raises :class:`~pnfarm.errors.ConfigError` or ``ParameterError`` for what cannot be asked."""
