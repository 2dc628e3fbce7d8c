"""The plant of a farm file for its stations."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.config.device import DeviceConfig
from pnfarm.config.drive import DriveConfig
from pnfarm.farm.file.reading import expand_all
from pnfarm.plant.axis_ports import PlantAxis
from pnfarm.plant.part import port_signals
from pnfarm.plant.plan import plan_plant
from pnfarm.vocabulary.issues import FarmFileError, FileIssue, field_path

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.plant.plan import PlantPlan
    from pnfarm.signals.device_signal import KnownDevices
    from pnfarm.vocabulary.issues import Location

__all__ = ["known_signals", "plant_of"]


def plant_of(
    config: FarmConfig, stations: Sequence[DriveConfig | DeviceConfig], model_of: Callable[[DriveConfig], Model]
) -> PlantPlan | None:
    """The plan of the file's plant, None without; files of models in Python are run.  Raises :class:`FarmFileError`."""
    if config.plant is None:
        return None
    issues: list[FileIssue] = []

    def report(location: Location, what: str, allowed: str) -> None:
        issues.append(FileIssue(*config.place(location), field_path(location), what, allowed))

    axes = {
        axis.name: PlantAxis.of(model_of(one), axis.load)
        for one in stations
        if isinstance(one, DriveConfig)
        for axis in one.axes
    }
    devices = {one.name: one.known_signals for one in stations if isinstance(one, DeviceConfig)}
    folder = config.path.parent if config.path is not None else Path()
    plan = plan_plant(config.plant, axes, devices, folder, report)
    if issues:
        raise FarmFileError(issues)
    return plan


def known_signals(
    config: FarmConfig, model_of: Callable[[DriveConfig], Model]
) -> tuple[KnownDevices, dict[str, tuple[str, ...]]]:
    """The signals of the file's devices and of its plant's models, by their names, and what kinds these are."""
    stations = expand_all(config)
    devices = [one for one in stations if isinstance(one, DeviceConfig)]
    plan = plant_of(config, stations, model_of)
    models = {} if plan is None else plan.models
    return (
        {
            **{one.name: one.known_signals for one in devices},
            **{name: port_signals(model) for name, model in models.items()},
        },
        {**{one.name: one.kinds for one in devices}, **{name: model.kinds for name, model in models.items()}},
    )
