"""What happens to a master and its slaves, as types (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pnfarm.buses.axis_program import PHASES
from pnfarm.station.events import Event, seconds

__all__ = ["ConnectFailed", "Connected", "ConnectionBroken", "DiagnosisRead", "PhaseChanged", "Released"]


@dataclass(frozen=True, slots=True)
class Connected(Event):
    """A slave exchanges data, so long after it was looked for first."""

    TEXT = "connected"
    after_ns: int
    address: int

    def details(self) -> dict[str, Any]:
        return {"connect_seconds": seconds(self.after_ns), "address": self.address}


@dataclass(frozen=True, slots=True)
class ConnectFailed(Event):
    """A slave does not answer, or does not take what the master wants."""

    TEXT = "connect failed"
    LEVEL = "warning"
    reason: str


@dataclass(frozen=True, slots=True)
class ConnectionBroken(Event):
    """A slave that exchanged data was lost."""

    TEXT = "connection lost"
    LEVEL = "warning"
    reason: str


@dataclass(frozen=True, slots=True)
class Released(Event):
    """The master released a slave."""

    TEXT = "released"


@dataclass(frozen=True, slots=True)
class DiagnosisRead(Event):
    """A slave in data exchange had a diagnosis; ``status`` names its bits, ``extended`` is in hexadecimal."""

    TEXT = "diagnosis"
    LEVEL = "warning"
    status: tuple[str, ...]
    extended: str

    def details(self) -> dict[str, Any]:
        return {"status": list(self.status), "extended": self.extended}


@dataclass(frozen=True, slots=True)
class PhaseChanged(Event):
    """An axis program goes on: numbers of :mod:`pnfarm.table.program`."""

    before: int
    after: int

    @property
    def text(self) -> str:
        return f"axis {PHASES[self.after]}"

    def details(self) -> dict[str, Any]:
        return {"before": PHASES[self.before]}
