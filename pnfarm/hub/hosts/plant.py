"""The plants of all farms at the hub: a farm with one has no shards, so that each plant is whole."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["HubPlant"]

_COUNTS = ("steps", "steps_left_out")
_LISTS = ("models", "wires")


class HubPlant:
    """As :class:`~pnfarm.api.paths.plant.PlantHost`."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    async def plant(self) -> dict[str, Any]:
        answers = await self._hub.ask_all("GET", "plant", _of_shard)
        plants = [plant for plant in answers.good.values() if plant is not None]
        return {
            "step_seconds": min((plant["step_seconds"] for plant in plants), default=None),
            **{key: sum(plant[key] for plant in plants) for key in _COUNTS},
            **{key: [one for plant in plants for one in plant[key]] for key in _LISTS},
            **self._hub.partial(answers),
        }


def _of_shard(shard: Shard, answer: Mapping[str, Any]) -> dict[str, Any] | None:
    """Its plant, None without one."""
    lists = {key: [{**one, "shard": shard.label} for one in answer[key]] for key in _LISTS}
    if not any(lists.values()):
        return None
    return {"step_seconds": float(answer["step_seconds"]), **{key: int(answer[key]) for key in _COUNTS}, **lists}
