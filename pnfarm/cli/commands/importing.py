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

__all__ = ["importing"]

#: Frames between two looks at how far the reading is.
SHOWN_FRAMES = 5000


def importing(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Capture (pcap, pcapng), CAx data (aml, amlx), L5X, or a folder of SIMATIC AX.",
            show_default=False,
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
        typer.Option("--name", metavar="NAME", help="The farm's name; default: the file's.", show_default=False),
    ] = None,
    parent: Annotated[
        str, typer.Option("--parent", metavar="IF", help="Network interface of the farm's macvlan link.")
    ] = "eth1",
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
) -> None:
    """Make a farm file from a capture, with GSDML files for its PROFINET devices, or from a TIA project's CAx data."""
    from pnfarm.cli.project_file import is_project_file
    from pnfarm.farm.file.found import farm_name, write_farm

    is_project = is_project_file(file)
    folder = Path.cwd() if output is None else output.resolve().parent
    if is_project:
        if devices:
            raise ConfigError("--devices is for captures: a project says too little of a station's data")
        # names of files in a farm file are relative to its folder
        found, remarks = _of_project(file, folders or [], folder)
    else:
        found, remarks = _of_capture(file, models=not devices), []
    if not found:
        needed = "a capture needs the start of a connection (Connect, Forward_Open, Set_Prm), or an answer to a search"
        raise ConfigError(f"{file} shows no device" + ("" if is_project else f": {needed}"))
    if output is None:
        found = _listed(found)
    made = write_farm(found, name or farm_name(file.stem), parent, file.name, folder)
    for line in [*made.left_out, *remarks, *_missing(found)]:
        typer.echo(f"{file}: {line}", err=True)
    if output is None:
        typer.echo(made.text, nl=False)
        return
    files = {**{folder / own: octets for own, octets in made.files.items()}, output: made.text.encode()}
    there = [path for path in files if path.exists() and not force]
    if there:
        raise ConfigError(f"{there[0]} is there already: give --force to replace it, or another name")
    for path, octets in files.items():
        _write(path, octets)
    if made.files:
        whence = (
            "out of a zip file"
            if is_project
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


def _write(path: Path, octets: bytes) -> None:
    try:
        path.write_bytes(octets)
    except OSError as exc:
        raise ConfigError(f"{path} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc


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


def _of_project(file: Path, folders: Sequence[Path], base: Path) -> tuple[list[Found], list[str]]:
    """What is in it, and description files that could not be read."""
    from pnfarm.cli.project_file import description_folders, read_project

    buses, project = read_project(file)
    at_hand = description_folders(file, folders)
    found = [one for bus in buses for one in bus.of_project(project, at_hand, base)]
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
