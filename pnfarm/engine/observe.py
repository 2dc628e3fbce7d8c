"""What the engine observes of a drive after each of its steps (:mod:`pnfarm.table.observed`)."""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.engine_row import CONTROL_BIT_CHANGED, emit
from pnfarm.table.observed import PEAK_WINDOW_NS
from pnfarm.table.signals import STW1

__all__ = ["fault_began", "fault_ended", "observe"]


@inlined
def _open_window(row: Any, velocity: float, setpoint: float, now: int) -> None:
    """A window of the extremes begins; the first one is its own predecessor."""
    first = row.window_ns == 0
    row.last_velocity_min = velocity if first else row.velocity_min
    row.last_velocity_max = velocity if first else row.velocity_max
    row.last_setpoint_min = setpoint if first else row.setpoint_min
    row.last_setpoint_max = setpoint if first else row.setpoint_max
    row.velocity_min = velocity
    row.velocity_max = velocity
    row.setpoint_min = setpoint
    row.setpoint_max = setpoint
    row.window_ns = now


@inlined
def _control_word(engine: Any, events: Any, row: Any, word: int, number: int, now: int) -> None:
    """The controller sent another control word: report each bit that changes for the first time since the fault."""
    fresh = (word ^ int(row.stw1)) & ~int(row.changed) & 0xFFFF
    row.stw1 = word
    if row.fault_ns == 0:
        return
    row.changed |= fresh
    since = now - row.fault_ns
    for bit in range(16):
        if (fresh >> bit) & 1:
            emit(engine, events, CONTROL_BIT_CHANGED, number, now, (bit << 56) | (((word >> bit) & 1) << 55) | since)


@inlined
def observe(engine: Any, events: Any, row: Any, axis: Any, image: Any, number: int, now: int) -> None:
    """One drive was stepped."""
    velocity = axis.motor.velocity
    setpoint = axis.ramp.setpoint
    if now - row.window_ns >= PEAK_WINDOW_NS:
        _open_window(row, velocity, setpoint, now)
    elif velocity < row.velocity_min:
        row.velocity_min = velocity
    elif velocity > row.velocity_max:
        row.velocity_max = velocity
    if setpoint < row.setpoint_min:
        row.setpoint_min = setpoint
    elif setpoint > row.setpoint_max:
        row.setpoint_max = setpoint
    if image.valid:
        word = int(image.received[STW1]) & 0xFFFF
        if word != row.stw1:
            _control_word(engine, events, row, word, number, now)


@inlined
def fault_began(row: Any, now: int) -> None:
    """A fault was raised; the first one of a situation begins the measurement of the reaction."""
    if row.fault_ns == 0:
        row.fault_ns = now
        row.changed = 0


@inlined
def fault_ended(row: Any) -> None:
    """All faults were acknowledged."""
    row.fault_ns = 0
