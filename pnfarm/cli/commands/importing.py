"""``pnfarm import``: a farm file out of what is there already, captures of the plant or its engineering project."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.cli.farm_file import counted
from pnfarm.errors import ConfigError
from pnfarm.terminal.output import print_line
from pnfarm.terminal.settings import Format, FormatOption
from pnfarm.terminal.streams import going_on_unread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.imports import Found
    from pnfarm.farm.file.found import WrittenFarm

__all__ = ["importing"]

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
DEFAULT_PARENT = "eth1"


@going_on_unread()
def importing(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Captures of one plant (pcap, pcapng), or a project: CAx data (aml, amlx), L5X, or a folder of "
            "SIMATIC AX; with --check a farm file.",
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
    merge: Annotated[
        list[Path] | None,
        typer.Option(
            "--merge",
            metavar="FILE",
            help="Project or capture of the same plant, joined station by station; a project has priority over a "
            "capture, the first project over the next.  Repeatable.",
            show_default=False,
        ),
    ] = None,
    devices: Annotated[
        bool,
        typer.Option(
            "--devices", help="Use no drive model: a capture's drives become devices, too, if their bus supports it."
        ),
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace FARM, and description files beside it, if they exist.")
    ] = False,
    update: Annotated[
        bool,
        typer.Option("--update", help="If FARM exists, apply the project's changes to it; your changes stay."),
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show what --update would change, or a first import add; write nothing.")
    ] = False,
    check: CheckOption = None,
    seconds: SecondsOption = 2.0,
    baud: CheckBaudOption = 1_500_000,
    own: CheckOwnOption = 0,
    format_: FormatOption = Format.TABLE,
) -> None:
    """Make a farm file from captures, with GSDML files for PROFINET devices, from an engineering project, or from both.

    With --check, compare a running plant with the farm file FILE: exit code 0 if all is equal, else 1.  The plant is
    only read.
    """
    if check:
        from pnfarm.cli.station_check import check_stations

        if output is not None or merge or update or dry_run or len(files) != 1:
            raise ConfigError(
                "--check compares with one farm file, and writes none: leave -o, --merge, --update, --dry-run and "
                "further files out"
            )
        as_json = format_ is Format.JSON
        if not check_stations(files[0], check, seconds=seconds, baud=baud, own=own, as_json=as_json):
            raise typer.Exit(1)
        return
    from pnfarm.cli.projects.inputs import read_inputs
    from pnfarm.farm.file.found import farm_name, write_farm
    from pnfarm.farm.file.imported import read_record

    _check_options(output, force=force, update=update, dry_run=dry_run)
    folder = Path.cwd() if output is None else output.resolve().parent
    # names of files in a farm file are relative to its folder
    inputs = read_inputs(files, merge or [], folders or [], folder, models=not devices)
    found = inputs.found
    if output is None:
        found = _listed(found)
    last = read_record(output.resolve()) if output is not None and not force else None
    name = name or (last.name if last is not None else farm_name(files[0].stem))
    parent = parent or (last.parent if last is not None else None) or DEFAULT_PARENT
    made = write_farm(found, name, parent, inputs.source, folder)
    for line in [*inputs.remarks, *(f"{files[0]}: {line}" for line in [*made.left_out, *_missing(found)])]:
        typer.echo(line, err=True)
    if output is None:
        typer.echo(made.text, nl=False)
        return
    if not _wrote(made, output.resolve(), inputs.source, force=force, into=update or dry_run, dry_run=dry_run):
        return
    if made.files:
        whence = (
            "made from the capture; the maker's file instead gives the data names"
            if inputs.captured
            else "out of a zip file"
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
    """Write the farm file and what belongs to it, or show the difference; whether the file was made again."""
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
        if not plan.difference:
            print_line(f"{farm}: nothing to change")
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
        FoundStation(one.name, (how, *one.notes, *one.facts), one.line)
        if isinstance(one, FoundDevice) and one.file.octets is not None
        else one
        for one in found
    ]
