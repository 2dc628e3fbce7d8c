"""``pnfarm doctor FILE --project``: what the project of a PLC expects beside what a farm file has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from pnfarm.buses import registry
from pnfarm.buses.checking import compare
from pnfarm.cli.farm_file import known_names
from pnfarm.cli.file_stations import stations_of
from pnfarm.cli.projects.file import READ, is_project_file
from pnfarm.cli.projects.inputs import read_inputs
from pnfarm.errors import ConfigError
from pnfarm.farm.doctor.machine import Finding
from pnfarm.farm.file.found import write_farm
from pnfarm.farm.file.reading import parse_farm

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.buses.checking import CheckingBus, StationCheck
    from pnfarm.buses.imports import FoundDevice, FoundDrive, FoundStation
    from pnfarm.cli.file_stations import FileStation
    from pnfarm.farm.file.found import WrittenFarm
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["examine_project"]

#: Fields of a station that a controller compares when it connects, and what to change for each.
_REMEDIES = {
    "name": "name: {}",
    "address": "the project's address, {}",
    "identity": "the description file and the access point that the project has",
    "modules": "what the project has there, {}: `slots` or `connection` of a device, `telegram` or `axes` of a drive",
}


def examine_project(config: FarmConfig, project: Path, folders: Sequence[Path]) -> list[Finding]:
    """A finding for each station of the project, and for each of the file that the project lacks.

    Description files are searched in ``folders`` and below, and in the farm file's own folder.  Raises
    :class:`ConfigError`.
    """
    if not is_project_file(project):
        raise ConfigError(f"--project {project} is no engineering project; {READ}")
    beside = [] if config.path is None else [config.path.resolve().parent]
    expected, made, notes = _expected(project, [*folders, *beside])
    here = stations_of(config)
    findings = [Finding("project", None, note) for note in notes]
    stations: list[FoundDrive | FoundDevice] = [*made.drives, *made.devices]
    played = {one.name: one for one in stations}
    unknown = {one.name: one for one in made.others}
    for name, bus in registry.checking().items():
        wanted = [
            # without keying it compares no identity
            one.facts if played[one.facts.name].keyed else replace(one.facts, identity={})
            for one in expected
            if one.bus == name
        ]
        own = [one for one in here if one.bus == name]
        bare = {one.name for one in wanted if one.modules is None}
        for check in compare(wanted, [one.facts for one in own], by_name=bus.has_names):
            # one that the project has and nothing could be made of may be anything
            if check.state != "extra" or check.name not in unknown:
                line = _line(config, own, check)
                doubts = list(played[check.name].doubts if check.name in played else ())
                if check.name in bare:
                    doubts.append("its identity is the project's, its modules or its connection are not compared")
                findings.append(_finding(project, bus, check, line, doubts))
    return [*findings, *_unjudged(unknown, {one.facts.name for one in here})]


def _expected(project: Path, folders: Sequence[Path]) -> tuple[list[FileStation], WrittenFarm, list[str]]:
    """The project's stations as a farm file would have them, that farm file, and what was left out."""
    with TemporaryDirectory(prefix="pnfarm-doctor-") as scratch:
        folder = Path(scratch)
        read = read_inputs([project], [], folders, folder, models=True)
        made = write_farm(read.found, "project", "eth1", project.name, folder)
        for name, octets in made.files.items():
            (folder / name).write_bytes(octets)
        stations = []
        if made.drives or made.devices:
            config = parse_farm(made.text, folder / "project.pnfarm.yml", known_names())
            stations = stations_of(config, asked=True)
        return stations, made, [*read.remarks, *made.left_out]


def _line(config: FarmConfig, own: Sequence[FileStation], check: StationCheck) -> int:
    """Of the group in the farm file that a check is about; under another name it has the same address."""
    names = {check.name, *(one.found for one in check.differences if one.kind == "name")}
    for one in own:
        if one.facts.name in names:
            return config.place(one.at)[1]
    return next((config.place(one.at)[1] for one in own if check.address and one.facts.address == check.address), 0)


def _finding(project: Path, bus: CheckingBus, check: StationCheck, line: int, doubts: Sequence[str]) -> Finding:
    match check.state:
        case "missing":
            detail = "the project has it, and the farm does not have it"
            return Finding(check.name, False, detail, f"pnfarm import {project} prints its group", keeps_red=True)
        case "extra":
            return Finding(check.name, None, "no PLC of the project has it: no PLC connects to it", line=line)
        case _:
            pass
    # who is found by name gets its address from the controller
    keyed = [
        one for one in check.differences if one.kind != "versions" and (one.kind != "address" or not bus.has_names)
    ]
    if keyed:
        text = "; ".join(f"{one.what}: the project has {one.expected}, the file {one.found}" for one in keyed)
        remedy = "; ".join(dict.fromkeys(_REMEDIES[one.kind].format(one.expected) for one in keyed))
        return Finding(check.name, False, text, remedy, line, keeps_red=True)
    doubts = [*doubts, *check.remarks]
    if doubts:
        return Finding(check.name, None, f"not checked: {'; '.join(doubts)}", line=line)
    moved = [one for one in check.differences if one.kind == "address"]
    address = f"; the PLC gives it {moved[0].expected}" if moved else ""
    return Finding(check.name, True, f"will be green: what the PLC compares is as in the project{address}", line=line)


def _unjudged(unknown: dict[str, FoundStation], played: set[str]) -> Iterator[Finding]:
    for name, one in unknown.items():
        if one.missing or name in played:
            needed = f"{one.missing} is missing" if one.missing else one.facts[0] if one.facts else "it has no type"
            remedy = "--gsdml FOLDER with that file" if one.missing else ""
            yield Finding(name, None, f"not checked: {needed}", remedy)
