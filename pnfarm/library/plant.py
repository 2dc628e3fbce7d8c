"""The plant of a farm in this process: ``plant.gripper.extended``, ``plant.button.press = True``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.vocabulary.quoting import did_you_mean, shortened, shown

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.farm.core import FarmCore
    from pnfarm.plant.part import PlantPart
    from pnfarm.wire.value_types import Value

__all__ = ["PlantModelReadings", "PlantReadings"]


class PlantModelReadings:
    """A model: its ports are attributes, those without a wire may be set, else :class:`ConfigError`."""

    __slots__ = ("_part",)
    _part: PlantPart

    def __init__(self, part: PlantPart) -> None:
        object.__setattr__(self, "_part", part)

    def __getattr__(self, name: str) -> Value:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._part.signals.get(name)
        except ConfigError as exc:
            raise AttributeError(str(exc)) from exc

    def __setattr__(self, name: str, value: Value) -> None:
        self._part.signals.set({name: value})

    def __dir__(self) -> list[str]:
        return [*self._part.signals.names]

    def set(self, values: Mapping[str, Value]) -> None:
        """Write several inputs, all or none."""
        self._part.signals.set(values)


class PlantReadings:
    """The models by their names, as attributes, or with ``plant["my-model"]``, which raises :class:`ConfigError`."""

    __slots__ = ("_parts",)

    def __init__(self, core: FarmCore) -> None:
        if core.plant is None:
            raise ConfigError(f"farm {core.name} has no plant; add `plant:` to its file")
        self._parts = core.plant.parts

    def __getitem__(self, name: str) -> PlantModelReadings:
        if name not in self._parts:
            hint = did_you_mean(name, self._parts)
            known = shortened(list(self._parts)) or "none"
            raise ConfigError(f"the plant has no model {shown(name)}{hint}; it has {known}")
        return PlantModelReadings(self._parts[name])

    def __getattr__(self, name: str) -> PlantModelReadings:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self[name]
        except ConfigError as exc:
            raise AttributeError(str(exc)) from exc

    def __iter__(self) -> Iterator[str]:
        return iter(self._parts)

    def __dir__(self) -> list[str]:
        return [*self._parts]
