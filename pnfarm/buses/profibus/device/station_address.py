"""Which station address a drive has: coding switches, address parameter, control unit (Moog MSD manual 4.2.2).

All three act with the next power on.  The control unit saves its address in the parameter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pnfarm.buses.profibus.config.drive import HIGHEST_ADDRESS

__all__ = ["DEFAULT_ADDRESS", "PARAMETER", "SWITCHES", "StationAddress", "station_address"]

#: The address of a slave that was given none (EN 50170 part 2, 8.3.8).
DEFAULT_ADDRESS: Final = 126
#: Where an address comes from.
SWITCHES: Final = "switches"
PARAMETER: Final = "parameter"


@dataclass(frozen=True, slots=True)
class StationAddress:
    """An address and where it comes from: :data:`SWITCHES` or :data:`PARAMETER`."""

    address: int
    origin: str


def station_address(switches: int, parameter: int) -> StationAddress:
    """``switches``: S2 and S1 as one number of 0 to 0xFF; above 125 the parameter counts, as on a drive without any."""
    if switches <= HIGHEST_ADDRESS:
        return StationAddress(switches, SWITCHES)
    return StationAddress(min(parameter, DEFAULT_ADDRESS), PARAMETER)
