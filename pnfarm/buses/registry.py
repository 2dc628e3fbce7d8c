"""The buses that there are: the only list of them; and what they bring together."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.bus import PROFINET
from pnfarm.errors import ConfigError
from pnfarm.faults.catalogue import Catalogue, neutral

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.bus import Bus

__all__ = ["BUSES", "bus", "fault_kinds"]

#: By name.
BUSES: Mapping[str, Bus] = {PROFINET.name: PROFINET}


def bus(name: str) -> Bus:
    """Raises :class:`ConfigError` for a bus that there is none of."""
    found = BUSES.get(name)
    if found is None:
        raise ConfigError(f"there is no bus {name!r}; there are {', '.join(BUSES)}")
    return found


@cache
def fault_kinds() -> Catalogue:
    """Every kind that can be injected into a drive: those for any drive, and those of each bus."""
    return Catalogue([*neutral(), *(kind for one in BUSES.values() for kind in one.fault_kinds())])
