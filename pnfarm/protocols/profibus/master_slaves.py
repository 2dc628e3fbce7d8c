"""A slave as the master knows it: what it is to be, its state, and what happens to it.

EN 50170 part 2, 8.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from pnfarm.protocols.profibus.wire.telegram import FCB

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.protocols.profibus.master_access import Connection
    from pnfarm.protocols.profibus.wire.dp import Diagnosis

__all__ = [
    "ConnectionMade", "ConnectionMissed", "DiagnosisRead", "MasterEvent", "SlavePlan", "SlaveState", "Station",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class SlavePlan:
    """What a slave is to be.  ``reconnect_ns``: pause after a lost slave or a refusal, None: a lost one stays lost."""

    name: str
    address: int
    ident: int
    identifiers: bytes
    output_octets: int
    input_octets: int
    user: bytes = b""
    watchdog_factors: tuple[int, int] | None = None
    group: int = 0
    freeze: bool = False
    sync: bool = False
    reconnect_ns: int | None = 1_000_000_000
    #: How records are asked for: ``class-1`` or ``class-2``.
    access: str = "class-2"


class SlaveState(StrEnum):
    """States of the master's machine for one slave (8.2)."""

    WAITING = "waiting"
    DIAGNOSIS = "diagnosis"
    PARAMETERS = "parameters"
    CONFIGURATION = "configuration"
    CHECK = "check"
    DATA = "data-exchange"
    STOPPED = "stopped"


@dataclass(frozen=True, slots=True)
class MasterEvent:
    """Something happened to a slave, named as in its plan."""

    name: str


@dataclass(frozen=True, slots=True)
class ConnectionMade(MasterEvent):
    """Data are exchanged."""


@dataclass(frozen=True, slots=True)
class ConnectionMissed(MasterEvent):
    """A slave was lost, or refused what the master wants; ``exchanged``: data had been exchanged."""

    why: str
    exchanged: bool


@dataclass(frozen=True, slots=True)
class DiagnosisRead(MasterEvent):
    """A slave in data exchange had another diagnosis than before."""

    diagnosis: Diagnosis


@dataclass(slots=True)
class Station:
    """One slave as the master knows it."""

    plan: SlavePlan
    state: SlaveState = SlaveState.DIAGNOSIS
    outputs: bytes = b""
    inputs: bytes = b""
    diagnosis: Diagnosis | None = None
    wants_diagnosis: bool = False
    due_ns: int = 0
    fcb: int = FCB
    valid_fcb: bool = False
    diagnoses: int = 0
    polls: int = 0
    answers: int = 0
    retries: int = 0
    answered_ns: int = 0
    connects: int = 0
    losses: int = 0
    reason: str = ""
    #: Asked for the outputs of each poll; None: ``outputs`` as they are.
    source: Callable[[], bytes] | None = None
    connection: Connection = field(default=None)  # type: ignore[assignment]  # set by the master

    @property
    def exchanging(self) -> bool:
        return self.state is SlaveState.DATA and bool(self.inputs or not self.plan.input_octets)
