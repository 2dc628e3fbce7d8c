"""From the farm file to the plans of its controllers: one for each bus that has drives in it and a controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.choice import bus_of_controller
from pnfarm.farm.file.reading import controller_mac

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.bus import Bus
    from pnfarm.buses.controller import ControllerPlan
    from pnfarm.config.controller import ControllerSection
    from pnfarm.config.device import DeviceConfig
    from pnfarm.config.drive import DriveConfig
    from pnfarm.drives.description.model import Model
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["PlannedController", "plan_controllers"]


@dataclass(frozen=True, slots=True)
class PlannedController:
    """One controller of a file: a station of its own on the link.  ``mac``: None for that of an interface.

    ``members``: its drives with their models, in the file's order; ``plan.devices`` begins with them.
    """

    section: ControllerSection
    bus: Bus
    plan: ControllerPlan
    mac: bytes | None
    members: Sequence[tuple[DriveConfig, Model]]


def plan_controllers(
    config: FarmConfig, drives: Sequence[DriveConfig], devices: Sequence[DeviceConfig] = ()
) -> list[PlannedController]:
    """The controllers in the order of their first drives, at least one.  Raises :class:`ConfigError`."""
    if not config.controllers:
        raise ConfigError("the file has no `controller:` section; `pnfarm schema farm` shows its keys")
    folder = config.path.parent if config.path is not None else None
    models = [(drive, model_of(drive)) for drive in drives]
    found: list[PlannedController] = []
    for section in config.controllers:
        bus = bus_of_controller(section)
        members = [(drive, model) for drive, model in models if model.bus == bus.name]
        own = [device for device in devices if device.bus == bus.name]
        plan = bus.plan(section, [drive for drive, _ in members], [model for _, model in members], folder, own)
        found.append(PlannedController(section, bus, plan, controller_mac(config, section), members))
    return found
