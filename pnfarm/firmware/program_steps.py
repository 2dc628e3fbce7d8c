"""What axis programs of the built-in controller share, whatever words they speak."""

from __future__ import annotations

from math import pi, sin
from typing import Any

from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.program import CONSTANT, RAMP, RUNNING, SINE

__all__ = ["begin_leg", "enter", "runs", "speed_of"]


@inlined
def enter(program: Any, phase: int, now: int) -> None:
    """Be in this phase, from now on if it is another one."""
    if program.phase != phase:
        program.phase = phase
        program.phase_ns = now


@inlined
def speed_of(program: Any, now: int) -> float:
    """The set point of a running axis, rpm."""
    if program.kind == CONSTANT:
        return program.speed
    if program.kind in (RAMP, SINE):
        if program.period_ns <= 0:
            return 0.0
        share = ((now - program.run_ns) % program.period_ns) / program.period_ns
        if program.kind == SINE:
            return program.speed * sin(2.0 * pi * share)
        if share < 0.25:
            return program.speed * 4.0 * share
        if share < 0.75:
            return program.speed * (2.0 - 4.0 * share)
        return program.speed * (4.0 * share - 4.0)
    return 0.0


@inlined
def begin_leg(program: Any, leg: int, now: int) -> None:
    """A program of positions goes on."""
    program.leg = leg
    program.leg_ns = now


@inlined
def runs(program: Any, now: int) -> None:
    """The axis came into operation."""
    program.run_ns = now
    if program.fault_ns != 0:
        program.recovery_ns = now - program.fault_ns
        program.fault_ns = 0
    enter(program, RUNNING, now)
