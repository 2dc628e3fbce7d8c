"""Types of values that only EtherNet/IP's sections have."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import PlainValidator

from pnfarm.config.values import DURATION_SCHEMA
from pnfarm.vocabulary.durations import read_duration
from pnfarm.vocabulary.problem import Problem

__all__ = ["LONGEST_RPI_NS", "Rpi"]

_US = 1000
#: Longest requested packet interval here; the field has 32 bits of microseconds.
LONGEST_RPI_NS = 10_000_000_000
#: The engine's usual tick.
_SHORTEST_RPI_NS = 1_000_000


def read_rpi(value: Any) -> int:
    """A requested packet interval, ns; the wire has whole microseconds."""
    allowed = "1ms to 10s, in whole microseconds"
    rpi_ns = read_duration(value)
    if not _SHORTEST_RPI_NS <= rpi_ns <= LONGEST_RPI_NS or rpi_ns % _US:
        raise Problem(f"{value} is not a requested packet interval", allowed)
    return rpi_ns


Rpi = Annotated[int, PlainValidator(read_rpi), DURATION_SCHEMA]
