"""``pnfarm import``: a farm file out of what is there already, a capture of the plant or its engineering project."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.cli.farm_file import counted
from pnfarm.errors import ConfigError
from pnfarm.terminal.output import print_line
from pnfarm.terminal.working import working

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.imports import Found
    from pnfarm.farm.file.found import WrittenFarm

__all__ = ["importing"]

#: Octets in which the root of an XML file begins.
_HEAD = 4096
#: Frames between two looks at how far the reading is.
SHOWN_FRAMES = 5000
DEFAULT_PARENT = "eth1"


def importing(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="Capture (pcap, pcapng), CAx data (aml, amlx), or L5X.", show_default=False
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FARM", help="Farm file to write; default: print it.", show_default=False
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(
            "--name",
            metavar="NAME",
            help="The farm's name; default: the last import's, or the file's.",
            show_default=False,
        ),
    ] = None,
    parent: Annotated[
        str | None,
        typer.Option(
            "--parent",
            metavar="IF",
            help=f"Network interface of the farm's macvlan link; default: the last import's, or {DEFAULT_PARENT}.",
            show_default=False,
        ),
    ] = None,
    folders: Annotated[
        list[Path] | None,
        typer.Option(
            "--gsdml",
            "--gsd",
            "--eds",
            metavar="DIR",
            help="Folder with the GSDML, GSD and EDS files of a project's devices (below it, and in zip files, too), "
            "beside the project's own.  Repeatable.",
            show_default=False,
        ),
    ] = None,
    devices: Annotated[
        bool,
        typer.Option(
            "--devices", help="Take no drive model: a capture's drives become devices, too, if their bus has such."
        ),
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace FARM, and description files beside it, if they are there.")
    ] = False,
    update: Annotated[
        bool,
        typer.Option("--update", help="If FARM is there, change in it what the project changed; your changes stay."),
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show what --update would change, or a first import add; write nothing.")
    ] = False,
) -> None:
    """Make a farm file from a capture, with GSDML files for its PROFINET devices, or from a TIA project's CAx data."""
    from pnfarm.farm.file.found import farm_name, write_farm
    from pnfarm.farm.file.imported import read_record

    _check_options(output, force=force, update=update, dry_run=dry_run)
    folder = Path.cwd() if output is None else output.resolve().parent
    if _is_project(file):
        if devices:
            raise ConfigError("--devices is for captures: a project says too little of a station's data")
        # names of files in a farm file are relative to its folder
        found, remarks = _of_project(file, folders or [], folder)
    else:
        found, remarks = _of_capture(file, models=not devices), []
    if not found:
        needed = "a capture needs the start of a connection (Connect, Forward_Open, Set_Prm), or an answer to a search"
        raise ConfigError(f"{file} shows no device" + ("" if _is_project(file) else f": {needed}"))
    if output is None:
        found = _listed(found)
    last = read_record(output.resolve()) if output is not None and not force else None
    name = name or (last.name if last is not None else farm_name(file.stem))
    parent = parent or (last.parent if last is not None else None) or DEFAULT_PARENT
    made = write_farm(found, name, parent, file.name, folder)
    for line in [*made.left_out, *remarks, *_missing(found)]:
        typer.echo(f"{file}: {line}", err=True)
    if output is None:
        typer.echo(made.text, nl=False)
        return
    if not _wrote(made, output.resolve(), file.name, force=force, into=update or dry_run, dry_run=dry_run):
        return
    if made.files:
        whence = (
            "out of a zip file"
            if _is_project(file)
            else "made of the capture; the maker's own in its place gives the data names"
        )
        print_line(f"{folder}: {counted(len(made.files), 'description file')} {whence}")
    counts = (len(made.drives), "drive"), (len(made.devices), "device"), (len(made.others), "other station")
    parts = [counted(*one) for one in counts if one[0] or one[1] != "device"]
    print_line(f"{output}: {', '.join(parts)} in comments")
    if made.drives or made.devices:
        print_line(f"next: pnfarm validate {output}")
    else:
        print_line("next: read its comments, choose a model (`pnfarm models`), and add `drives:`")


def _missing(found: Sequence[Found]) -> list[str]:
    """Description files that would make devices of stations, each once, with the stations that need it."""
    from pnfarm.buses.imports import FoundStation
    from pnfarm.vocabulary.quoting import shortened

    needed: dict[str, list[str]] = {}
    for one in found:
        if isinstance(one, FoundStation) and one.missing:
            needed.setdefault(one.missing, []).append(one.name)
    return [f"missing: {what}, for {shortened(names)}" for what, names in needed.items()]


