"""Who changed what through the API, as entries of the event log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.api.guard import WHO
from pnfarm.station.events import Event

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fastapi import Request

__all__ = ["FaultCleared", "FaultRequested", "ParameterWritten", "PowerCycleRequested", "shortened", "who"]

#: Names of drives in one entry.
MOST_NAMES = 16


@dataclass(frozen=True, slots=True)
class _Change(Event):
    """``who``: ``token``, or ``loopback`` where none is needed; ``peer`` is the client's address."""

    who: str
    peer: str


@dataclass(frozen=True, slots=True)
class FaultRequested(_Change):
    """A client injected a fault."""

    TEXT = "fault requested"
    LEVEL = "warning"
    id: str
    kind: str
    drives: str


@dataclass(frozen=True, slots=True)
class FaultCleared(_Change):
    """A client cleared a fault, or reset them all."""

    TEXT = "fault cleared by a client"
    id: str
    kind: str
    drives: str


@dataclass(frozen=True, slots=True)
class ParameterWritten(_Change):
    """A client wrote a parameter."""

    TEXT = "parameter written by a client"
    parameter: str
    value: int


@dataclass(frozen=True, slots=True)
class PowerCycleRequested(_Change):
    """A client switched the drive off and on."""

    TEXT = "power cycle requested"


def who(request: Request) -> tuple[str, str]:
    """By what the client was let in, and its address."""
    peer = request.client.host if request.client is not None else "unknown"
    return str(request.scope.get(WHO, "unknown")), peer


def shortened(drives: Sequence[str]) -> str:
    """Names of drives for one line."""
    more = len(drives) - MOST_NAMES
    return " ".join(drives[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
