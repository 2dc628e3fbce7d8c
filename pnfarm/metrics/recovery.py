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

from pnfarm.metrics.families import OTHER
from pnfarm.station.axis import Axis, axes_by_name
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
from pnfarm.table.image import LOST_EXPIRED

if TYPE_CHECKING:
    from pnfarm.farm.core import FarmCore
    from pnfarm.station.event_log import LogEntry

__all__ = ["REACTION_EDGES_NS", "RECONNECT_EDGES_NS", "Reaction", "Recovery"]

#: Upper bounds of the reactions' histogram, nanoseconds; a last bucket takes the rest.  The programs of controllers
#: react within a few cycles, hence the fine steps up to 64 ms.
REACTION_EDGES_NS = (
    1_000_000, 2_000_000, 4_000_000, 8_000_000, 12_000_000, 16_000_000, 24_000_000, 32_000_000, 48_000_000, 64_000_000,
    128_000_000, 256_000_000, 1_000_000_000, 4_000_000_000,
)  # fmt: skip
#: The same for reconnects.
RECONNECT_EDGES_NS = (
    32_000_000, 64_000_000, 128_000_000, 256_000_000, 512_000_000, 1_000_000_000, 2_000_000_000, 4_000_000_000,
    8_000_000_000, 16_000_000_000, 32_000_000_000, 64_000_000_000,
)  # fmt: skip
#: Histograms of reactions that one drive may have, by fault and injected kind; further ones are counted as OTHER.
MOST_REACTIONS = 3

#: State S4, operation.
OPERATION = 4


class Reaction:
    """Histogram of the reactions to one fault."""

    def __init__(self) -> None:
        self.counts: Any = np.zeros(len(REACTION_EDGES_NS) + 1, np.int64)
        self.sum_ns = 0


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
    """Listens to what happens in a farm; ``reconnects`` are counts ``(drives, buckets)``.

    ``reactions`` are histograms by drive, code of the fault and injected kind.
    """

    def __init__(self, core: FarmCore) -> None:
        count = len(core.axes)
        self._reaction_edges = np.array(REACTION_EDGES_NS, np.int64)
        self._reconnect_edges = np.array(RECONNECT_EDGES_NS, np.int64)
        self._controllers = core.controllers
        self.reactions: dict[tuple[str, str, str], Reaction] = {}
        #: Reactions so far.
        self.reacted = 0
        self.reconnects: Any = np.zeros((count, len(RECONNECT_EDGES_NS) + 1), np.int64)
        self.reconnect_sums_ns: Any = np.zeros(count, np.int64)
        self._by_name = axes_by_name(core.axes)
        self._drives = [self._look(station) for station in core.axes]
        self._unsubscribe = core.log.subscribe(self._take)

    def close(self) -> None:
        """Stop listening."""
        self._unsubscribe()

    @staticmethod
    def _is_connected(station: Axis) -> bool:
        return station.device.connected

    def _look(self, station: Axis) -> _Drive:
        axis = station.handle.axis
        faulted = bool(axis.faults.code[:FAULT_SLOTS].any())
        return _Drive(connected=self._is_connected(station), faulted=faulted, state=int(axis.drive.state))

    # -- what happens ------------------------------------------------------------------------------------------------

    def _take(self, entry: LogEntry) -> None:
        for axis in self._by_name.get(entry.drive, ()):
            self._happened(axis, entry)

    def _happened(self, station: Axis, entry: LogEntry) -> None:
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
                self._reacted(station.configured_name, after_ns)
            case WatchdogExpired():
                # that of a connection which does not feed the drive takes nothing from it
                if drive.connected and int(station.handle.image.lost) == LOST_EXPIRED:
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

    def _ended(self, drive: _Drive, station: Axis) -> bool:
        """Whether the drive had a connection, and this was its last one."""
        if not drive.connected or self._is_connected(station):
            return False
        drive.connected = False
        return True

    # -- what follows ------------------------------------------------------------------------------------------------

    def _reacted(self, drive: str, after_ns: int) -> None:
        situation = self._controllers.of(drive).situation
        labels = (drive, situation.code, situation.kind) if situation is not None else (drive, OTHER, OTHER)
        if labels not in self.reactions and sum(key[0] == drive for key in self.reactions) >= MOST_REACTIONS:
            labels = (drive, OTHER, OTHER)
        reaction = self.reactions.setdefault(labels, Reaction())
        reaction.counts[int(np.searchsorted(self._reaction_edges, after_ns))] += 1
        reaction.sum_ns += after_ns
        self.reacted += 1

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
        self.reconnects[index, int(np.searchsorted(self._reconnect_edges, duration))] += 1
        self.reconnect_sums_ns[index] += duration
