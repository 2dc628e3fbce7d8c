"""What `pnfarm import` reads: captures of one plant as one, projects each by itself, and all of them joined."""

from __future__ import annotations

from dataclasses import dataclass
from heapq import merge
from typing import TYPE_CHECKING

from pnfarm.buses import registry
from pnfarm.buses.imports import ImportingBus, drives_first
from pnfarm.buses.merging import Source, merged
from pnfarm.captures.reading import FrameReader
from pnfarm.cli.farm_file import counted
from pnfarm.cli.projects.file import description_folders, is_project_file, read_project
from pnfarm.errors import ConfigError
from pnfarm.terminal.working import working

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pnfarm.buses.imports import Found

__all__ = ["Inputs", "read_inputs"]

#: Frames between two checks of the progress.
_SHOWN_FRAMES = 5000


@dataclass(frozen=True, slots=True)
class Inputs:
    """``source`` names the files, ``captured``: captures are among them.

    ``remarks`` are sentences for the user, with the file or station that each is about.
    """

    found: list[Found]
    source: str
    captured: bool
    remarks: list[str]


def read_inputs(
    files: Sequence[Path], others: Sequence[Path], folders: Sequence[Path], base: Path, *, models: bool
) -> Inputs:
    """The stations of ``files``, joined with those of ``others``; ``base`` is the folder of the farm file to be.

    Of projects the first counts most, and captures count least, whichever is given first.  Raises :class:`ConfigError`
    where a file cannot be read, or nothing shows a device.
    """
    projects = [file for file in (*files, *others) if is_project_file(file)]
    captures = [file for file in (*files, *others) if file not in projects]
    if len(files) > 1 and any(file in projects for file in files):
        raise ConfigError(f"{projects[0]} is a project: give only this file, and further ones with --merge")
    if projects and not captures and not models:
        raise ConfigError("--devices is for captures: a project does not describe all of a station's data")
    remarks: list[str] = []
    sources = [(file.name, _of_project(file, folders, base, remarks)) for file in projects]
    if captures:
        sources.append((" and ".join(file.name for file in captures), _of_captures(captures, remarks, models=models)))
    found: list[Found] = []
    for bus in registry.BUSES:
        (name, stations), *rest = ((name, found_by_bus.get(bus, [])) for name, found_by_bus in sources)
        for other, more in rest:
            if stations and more:
                stations, differing = merged(Source(name, stations), Source(other, more))
                remarks += differing
            else:
                stations = [*stations, *more]
            name = f"{name} and {other}"
        found += stations
    if not found:
        needed = "a capture needs the start of a connection (Connect, Forward_Open, Set_Prm), or an answer to a search"
        shown = " and ".join(map(str, (*files, *others)))
        raise ConfigError(f"{shown} shows no device" + (f": {needed}" if captures else ""))
    source = " ".join([*(file.name for file in files), *(f"--merge {file.name}" for file in others)])
    return Inputs(list(drives_first(found)), source, bool(captures), remarks)


def _of_project(file: Path, folders: Sequence[Path], base: Path, remarks: list[str]) -> Mapping[str, list[Found]]:
    """What is in it by bus; description files that could not be read are remarks."""
    buses, project = read_project(file)
    at_hand = description_folders(file, folders)
    found = {bus.name: list(bus.of_project(project, at_hand, base)) for bus in buses}
    remarks += [f"{file}: {line}" for line in at_hand.remarks]
    return found


def _of_captures(files: Sequence[Path], remarks: list[str], *, models: bool) -> Mapping[str, list[Found]]:
    """What they show by bus; their frames are in the order of their times."""
    decoder = registry.decoder()
    importing_buses = {key: bus for key, bus in registry.BUSES.items() if isinstance(bus, ImportingBus)}
    for key, bus in importing_buses.items():
        bus.observe(decoder.buses[key])
    readers = [FrameReader(file, decoder.link_types) for file in files]
    with working(f"reading {', '.join(map(str, files))}") as show:
        for number, frame in enumerate(merge(*readers, key=lambda one: one.time_ns), 1):
            decoder.feed(frame)
            if number % _SHOWN_FRAMES == 0:
                show(f"{number:,} frames")
    for file, reader in zip(files, readers, strict=True):
        if reader.complaint is not None:
            remarks.append(f"{file}: the file cannot be read to its end: {reader.complaint}")
    if torn := decoder.capture.incomplete:
        remarks.append(f"{files[0]}: incomplete: {counted(torn, 'fragmented IP packet')}; their contents are missing")
    return {key: list(bus.found(decoder.buses[key], models=models)) for key, bus in importing_buses.items()}
