"""Types of values that only PROFINET's sections have."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import PlainValidator

from pnfarm.buses.profinet.config.clock import nearest_cycles
from pnfarm.config.slots import named_module
from pnfarm.config.values import DURATION_SCHEMA
from pnfarm.vocabulary.durations import format_duration, read_duration
from pnfarm.vocabulary.problem import Problem

__all__ = ["WANTED", "Cycle", "Wanted"]

WANTED = "ID, order number, ident or name"


def read_cycle(value: Any) -> int:
    cycle_ns = read_duration(value)
    nearest = nearest_cycles(cycle_ns)
    if nearest != (cycle_ns,):
        cycles = " or ".join(map(format_duration, nearest))
        raise Problem(
            f"{value} is not a PROFINET cycle; the nearest is {cycles}", "31.25us times a power of two, to 512ms"
        )
    return cycle_ns


#: What a user calls a part of a maker's file.
Wanted = Annotated[str | int, *named_module(WANTED)]
Cycle = Annotated[int, PlainValidator(read_cycle), DURATION_SCHEMA]
