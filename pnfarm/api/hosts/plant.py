"""The plant of one farm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.farm.views.plant import plant_snapshot

if TYPE_CHECKING:
    from pnfarm.api.context import ApiContext

__all__ = ["FarmPlant"]


class FarmPlant:
    """As :class:`~pnfarm.api.paths.plant.PlantHost`."""

    def __init__(self, context: ApiContext) -> None:
        self._context = context

    async def plant(self) -> dict[str, Any]:
        return plant_snapshot(self._context.core)
