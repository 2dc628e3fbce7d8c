"""What the drives of a farm file cost the engine, as far as the file shows: cycles, frames, steps, serial lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.buses.bus import line_of
from pnfarm.buses.registry import BUSES
from pnfarm.config.device import DeviceConfig
from pnfarm.farm.file.choice import bus_of_controller
from pnfarm.farm.file.reading import expand_all
from pnfarm.station.step_time import longest_step_ns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.config.drive import DriveConfig
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["Load", "costs_of", "line_name", "load_of"]

#: Cycle of drives whose file says none: the controller's, by its default.
_USUAL_CYCLE_NS = 16_000_000

# Weights of costs, ns of processor time as `pnfarm bench` usually shows them.  They decide which shard has which drive,
# so they are the same on every machine and in every version.
_FRAME_NS = 1_800
_STEP_NS = 600
#: A second of a drive's protocol machines: timers, neighbours, what is asked of it.
_DRIVE_NS = 100_000
#: A second of a serial line whose master asks as fast as it can, however many drives it has.
_LINE_NS = 100_000_000


@dataclass(frozen=True, slots=True)
class Load:
    """What the engine does a second: cyclic frames in both directions, steps of the drives' firmware.

    ``shortest_ns``: the shortest cycle, and ``shortest`` the station that has it.
    """

    drives: int
    frames: float
    steps: float
    shortest_ns: int = 0
    shortest: DriveConfig | DeviceConfig | None = None


def _cycle_of(one: object) -> int | None:
    """The cycle of a drive or a controller, by its bus's name for it."""
    return getattr(one, "cycle_ns", None) or getattr(one, "rpi_ns", None)


def _bus_of(config: FarmConfig, drive: DriveConfig | DeviceConfig) -> str:
    if isinstance(drive, DeviceConfig):
        return drive.bus
    model = config.known.model(drive.model)
    return "" if model is None or model.bus not in BUSES else model.bus


def line_name(config: FarmConfig, drive: DriveConfig | DeviceConfig) -> str:
    """The serial line that a drive shares with others, empty for one without."""
    bus = _bus_of(config, drive)
    return line_of(BUSES[bus]) if bus else ""


def _cycles(config: FarmConfig, drives: Sequence[DriveConfig | DeviceConfig]) -> list[int]:
    """The cycle of each drive, ns; 0 for one without cyclic frames."""
    shared = {bus_of_controller(one).name: _cycle_of(one) for one in config.controllers}
    found = []
    for drive in drives:
        bus = _bus_of(config, drive)
        # a line has no cyclic frames
        cyclic = bus and not line_of(BUSES[bus])
        found.append((_cycle_of(drive) or shared.get(bus) or _USUAL_CYCLE_NS) if cyclic else 0)
    return found


def load_of(config: FarmConfig, drives: Sequence[DriveConfig | DeviceConfig] | None = None) -> Load:
    """The load of a farm file's drives and devices, or of some of them, at the cycles that the file names."""
    whole = expand_all(config) if drives is None else drives
    cyclic = [(one, cycle) for one, cycle in zip(whole, _cycles(config, whole), strict=True) if cycle]
    frames = sum(2e9 / cycle for _, cycle in cyclic)
    shortest, shortest_ns = min(cyclic, key=lambda each: each[1], default=(None, 0))
    return Load(len(cyclic), frames, sum(_steps(one, cycle) for one, cycle in cyclic), shortest_ns, shortest)


def _steps(one: DriveConfig | DeviceConfig, cycle_ns: int) -> float:
    """Firmware steps a second: a device has none."""
    return 0.0 if isinstance(one, DeviceConfig) else 1e9 / longest_step_ns(cycle_ns)


def costs_of(config: FarmConfig, drives: Sequence[DriveConfig | DeviceConfig]) -> list[int]:
    """What each drive costs, ns of processor time a second; a line is paid for by its first drive."""
    costs, paid = [], set()
    for drive, cycle in zip(drives, _cycles(config, drives), strict=True):
        cost = _DRIVE_NS
        if cycle:
            cost += _FRAME_NS * 2_000_000_000 // cycle
            if not isinstance(drive, DeviceConfig):
                cost += _STEP_NS * 1_000_000_000 // longest_step_ns(cycle)
        line = line_name(config, drive)
        if line and line not in paid:
            paid.add(line)
            cost += _LINE_NS
        costs.append(cost)
    return costs