def _check_options(output: Path | None, *, force: bool, update: bool, dry_run: bool) -> None:
    if output is None and (update or dry_run):
        raise ConfigError(f"{'--update' if update else '--dry-run'} needs -o FARM")
    if force and update:
        raise ConfigError("--force replaces what --update keeps: give one of them")


def _wrote(made: WrittenFarm, farm: Path, source: str, *, force: bool, into: bool, dry_run: bool) -> bool:
    """Write the farm file and what belongs to it, or show the difference; whether the file was made anew."""
    from pnfarm.farm.file.imported import plan_import
    from pnfarm.vocabulary.whole_files import write_whole

    was_there = farm.exists()
    plan = plan_import(made, farm, source, into=into and not force, force=force)
    if dry_run:
        typer.echo(plan.difference, nl=False)
    if dry_run or (was_there and not force):
        for sentence in plan.sentences:
            print_line(sentence)
    if plan.refused is not None:
        raise plan.refused
    if dry_run:
        return False
    try:
        write_whole(plan.files)
    except OSError as exc:
        raise ConfigError(f"{exc.filename} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc
    if was_there and not force:
        print_line(f"{farm}: {'updated' if farm in plan.files else 'nothing to change'}")
    return force or not was_there


def _listed(found: Sequence[Found]) -> list[Found]:
    """Without a folder for files that are to be written, devices are in comments."""
    from pnfarm.buses.imports import FoundDevice, FoundStation

    how = "with `-o FARM` it is a device of the farm, by a description file beside FARM"
    return [
        FoundStation(one.name, (how, *one.notes), one.line)
        if isinstance(one, FoundDevice) and one.file.octets is not None
        else one
        for one in found
    ]


def _is_project(file: Path) -> bool:
    from pnfarm.buses.projects.caex import is_project

    try:
        with file.open("rb") as begin:
            return is_project(begin.read(16))
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc


def _of_project(file: Path, folders: Sequence[Path], base: Path) -> tuple[list[Found], list[str]]:
    """What is in it, and description files that could not be read."""
    from pnfarm.buses import registry
    from pnfarm.buses.imports import ProjectBus
    from pnfarm.buses.projects.caex import MAX_OCTETS, NotCaexError, parse_caex
    from pnfarm.buses.projects.description_folders import DescriptionFolders
    from pnfarm.buses.projects.l5x import NotL5xError, is_l5x, parse_l5x
    from pnfarm.vocabulary.regular_file import read_regular

    try:
        data = read_regular(file, MAX_OCTETS + 1)
        kind, project = ("l5x", parse_l5x(data)) if is_l5x(data[:_HEAD]) else ("caex", parse_caex(data))
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    except NotCaexError as exc:
        raise ConfigError(f"{file} is not CAx data: {exc}") from exc
    except NotL5xError as exc:
        raise ConfigError(f"{file} is not an L5X file: {exc}") from exc
    at_hand = DescriptionFolders(folders, file.parent)
    found = [
        one
        for bus in registry.BUSES.values()
        if isinstance(bus, ProjectBus) and bus.project_kind == kind
        for one in bus.of_project(project, at_hand, base)
    ]
    return found, at_hand.remarks


def _of_capture(file: Path, *, models: bool) -> list[Found]:
    from pnfarm.buses import registry
    from pnfarm.buses.imports import ImportingBus
    from pnfarm.captures.reading import FrameReader

    decoder = registry.decoder()
    importing_buses = {key: bus for key, bus in registry.BUSES.items() if isinstance(bus, ImportingBus)}
    for key, bus in importing_buses.items():
        bus.observe(decoder.buses[key])
    reader = FrameReader(file, decoder.link_types)
    with working(f"reading {file}") as show:
        for frame in reader:
            decoder.feed(frame)
            if frame.number % SHOWN_FRAMES == 0:
                show(0, f"{frame.number:,} frames")
    if reader.complaint is not None:
        typer.echo(f"{file}: the file cannot be read to its end: {reader.complaint}", err=True)
    return [one for key, bus in importing_buses.items() for one in bus.found(decoder.buses[key], models=models)]
