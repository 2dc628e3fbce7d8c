"""The engine's events, read out of their ring, for the stations, the log and those that wait for one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.farm.events import EngineEventsLost
from pnfarm.station.events import (
    AcknowledgeRefused,
    ControlBitChanged,
    FaultRaised,
    FaultReacted,
    FaultsCleared,
    StateChanged,
    WarningChanged,
)
from pnfarm.table import engine_row
from pnfarm.table.access.record_fields import field_views

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.engine.columns import Columns
    from pnfarm.faults.manager import InjectionManager
    from pnfarm.plant.plant import Plant
    from pnfarm.station.axis import Axis
    from pnfarm.station.event_log import EventLog
    from pnfarm.station.station import Station
    from pnfarm.trace import TraceManager

__all__ = ["EngineEvents"]

#: Events whose row is a consumer's.
_OF_CONSUMERS = frozenset(
    {engine_row.FIRST_FRAME, engine_row.EXPIRED, engine_row.PROVIDER_CHANGED, engine_row.IOPS_CHANGED}
)


class EngineEvents:
    """``stations`` by the rows of their process images, ``axes`` by theirs."""

    def __init__(
        self,
        columns: Columns,
        stations: Mapping[int, Station],
        axes: Sequence[Axis],
        log: EventLog,
        injections: InjectionManager,
        traces: TraceManager,
        plant: Plant | None,
    ) -> None:
        self._columns = columns
        self._stations = stations
        self._axes = axes
        self._log = log
        self._injections = injections
        self._traces = traces
        self._plant = plant
        self._tail = 0
        (self._head,) = field_views(columns.engine[0], "event_head")
        #: Events that were overwritten before they were read.
        self.lost = 0

    def drain(self, now: int) -> list[Station]:
        """Pass on what happened; the stations that it concerned, each once, and all of them after a loss."""
        head = self._head[0]
        size = self._columns.events.shape[0]
        touched: dict[int, Station] = {}
        lost = max(0, head - self._tail - size)
        if lost:
            self.lost += lost
            self._log.record(now, "", EngineEventsLost(lost))
            self._tail = head - size
            touched |= self._catch_up(now)
        while self._tail < head:
            # as a tuple, in the order of the layout: each attribute would take a microsecond
            kind, row, when, value = self._columns.events[self._tail % size].item()
            self._tail += 1
            station = self._take(kind, row, when, value, now)
            if station is not None:
                touched[station.index] = station
        if lost:
            # after the reports that are left: these have faults, too
            for axis in self._axes:
                for number in axis.catch_up(now):
                    self._log.record(now, axis.configured_name, FaultRaised(number))
        return list(touched.values())

    def _catch_up(self, now: int) -> dict[int, Station]:
        """The ring overflowed: derive the events of connections, traces and conditions from the rows themselves."""
        self._traces.catch_up(now)
        self._injections.catch_up(now)
        stations = {station.index: station for station in self._stations.values()}
        for station in stations.values():
            station.device.catch_up(now)
        if self._plant is not None:
            # its report may be among those lost, and the engine makes no other before this one is carried out
            self._plant.changed()
        return stations

    def _take(self, kind: int, row: int, when: int, value: int, now: int) -> Station | None:
        """Pass one on; the station that it concerns."""
        if kind in _OF_CONSUMERS:
            station = self._stations[int(self._columns.cpm[row]["image"])]
            return station if station.device.channel_event(kind, row, when, value, now) else None
        match kind:
            case engine_row.TRACE_TRIGGERED:
                self._traces.triggered(row, when)
            case engine_row.TRACE_ENDED:
                self._traces.ended(row, when)
            case engine_row.CONDITION_HELD:
                self._injections.condition_held(row, value, when)
            case engine_row.PLANT_CHANGED if self._plant is not None:
                self._plant.changed()
            case _:
                return self._take_of_axis(kind, row, when, value, now)
        return None

    def _take_of_axis(self, kind: int, row: int, when: int, value: int, now: int) -> Station | None:
        axis = self._axes[row]
        name = axis.configured_name
        match kind:
            case engine_row.STATE_CHANGED:
                self._log.record(when, name, StateChanged(value >> 8, value & 0xFF))
            case engine_row.FAULT_RAISED:
                axis.fault_raised(value, when)
                self._log.record(when, name, FaultRaised(value))
            case engine_row.FAULTS_CLEARED:
                axis.faults_cleared(when)
                self._log.record(when, name, FaultsCleared(value))
            case engine_row.FAULT_REACTED:
                self._log.record(when, name, FaultReacted(value))
            case engine_row.CONTROL_BIT_CHANGED:
                after = value & ((1 << 55) - 1)
                self._log.record(when, name, ControlBitChanged(value >> 56, value >> 55 & 1, after))
            case engine_row.WARNING_CHANGED:
                self._log.record(when, name, WarningChanged(value))
            case engine_row.ACKNOWLEDGE_REFUSED:
                axis.refused_ns = when
                self._log.record(when, name, AcknowledgeRefused(value))
            case engine_row.PARAMETER_TASK:
                axis.device.parameter_task(axis.number, value, now)
            case _:
                return None
        return self._stations[row]
