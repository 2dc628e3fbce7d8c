"""The built-in controller's program of each axis, for any bus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.table import program

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.config.controller import Program

__all__ = ["IDLE", "PHASES", "AxisProgram", "axis_program", "configure"]

#: Phases of an axis program by number.
PHASES = {
    program.OFFLINE: "offline",
    program.SWITCHING_ON: "switching on",
    program.RUNNING: "running",
    program.FAULTED: "faulted",
    program.ACKNOWLEDGING: "acknowledging",
    program.STOPPED: "stopped",
}

_KINDS = {
    "idle": program.IDLE,
    "constant": program.CONSTANT,
    "ramp": program.RAMP,
    "sine": program.SINE,
    "positions": program.POSITIONS,
}


@dataclass(frozen=True, slots=True)
class AxisProgram:
    """What one axis does; ``kind`` is a number of :mod:`pnfarm.table.program`."""

    kind: int
    enable: bool
    speed_rpm: float
    period_ns: int
    acknowledge_after_ns: int
    targets: tuple[float, ...] = ()
    acceleration: float = 0.0
    dwell_ns: int = 0


#: For a device whose outputs have an unknown meaning: they stay zero.
IDLE = AxisProgram(program.IDLE, enable=False, speed_rpm=0.0, period_ns=1_000_000_000, acknowledge_after_ns=-1)


def axis_program(section: Program) -> AxisProgram:
    """The farm file's program."""
    return AxisProgram(
        kind=_KINDS[section.kind] if section.python is None else program.PYTHON,
        enable=section.python is not None or (section.enable and section.kind != "idle"),
        speed_rpm=section.speed_rpm,
        period_ns=section.period_ns,
        acknowledge_after_ns=-1 if section.acknowledge_after_ns is None else section.acknowledge_after_ns,
        targets=tuple(section.targets),
        acceleration=section.acceleration,
        dwell_ns=section.dwell_ns,
    )


def configure(row: Any, wanted: AxisProgram, steps: Mapping[str, Any]) -> None:
    """Fill a row of the table with a program, and with what the drive's bus knows of the drive, by the row's fields."""
    for field in ("kind", "enable", "period_ns", "acknowledge_after_ns", "acceleration", "dwell_ns"):
        setattr(row, field, getattr(wanted, field))
    row.speed = wanted.speed_rpm
    row.target_count = len(wanted.targets)
    row.targets[: len(wanted.targets)] = wanted.targets
    for step, value in steps.items():
        setattr(row, step, value)
    row.active = 1
