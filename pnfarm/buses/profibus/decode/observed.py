"""Which slaves were on a line and what their master wanted of them: what a capture says of a plant, for a farm file.

The decoder reports each fact as it finds it; of each slave the last one counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.captures.stations import Bounded

if TYPE_CHECKING:
    from pnfarm.protocols.profibus.wire.dp import Diagnosis, Parameters

__all__ = ["Observed", "SeenSlave"]

#: Station addresses of a line.
MOST_SLAVES = 127


@dataclass(slots=True)
class SeenSlave:
    """``parameters``: of the last Set_Prm that took it, by ``master``; ``identifiers``: of Chk_Cfg, else of Get_Cfg.

    How often either was another than before is counted.
    """

    address: int
    answers: int = 0
    diagnosis: Diagnosis | None = None
    master: int | None = None
    parameters: Parameters | None = None
    identifiers: bytes | None = None
    parametrisations: int = 0
    configurations: int = 0

    @property
    def ident(self) -> int | None:
        """Its own word counts more than its master's."""
        if self.diagnosis is not None:
            return self.diagnosis.ident
        return None if self.parameters is None else self.parameters.ident


class Observed:
    """See the module's docstring."""

    def __init__(self) -> None:
        self._slaves: Bounded[int, SeenSlave] = Bounded(MOST_SLAVES)

    @property
    def slaves(self) -> list[SeenSlave]:
        """Those that answered a master, by address."""
        return sorted((one for one in self._slaves.values() if one.answers), key=lambda one: one.address)

    def _slave(self, address: int) -> SeenSlave:
        return self._slaves.made(address, lambda: SeenSlave(address))

    def parametrised(self, address: int, master: int, parameters: Parameters) -> None:
        """Set_Prm with Lock_Req."""
        slave = self._slave(address)
        slave.parametrisations += (slave.master, slave.parameters) != (master, parameters)
        slave.master, slave.parameters = master, parameters

    def configured(self, address: int, identifiers: bytes) -> None:
        """Chk_Cfg."""
        slave = self._slave(address)
        slave.configurations += not slave.configurations or slave.identifiers != identifiers
        slave.identifiers = identifiers

    def answered(self, address: int) -> None:
        """A service of DP, whatever the answer."""
        self._slave(address).answers += 1

    def diagnosed(self, address: int, diagnosis: Diagnosis) -> None:
        """An answer to Slave_Diag."""
        self._slave(address).diagnosis = diagnosis

    def told(self, address: int, identifiers: bytes) -> None:
        """An answer to Get_Cfg."""
        slave = self._slave(address)
        if slave.identifiers is None:
            slave.identifiers = identifiers
