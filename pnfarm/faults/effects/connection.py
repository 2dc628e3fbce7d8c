"""A drive's cyclic connection, as injections see it.  Each bus has its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from pnfarm.faults.effects.parts import DrivePart, Part
from pnfarm.table.access.plain import plain
from pnfarm.table.channel import IDLE

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.engine.columns import Columns
    from pnfarm.station.device import ChannelCounts

__all__ = ["CONNECTION", "Connection", "ConnectionPart", "ProviderConnection", "Status"]


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


class ProviderConnection(ConnectionPart):
    """One whose frames the engine sends: rows of its table of providers, and counts of those that are closed."""

    def __init__(self, columns: Columns, settle: Callable[[int], None]) -> None:
        self._columns = columns
        self._ppm = plain(columns.ppm)
        self._settle = settle

    @property
    @abstractmethod
    def providers(self) -> list[int]:
        """Numbers of the open rows."""

    @property
    @abstractmethod
    def closed(self) -> ChannelCounts:
        """Counts of the closed ones."""

    @property
    def next_ns(self) -> int:
        """When the next cyclic frame is due."""
        rows = [self._ppm[number] for number in self.providers]
        return min((int(row["next_ns"]) for row in rows if row["state"] != IDLE), default=0)

    def cycles(self) -> int:
        rows = [self._ppm[number] for number in self.providers]
        return (
            self.closed.sent + self.closed.suppressed + sum(int(row["sent"]) + int(row["suppressed"]) for row in rows)
        )

    def sent_data(self, since: int) -> bool:
        return any(int(self._ppm[number]["last_ns"]) >= since for number in self.providers)


CONNECTION: Part[ConnectionPart] = Part("cyclic connection")
