"""A drive's cyclic connection, as injections see it.  Each bus has its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum

from pnfarm.faults.parts import DrivePart, Part

__all__ = ["CONNECTION", "Connection", "ConnectionPart", "Status"]


@dataclass(frozen=True, slots=True)
class Connection:
    """The connection that stands.

    ``keys`` are never used twice, not even after a reboot; ``established`` once data flows both ways.
    ``watchdog_ns`` is after how long without the drive's data the controller gives up; ``next_ns`` is when the drive's
    next cyclic frame is due.
    """

    keys: frozenset[int]
    established: bool
    cycle_ns: int
    watchdog_ns: int
    next_ns: int


class Status(StrEnum):
    """What a drive's status in a cyclic frame can say, whatever the bus calls it."""

    FAULT = "fault"
    WARNING = "warning"
    INHIBITED = "inhibited"


class ConnectionPart(DrivePart, ABC):
    """What can be done to a connection, and what can be watched of it."""

    @abstractmethod
    def now(self) -> Connection | None:
        """None without a cyclic connection."""

    @abstractmethod
    def cycles(self) -> int:
        """Cycles that the drive has sent in since the farm started, over all connections."""

    @abstractmethod
    def abort(self, code: int, now: int) -> int:
        """End it as the bus does, with an error code of the bus; how many connections ended."""

    @abstractmethod
    def expire(self, now: int) -> int:
        """End it as if the drive had not heard its controller for too long; how many connections ended."""

    @abstractmethod
    def sent_data(self, since: int) -> bool:
        """Whether a cyclic frame left at or after ``since``."""

    @abstractmethod
    def sent_status(self, status: Status, since: int) -> bool:
        """Whether a cyclic frame that left at or after ``since`` says so."""


CONNECTION: Part[ConnectionPart] = Part("cyclic connection")
