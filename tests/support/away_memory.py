"""A memory of drives that cannot be written for a while."""

from __future__ import annotations

from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.errors import EnvironmentError_

__all__ = ["Away"]


class Away(VolatileMemory):
    """As :class:`VolatileMemory`, and out of reach while ``away``; ``known``: it says so before it is asked."""

    def __init__(self) -> None:
        super().__init__()
        self.away = False
        self.known = True

    def save(self, station, values):
        if self.away:
            raise EnvironmentError_("the drives' memory is away")
        super().save(station, values)

    def hold(self, station, values):
        """What the drive reads is what it held."""
        super().save(station, values)

    @property
    def ready(self):
        return not (self.away and self.known)
