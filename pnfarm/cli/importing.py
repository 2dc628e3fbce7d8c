"""``pnfarm import``: a farm file out of what is there already, a capture of the plant or its engineering project."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.imports import FoundDrive, FoundStation

__all__ = ["farm_text", "importing"]

#: Characters of a comment's line.
_WIDTH = 116
#: Frames between two looks at how far the reading is.
SHOWN_FRAMES = 5000
#: A name that a farm file may have.
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9-]*[a-z0-9])?(?:\.[a-z0-9](?:[a-z0-9-]*[a-z0-9])?)*")


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
    """Make a farm file of a capture or a TIA project's CAx data: what no model stands for is listed in comments."""
    from pnfarm.errors import ConfigError
    from pnfarm.terminal.output import print_line

    if _is_project(file):
        # names of files in a farm file are relative to its folder
        base = Path.cwd() if output is None else output.resolve().parent
        drives, others = _of_project(file, [*(gsdml or []), file.parent], base)
    else:
        drives, others = _of_capture(file)
    if not drives and not others:
        needed = "a capture needs the start of a connection (Connect, Forward_Open, Set_Prm), or an answer to a search"
        raise ConfigError(f"{file} shows no device" + ("" if _is_project(file) else f": {needed}"))
    text = farm_text(drives, others, name or _farm_name(file.stem), parent, str(file.name))
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
    counts = (f"{len(found)} {what}{'' if len(found) == 1 else 's'}" for found, what in _counted(drives, others))
    print_line(f"{output}: {', '.join(counts)} in comments")
    if drives:
        print_line(f"next: pnfarm validate {output}")
    else:
        print_line("next: read its comments, choose a model (`pnfarm models`), and add `drives:`")


def _counted(drives: list[FoundDrive], others: list[FoundStation]) -> tuple[tuple[Sequence[object], str], ...]:
    return (drives, "drive"), (others, "other station")


def _is_project(file: Path) -> bool:
    from pnfarm.buses.caex import is_project
    from pnfarm.errors import ConfigError

    try:
        with file.open("rb") as begin:
            return is_project(begin.read(16))
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc


def _of_project(file: Path, folders: Sequence[Path], base: Path) -> tuple[list[FoundDrive], list[FoundStation]]:
    from pnfarm.buses import registry
    from pnfarm.buses.caex import MAX_OCTETS, NotCaexError, parse_caex
    from pnfarm.buses.imports import ProjectBus
    from pnfarm.errors import ConfigError
    from pnfarm.vocabulary.regular_file import read_regular

    try:
        root = parse_caex(read_regular(file, MAX_OCTETS + 1))
    except OSError as exc:
        raise ConfigError(f"{file} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    except NotCaexError as exc:
        raise ConfigError(f"{file} is no CAx data: {exc}") from exc
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
    from pnfarm.terminal.working import working

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


def _farm_name(stem: str) -> str:
    found = re.sub(r"[^a-z0-9-]+", "-", stem.lower()).strip("-")
    return found[:40] or "imported"


def farm_text(drives: Sequence[FoundDrive], others: Sequence[FoundStation], name: str, parent: str, source: str) -> str:
    """The farm file, with comments about what was seen."""
    lines = [
        f"# Made by `pnfarm import {source}`. What was seen of each drive is in its comments: check them.",
        f"farm: {name}",
        *_link(drives or others, parent),
        "api: 127.0.0.1:8702",
    ]
    if drives:
        lines.append("drives:")
        taken: set[str] = set()
        for drive in drives:
            lines += _group(drive, taken)
    else:
        lines += [
            "# No drive of a known kind was seen (`pnfarm models` lists them), and a farm needs one:",
            "# drives:",
        ]
    if others:
        lines += ["", "# Other stations, which no model stands for:"]
        for one in others:
            lines += _comment(f"{one.name}: {'; '.join(one.facts)}", "#   ")
    return "\n".join(lines) + "\n"


def _link(stations: Sequence[FoundDrive | FoundStation], parent: str) -> list[str]:
    """The network's link, a line, or both; a capture does not say how a line is reached, nor its rate."""
    lines = sorted({one.line for one in stations if one.line})
    if lines and all(one.line for one in stations):
        return ["link: {kind: serial, pty: auto}   # the log has its far end; or {kind: serial, port: ..., baud: ...}"]
    network = f"kind: macvlan, parent: {parent}"
    if lines:
        network += ", lines: {" + ", ".join(f"{name}: {{pty: auto}}" for name in lines) + "}"
    return [f"link: {{{network}}}   # the interface that leads to the PLC"]


def _group(drive: FoundDrive, taken: set[str]) -> list[str]:
    lines = []
    own = drive.name.lower()
    if _NAME.fullmatch(own) is None or own in taken:
        lines += _comment(f"its name was {drive.name!r}", "  # ")
        own = re.sub(r"[^a-z0-9]+", "-", own).strip("-") or "drive"
        while own in taken:
            own += "-again"
    taken.add(own)
    for note in drive.notes:
        lines += _comment(note, "  # ")
    lines += [f"  - name: {own}", f"    model: {drive.model}"]
    # a number that is no ident, such as a telegram's, is decimal
    lines += [f"    {key}: {value if isinstance(value, int) else _value(value)}" for key, value in drive.keys.items()]
    return lines


def _value(value: Any) -> str:
    """In YAML's flow style; idents as hexadecimal numbers."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)}: {_value(one)}" for key, one in value.items()) + "}"
    if isinstance(value, int):
        return f"0x{value:X}"
    text = str(value)
    # 2.1 would be a number
    plain = re.fullmatch(r"[A-Za-z0-9./-]+", text) and not re.fullmatch(r"[0-9.]+", text)
    return text if plain else "'" + text.replace("'", "''") + "'"


def _key(key: Any) -> str:
    return f"0x{key:X}" if isinstance(key, int) and key >= 0x8000 else str(key)


def _comment(text: str, begin: str) -> list[str]:
    import textwrap

    return textwrap.wrap(text, _WIDTH, initial_indent=begin, subsequent_indent=begin + "  ") or [begin.rstrip()]
