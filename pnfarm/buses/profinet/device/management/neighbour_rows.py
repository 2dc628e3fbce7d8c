"""The data of a station's LLDP agent as rows of LLDP-MIB."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.snmp.view import NeighbourView

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence

    from pnfarm.protocols.profinet.lldp.agent import Neighbour

__all__ = ["NeighbourRows"]


class NeighbourRows:
    """Rows of lldpRemTable: a neighbour keeps its index as long as it is present."""

    def __init__(self) -> None:
        self._numbers: dict[Hashable, int] = {}
        self._last = 0

    def views(self, neighbours: Sequence[Neighbour], port: int, booted_ns: int) -> list[NeighbourView]:
        """The neighbours of ``port``; times count from ``booted_ns``."""
        known = {(n.chassis, n.port_id): n for n in neighbours}
        self._numbers = {key: number for key, number in self._numbers.items() if key in known}
        for key in known:
            if key not in self._numbers:
                self._last += 1
                self._numbers[key] = self._last
        return [
            NeighbourView(max(0, n.changed_ns - booted_ns), port, self._numbers[key], n) for key, n in known.items()
        ]
