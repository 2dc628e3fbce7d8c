"""Injected faults in the farm's log."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.manager import FaultEnded, FaultStarted

if TYPE_CHECKING:
    from pnfarm.farm.event_log import EventLog
    from pnfarm.faults.manager import FaultEvent

__all__ = ["log_fault"]


def log_fault(log: EventLog, event: FaultEvent) -> None:
    """One line for a fault that started or ended on a drive."""
    match event:
        case FaultStarted(fault_id, kind, drive, now):
            log.record(now, drive, "fault injected", level="warning", id=fault_id, kind=kind)
        case FaultEnded(fault_id, kind, drive, now, reason, seen):
            log.record(
                now,
                drive,
                "injected fault ended",
                id=fault_id,
                kind=kind,
                reason=reason,
                checks=seen.checks,
                activations=seen.activations,
                confirmed=seen.confirmed,
            )
