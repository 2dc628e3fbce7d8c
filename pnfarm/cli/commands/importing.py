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

    from pnfarm.buses.imports import FoundDrive, FoundStation

__all__ = ["importing"]

#: Frames between two looks at how far the reading is.
SHOWN_FRAMES = 5000


def importing(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="Capture (pcap, pcapng), or CAx data (aml, amlx).", show_default=False),
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
    gsdml: Annotated[
        list[Path] | None,
        typer.Option(
            "--gsdml",
            metavar="DIR",
            help="Folder with a project's GSDML files, beside the project's own.  Repeatable.",
            show_default=False,
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace FARM if it is there.")] = False,
) -> None:
    """Make a farm file from a capture or a TIA project's CAx data; devices without a model are listed in comments."""
    from pnfarm.farm.file.found import farm_name, write_farm

    folder = Path.cwd() if output is None else output.resolve().parent
    if _is_project(file):
        # names of files in a farm file are relative to its folder
        drives, others = _of_project(file, [*(gsdml or []), file.parent], folder)
    else:
        drives, others = _of_capture(file)
    if not drives and not others:
        needed = "a capture needs the start of a connection (Connect, Forward_Open, Set_Prm), or an answer to a search"
        raise ConfigError(f"{file} shows no device" + ("" if _is_project(file) else f": {needed}"))
    made = write_farm(drives, others, name or farm_name(file.stem), parent, file.name, folder)
    for line in made.left_out:
        typer.echo(f"{file}: {line}", err=True)
    text, drives, others = made.text, made.drives, made.others
    if output is None:
        typer.echo(text, nl=False)
        return
    try:
        with output.open("w" if force else "x", encoding="utf-8") as out:
            out.write(text)
    except FileExistsError:
        raise ConfigError(f"{output} is there already: give --force to replace it, or another name") from None
    except OSError as exc:
        raise ConfigError(f"{output} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc
    print_line(f"{output}: {counted(len(drives), 'drive')}, {counted(len(others), 'other station')} in comments")
    if drives:
        print_line(f"next: pnfarm validate {output}")
    else:
        print_line("next: read its comments, choose a model (`pnfarm models`), and add `drives:`")


def _is_project(file: Path) -> bool:
    from pnfarm.buses.caex import is_project

    try:
        with file.open("rb") as begin:
            return is_project(begin.read(16))
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc


def _of_project(file: Path, folders: Sequence[Path], base: Path) -> tuple[list[FoundDrive], list[FoundStation]]:
    from pnfarm.buses import registry
    from pnfarm.buses.caex import MAX_OCTETS, NotCaexError, parse_caex
    from pnfarm.buses.imports import ProjectBus
    from pnfarm.vocabulary.regular_file import read_regular

    try:
        root = parse_caex(read_regular(file, MAX_OCTETS + 1))
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    except NotCaexError as exc:
        raise ConfigError(f"{file} is not CAx data: {exc}") from exc
    found = [
        one
        for bus in registry.BUSES.values()
        if isinstance(bus, ProjectBus)
        for one in bus.of_project(root, folders, base)
    ]
    return _parted(found)


def _parted(found: Sequence[FoundDrive | FoundStation]) -> tuple[list[FoundDrive], list[FoundStation]]:
    from pnfarm.buses.imports import FoundDrive, FoundStation

    return [one for one in found if isinstance(one, FoundDrive)], [
        one for one in found if isinstance(one, FoundStation)
    ]


def _of_capture(file: Path) -> tuple[list[FoundDrive], list[FoundStation]]:
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
    return _parted([one for key, bus in importing_buses.items() for one in bus.found(decoder.buses[key])])
