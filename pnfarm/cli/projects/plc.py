"""The farm file that ``plc --project`` makes of an engineering project: the built-in controllers and their devices.

What the project's PLC expects is read from the project again, not taken from the farm that ``import`` makes: each
station by its maker's file, with the modules of the project, and none as a drive of a model.
"""

from __future__ import annotations

import json
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from pnfarm.config.links import USUAL_BAUD
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.buses.imports import FoundController
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["ProjectPlc", "project_plc"]


@dataclass(frozen=True, slots=True)
class ProjectPlc:
    """``config`` has controllers alone; ``remarks``: the stations that they do not run, and what is not sure."""

    config: FarmConfig
    remarks: list[str]


@contextmanager
def project_plc(
    file: Path,
    folders: Sequence[Path] = (),
    *,
    plc: str | None = None,
    interface: str | None = None,
    line: str | None = None,
    baud: int | None = None,
    ip: str | None = None,
    cycle: str | None = None,
    watchdog_factor: int | None = None,
) -> Iterator[ProjectPlc]:
    """The controllers of a project's PLC; the description files that it names are there in the block.

    ``plc`` names one of several.  With ``line`` alone nothing on a network is run, without it nothing on a line.
    Raises :class:`ConfigError`, also if there is no station to run.
    """
    from pnfarm.buses.bus import line_of
    from pnfarm.cli.projects.file import description_folders, read_project
    from pnfarm.cli.serial_line import line_way
    from pnfarm.farm.file.reading import parse_farm

    buses, project = read_project(file)
    at_hand = description_folders(file, folders)
    general = {"cycle": cycle, "watchdog_factor": watchdog_factor}
    controllers: dict[str, Any] = {}
    remarks: list[str] = []
    with TemporaryDirectory(prefix="pnfarm-plc-") as scratch:
        for bus in buses:
            found = bus.controller_of_project(project, at_hand, Path(scratch), plc)
            on_line = bool(line_of(bus))
            keys = _section(found, Path(scratch), remarks)
            for device in keys.get("devices", ()):
                for key in _given(general):
                    device.pop(key, None)
            if not keys:
                continue
            if (line is None) if on_line else (interface is None and line is not None):
                count = len(keys["devices"])
                remarks.append(f"{count} on {bus.title} not run: give {'--line' if on_line else '--interface'}")
                continue
            if on_line and line is not None:
                keys["link"] = {"kind": "serial", **line_way(line, baud or USUAL_BAUD).model_dump(exclude_unset=True)}
            elif not on_line:
                keys |= _given({"interface": interface, "ip": ip})
            controllers[bus.name] = keys
        if not controllers:
            raise ConfigError(f"{file} has no station to run: {'; '.join(remarks[:3]) or 'it names none'}")
        text = json.dumps({"controller": _given(general) | controllers})
        yield ProjectPlc(parse_farm(text, Path(scratch) / file.name), [*remarks, *at_hand.remarks])


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _section(found: FoundController, folder: Path, remarks: list[str]) -> dict[str, Any]:
    """The keys of a bus's controller, with its description files in the folder; none where it has no devices."""
    from pnfarm.buses.imports import FoundDevice
    from pnfarm.farm.file.found import files_of, is_station_name, named, with_files

    stations = found.stations
    remarks += [f"{one.name} is not run: {one.facts[0]}" for one in stations if not isinstance(one, FoundDevice)]
    devices = with_files(named([one for one in stations if isinstance(one, FoundDevice)]))
    remarks += [f"{one.name}: {note}" for one in devices for note in one.notes]
    for name, octets in files_of(devices).items():
        (folder / name).write_bytes(octets)
    keys = {key: value for key, value in found.keys.items() if key != "name" or is_station_name(value)}
    listed = [
        {"name": one.name, one.file.key: one.file.name, **one.keys} for one in devices if isinstance(one, FoundDevice)
    ]
    return {**keys, "devices": listed} if listed else {}
