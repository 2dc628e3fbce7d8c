"""Injected faults in the farm's log."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.farm.events import InjectionBegan, InjectionEnded
from pnfarm.faults.manager import FaultEnded, FaultStarted

if TYPE_CHECKING:
    from pnfarm.faults.manager import FaultEvent
    from pnfarm.station.event_log import EventLog

__all__ = ["log_fault"]


def log_fault(log: EventLog, event: FaultEvent) -> None:
    """One line for a fault that started or ended on a drive."""
    match event:
        case FaultStarted(fault_id, kind, drive, now):
            log.record(now, drive, InjectionBegan(fault_id, kind))
        case FaultEnded(fault_id, kind, drive, now, reason, seen):
            counts = seen.checks, seen.activations, seen.confirmed
            log.record(now, drive, InjectionEnded(fault_id, kind, reason, *counts))
