"""A drive's cyclic connection, as injections see it.  Each bus has its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum

from pnfarm.faults.effects.parts import DrivePart, Part

__all__ = ["CONNECTION", "Connection", "ConnectionPart", "Status"]


@dataclass(frozen=True, slots=True)
class Connection:
    """The present connection.

    ``keys`` are never reused, not even after a reboot; ``established`` once data flows both ways.
    ``watchdog_ns`` is the time without the drive's data after which the controller ends it; ``next_ns`` is when the
    drive's next cyclic frame is due.
    """

    keys: frozenset[int]
    established: bool
    cycle_ns: int
    watchdog_ns: int
    next_ns: int


class Status(StrEnum):
    """States that a drive can report in a cyclic frame, whatever the bus calls them."""

    FAULT = "fault"
    WARNING = "warning"
    INHIBITED = "inhibited"


class ConnectionPart(DrivePart, ABC):
    """Actions on a connection, and what can be observed of it."""

    @abstractmethod
    def now(self) -> Connection | None:
        """None without a cyclic connection."""

    @abstractmethod
    def cycles(self) -> int:
        """Cycles in which the drive has sent since the farm started, over all connections."""

    @abstractmethod
    def abort(self, code: int, now: int) -> int:
        """Abort it as the bus does, with an error code of the bus; returns how many connections ended."""

    @abstractmethod
    def expire(self, now: int) -> int:
        """End it as if the drive's watchdog had expired; returns how many connections ended."""

    @abstractmethod
    def sent_data(self, since: int) -> bool:
        """Whether a cyclic frame left at or after ``since``."""

    def reports(self, status: Status) -> bool:
        """Whether its cyclic frames can report this status at all."""
        del status
        return True

    @abstractmethod
    def sent_status(self, status: Status, since: int) -> bool:
        """Whether a cyclic frame that left at or after ``since`` reports this status."""


CONNECTION: Part[ConnectionPart] = Part("cyclic connection")
