"""``pnfarm import``: a farm file out of what is there already, a capture of the plant."""

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
#: A name that a farm file may have.
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9-]*[a-z0-9])?(?:\.[a-z0-9](?:[a-z0-9-]*[a-z0-9])?)*")


def importing(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Capture of the plant, pcap or pcapng.", show_default=False)
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
    force: Annotated[bool, typer.Option("--force", help="Replace FARM if it is there.")] = False,
) -> None:
    """Make a farm file of a capture: drives of known kind become models, everything else is listed in comments."""
    from pnfarm.errors import ConfigError
    from pnfarm.terminal.output import print_line

    drives, others = _of_capture(file)
    if not drives and not others:
        raise ConfigError(
            f"{file} shows no device: it needs the start of a connection (Connect) or an Identify response"
        )
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
    print_line(f"{output}: {len(drives)} drives, {len(others)} other stations in comments")
    print_line(f"next: pnfarm validate {output}")


def _of_capture(file: Path) -> tuple[list[FoundDrive], list[FoundStation]]:
    from pnfarm.buses import registry
    from pnfarm.buses.imports import FoundDrive, FoundStation, ImportingBus
    from pnfarm.captures.reading import FrameReader

    decoder = registry.decoder()
    importing_buses = {key: bus for key, bus in registry.BUSES.items() if isinstance(bus, ImportingBus)}
    for key, bus in importing_buses.items():
        bus.observe(decoder.buses[key])
    reader = FrameReader(file, decoder.link_types)
    for frame in reader:
        decoder.feed(frame)
    if reader.complaint is not None:
        typer.echo(f"{file}: the file cannot be read to its end: {reader.complaint}", err=True)
    everything = [one for key, bus in importing_buses.items() for one in bus.found(decoder.buses[key])]
    drives = [one for one in everything if isinstance(one, FoundDrive)]
    return drives, [one for one in everything if isinstance(one, FoundStation)]


def _farm_name(stem: str) -> str:
    found = re.sub(r"[^a-z0-9-]+", "-", stem.lower()).strip("-")
    return found[:40] or "imported"


def farm_text(drives: Sequence[FoundDrive], others: Sequence[FoundStation], name: str, parent: str, source: str) -> str:
    """The farm file, with comments about what was seen."""
    lines = [
        f"# Made by `pnfarm import {source}`. What was seen of each drive is in its comments: check them.",
        f"farm: {name}",
        f"link: {{kind: macvlan, parent: {parent}}}   # the interface that leads to the PLC",
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
    lines += [f"    {key}: {_value(value)}" for key, value in drive.keys.items()]
    return lines


def _value(value: Any) -> str:
    """In YAML's flow style; idents as hexadecimal numbers."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)}: {_value(one)}" for key, one in value.items()) + "}"
    if isinstance(value, int):
        return f"0x{value:X}"
    text = str(value)
    return text if re.fullmatch(r"[A-Za-z0-9./-]+", text) else "'" + text.replace("'", "''") + "'"


def _key(key: Any) -> str:
    return f"0x{key:X}" if isinstance(key, int) and key >= 0x8000 else str(key)


def _comment(text: str, begin: str) -> list[str]:
    import textwrap

    return textwrap.wrap(text, _WIDTH, initial_indent=begin, subsequent_indent=begin + "  ") or [begin.rstrip()]
