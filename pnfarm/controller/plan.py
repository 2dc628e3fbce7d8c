"""From the farm file to the plan of its controller."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.choice import bus_of_controller

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.bus import Bus
    from pnfarm.buses.controller import ControllerPlan
    from pnfarm.config.drive import DriveConfig
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["plan_controller"]


def plan_controller(config: FarmConfig, drives: Sequence[DriveConfig]) -> tuple[Bus, ControllerPlan]:
    """The controller's bus, and the plan for its drives.  Raises :class:`ConfigError`."""
    section = config.controller
    if section is None:
        raise ConfigError("the file has no `controller:` section; `pnfarm schema farm` shows its keys")
    bus = bus_of_controller(section)
    pairs = [(drive, model) for drive in drives if (model := model_of(drive)).bus == bus.name]
    folder = config.path.parent if config.path is not None else None
    return bus, bus.plan(section, [drive for drive, _ in pairs], [model for _, model in pairs], folder)
