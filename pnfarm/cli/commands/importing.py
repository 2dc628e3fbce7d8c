"""``pnfarm import``: a farm file out of what is there already, a capture of the plant or its engineering project."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.cli.farm_file import counted
from pnfarm.errors import ConfigError
from pnfarm.terminal.output import print_line
from pnfarm.terminal.settings import Format, FormatOption
from pnfarm.terminal.working import working

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.imports import Found

__all__ = ["importing", "is_project_file", "of_project"]

CheckOption = Annotated[
    list[str] | None,
    typer.Option(
        "--check",
        metavar="WHERE",
        help="Compare the plant at a network interface, such as eth1, or on a serial line (path of a port or pty, "
        "HOST:PORT, rfc2217://HOST:PORT) with the farm file FILE.  Repeatable.",
        show_default=False,
    ),
]
SecondsOption = Annotated[
    float, typer.Option(min=0.1, max=60, help="With --check: how long to wait for answers to a search.")
]
CheckBaudOption = Annotated[int, typer.Option("--baud", metavar="RATE", help="With --check: a line's bits per second.")]
CheckOwnOption = Annotated[
    int, typer.Option("--own-address", metavar="N", help="With --check: the station address to ask from on a line.")
]

#: Octets in which the root of an XML file begins.
_HEAD = 4096
#: Frames between two looks at how far the reading is.
SHOWN_FRAMES = 5000


def importing(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Capture (pcap, pcapng), CAx data (aml, amlx), or L5X; with --check a farm file.",
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
    check: CheckOption = None,
    seconds: SecondsOption = 2.0,
    baud: CheckBaudOption = 1_500_000,
    own: CheckOwnOption = 0,
    format_: FormatOption = Format.TABLE,
) -> None:
    """Make a farm file from a capture, with GSDML files for its PROFINET devices, or from a TIA project's CAx data.

    With --check, compare a plant that runs with the farm file FILE: exit code 0 if all is equal, else 1.  Its stations
    are only asked.
    """
    if check:
        from pnfarm.cli.plant_check import check_plant

        if output is not None:
            raise ConfigError("--check writes no file: leave -o out")
        as_json = format_ is Format.JSON
        if not check_plant(file, check, seconds=seconds, baud=baud, own=own, as_json=as_json):
            raise typer.Exit(1)
        return
    from pnfarm.farm.file.found import farm_name, write_farm

    folder = Path.cwd() if output is None else output.resolve().parent
    if is_project_file(file):
        if devices:
            raise ConfigError("--devices is for captures: a project says too little of a station's data")
        # names of files in a farm file are relative to its folder
        found, remarks = of_project(file, folders or [], folder)
    else:
        found, remarks = _of_capture(file, models=not devices), []
    if not found:
        needed = "a capture needs the start of a connection (Connect, Forward_Open, Set_Prm), or an answer to a search"
        raise ConfigError(f"{file} shows no device" + ("" if is_project_file(file) else f": {needed}"))
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
            if is_project_file(file)
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


def is_project_file(file: Path) -> bool:
    from pnfarm.buses.projects.caex import is_project

    try:
        with file.open("rb") as begin:
            return is_project(begin.read(16))
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc


def of_project(file: Path, folders: Sequence[Path], base: Path) -> tuple[list[Found], list[str]]:
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
