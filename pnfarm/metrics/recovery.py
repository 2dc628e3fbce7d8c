"""How fast the controller reacts: to a fault of a drive, and in bringing a lost drive back.

*Reaction* is the time from a fault to the withdrawal of the enable (the engine's FAULT_REACTED).

*Reconnect* is the time for which a drive was out of service.  It begins when a drive that has a controller raises a
fault, loses its connection or its supply, and ends when it exchanges data again, without a fault, and in S4 if it
was there when it began.  A connection that the controller releases is not a loss.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.station.events import (
    ConnectionEstablished,
    ConnectionLost,
    ConnectionReleased,
    FaultRaised,
    FaultReacted,
    FaultsCleared,
    PowerLost,
    StateChanged,
    WatchdogExpired,
)
from pnfarm.table.axis_codes import FAULT_SLOTS

if TYPE_CHECKING:
    from pnfarm.farm.core import FarmCore
    from pnfarm.station.event_log import LogEntry
    from pnfarm.station.station import Station

__all__ = ["REACTION_EDGES_NS", "Recovery"]

#: Upper bounds of both histograms, nanoseconds; a last bucket takes the rest.
REACTION_EDGES_NS = (
    1_000_000, 2_000_000, 4_000_000, 8_000_000, 16_000_000, 32_000_000, 64_000_000, 128_000_000, 256_000_000,
    512_000_000, 1_000_000_000, 2_000_000_000, 4_000_000_000, 8_000_000_000, 16_000_000_000, 32_000_000_000,
)  # fmt: skip

#: State S4, operation.
OPERATION = 4


@dataclass(slots=True)
class _Drive:
    """What the events say about one drive."""

    connected: bool
    faulted: bool
    state: int
    left_operation_ns: int = 0
    lost_ns: int | None = None
    wants_operation: bool = False


class Recovery:
    """Listens to what happens in a farm; ``reactions`` and ``reconnects`` are counts ``(drives, buckets)``."""

    def __init__(self, core: FarmCore) -> None:
        count = len(core.stations)
        self._edges = np.array(REACTION_EDGES_NS, np.int64)
        self.reactions: Any = np.zeros((count, len(REACTION_EDGES_NS) + 1), np.int64)
        self.reaction_sums_ns: Any = np.zeros(count, np.int64)
        self.reconnects: Any = np.zeros((count, len(REACTION_EDGES_NS) + 1), np.int64)
        self.reconnect_sums_ns: Any = np.zeros(count, np.int64)
        self._by_name = {station.configured_name: station for station in core.stations}
        self._drives = [self._look(station) for station in core.stations]
        self._unsubscribe = core.log.subscribe(self._take)

    def close(self) -> None:
        """Stop listening."""
        self._unsubscribe()

    @staticmethod
    def _is_connected(station: Station) -> bool:
        return station.device.connected

    def _look(self, station: Station) -> _Drive:
        axis = station.handle.axis
        faulted = bool(axis.faults.code[:FAULT_SLOTS].any())
        return _Drive(connected=self._is_connected(station), faulted=faulted, state=int(axis.drive.state))

    # -- what happens ------------------------------------------------------------------------------------------------

    def _take(self, entry: LogEntry) -> None:
        station = self._by_name.get(entry.drive)
        if station is None:
            return
        index, when = station.index, entry.now_ns
        drive = self._drives[index]
        match entry.what:
            case StateChanged(before, after):
                drive.state = after
                if before == OPERATION:
                    drive.left_operation_ns = when
                self._judge(index, drive, when)
            case FaultRaised():
                drive.faulted = True
                if drive.connected:
                    self._begin(drive, when)
            case FaultsCleared():
                drive.faulted = False
                self._judge(index, drive, when)
            case FaultReacted(after_ns):
                self.reactions[index, self._bucket(after_ns)] += 1
                self.reaction_sums_ns[index] += after_ns
            case WatchdogExpired():
                if drive.connected:
                    self._begin(drive, when)
            case ConnectionEstablished():
                drive.connected = True
                self._judge(index, drive, when)
            case ConnectionLost() | PowerLost():
                if self._ended(drive, station):
                    self._begin(drive, when)
            case ConnectionReleased():
                # not a loss: the controller meant it
                self._ended(drive, station)
            case _:
                pass

    def _ended(self, drive: _Drive, station: Station) -> bool:
        """Whether the drive had a connection, and this was its last one."""
        if not drive.connected or self._is_connected(station):
            return False
        drive.connected = False
        return True

    # -- what follows ------------------------------------------------------------------------------------------------

    def _bucket(self, value_ns: int) -> int:
        return int(np.searchsorted(self._edges, value_ns))

    @staticmethod
    def _begin(drive: _Drive, when: int) -> None:
        if drive.lost_ns is None:
            drive.lost_ns = when
            # the firmware reports the state that it left before it reports the fault, both in one step
            drive.wants_operation = drive.state == OPERATION or drive.left_operation_ns == when

    def _judge(self, index: int, drive: _Drive, when: int) -> None:
        """Whether the drive is back."""
        if drive.lost_ns is None or not drive.connected or drive.faulted:
            return
        if drive.wants_operation and drive.state != OPERATION:
            return
        duration = max(0, when - drive.lost_ns)
        drive.lost_ns = None
        self.reconnects[index, self._bucket(duration)] += 1
        self.reconnect_sums_ns[index] += duration
