"""parameter-busy: the drive still works on a parameter request."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.records import RECORDS
from pnfarm.faults.effects.effect import ChanceEffect, Held
from pnfarm.faults.kind import EACH, InjectionKind

__all__ = ["KIND"]


class ParameterBusy(ChanceEffect):
    """Each read of a response that is ready."""

    records = RECORDS

    def held(self) -> Held:
        return self.records.holds, self.occurs


KIND = InjectionKind(
    "parameter-busy",
    "records",
    "The drive still works on a parameter request: reading the response gets a state conflict (B5).",
    "a response that is held back",
    ParameterBusy,
    takes=EACH,
    place=20,
    wire="Reads of the parameter response are answered with the PNIO status of a state conflict (B5).",
    reports="The bus reports nothing: the program reads again until its job times out.",
)
