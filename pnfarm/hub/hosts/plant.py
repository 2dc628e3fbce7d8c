"""The plants of all farms at the hub: a farm with one has no shards, so that each plant is whole."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pnfarm.hub.hub import Hub

__all__ = ["HubPlant"]

_KEYS = ("step_seconds", "steps", "steps_left_out", "models", "wires")


class HubPlant:
    """As :class:`~pnfarm.api.paths.plant.PlantHost`."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    async def plant(self) -> dict[str, Any]:
        answers = await self._hub.ask_all("GET", "plant", *_KEYS)
        plants = {shard.label: answer for shard, answer in answers.good.items() if answer["models"] or answer["wires"]}
        steps = [answer["step_seconds"] for answer in plants.values()]
        return {
            "step_seconds": min(steps, default=None),
            "steps": sum(answer["steps"] for answer in plants.values()),
            "steps_left_out": sum(answer["steps_left_out"] for answer in plants.values()),
            "models": [{**model, "shard": label} for label, answer in plants.items() for model in answer["models"]],
            "wires": [{**wire, "shard": label} for label, answer in plants.items() for wire in answer["wires"]],
            **self._hub.partial(answers),
        }
