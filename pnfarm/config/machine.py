"""The machine of the farm file: limit switches, end stops and cams, and how they are written into an axis record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, Field

from pnfarm.config.axis import MOST_PLACE
from pnfarm.config.section import Section
from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import (
    CAMS,
    MACHINE_CAMS,
    MACHINE_STOP_HIGH,
    MACHINE_STOP_LOW,
    MACHINE_SWITCH_HIGH,
    MACHINE_SWITCH_LOW,
)
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from pnfarm.config.axis import Load

__all__ = ["Machine", "apply_machine"]


def _around_the_start(ends: list[float | None]) -> list[float | None]:
    low, high = ends
    if (low is not None and low >= 0.0) or (high is not None and high <= 0.0):
        raise Problem("leaves no room around 0, where the axis starts", "a place below 0 and one above it, or null")
    return ends


def _forwards(ends: list[float]) -> list[float]:
    if ends[0] >= ends[1]:
        raise Problem("ends before it begins", "the lower place first")
    return ends


#: A position of a part of the machine, revolutions or mm.
Place = Annotated[float, Field(ge=-MOST_PLACE, le=MOST_PLACE)]
Ends = Annotated[list[Place | None], Field(min_length=2, max_length=2), AfterValidator(_around_the_start)]


class Cam(Section):
    """A cam of the machine, and the digital input that its switch is wired to."""

    input: int = Field(ge=0, le=31, description="Digital input of the drive that it switches on, from 0.")
    between: Annotated[list[Place], Field(min_length=2, max_length=2), AfterValidator(_forwards)] = Field(
        description="Its first and its last position."
    )


class Machine(Section):
    """Switches, cams and end stops around the axis.

    Places are millimetres with `load.lead` or a linear motor, otherwise revolutions behind the gear;
    the axis starts at 0.
    """

    limit_switches: Ends | None = Field(
        default=None,
        description="Two positions: pressed at and below the first, and at and above the second; null for none.",
    )
    end_stops: Ends | None = Field(
        default=None, description="Two positions beyond which the axis cannot move; null for none."
    )
    cams: list[Cam] = Field(
        default_factory=list, max_length=CAMS, description="Up to 4 cams, such as that of a home switch."
    )


def apply_machine(axis: Any, machine: Machine, load: Load, pitch: float) -> None:
    """Write the machine into an axis record; ``pitch``: of a linear motor, mm, else 0."""
    unit = load.revolutions(pitch)
    for ends, fields, bits in (
        (
            machine.limit_switches,
            ("machine.switch_low", "machine.switch_high"),
            (MACHINE_SWITCH_LOW, MACHINE_SWITCH_HIGH),
        ),
        (machine.end_stops, ("machine.stop_low", "machine.stop_high"), (MACHINE_STOP_LOW, MACHINE_STOP_HIGH)),
    ):
        for place, field, bit in zip(ends or (), fields, bits, strict=False):
            if place is not None:
                AXIS.write(axis, field, place * unit)
                axis.machine.settings.parts |= bit
    for i, cam in enumerate(machine.cams):
        axis.machine.settings.parts |= MACHINE_CAMS
        axis.machine.settings.cam_inputs[i] = 1 << cam.input
        axis.machine.settings.cam_low[i], axis.machine.settings.cam_high[i] = (place * unit for place in cam.between)
